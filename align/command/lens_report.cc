#include "align/command/lens_report.h"

#include <cmath>

namespace roomtex {
namespace {

// The lens as the adjustment to the scan has it, where that freed it. camera_id: of the model that
// was aligned.
LensFinding LastWordOn(LensFinding lens, uint32_t camera_id, const Alignment& alignment) {
  const ModelAdjustment& adjustment = alignment.adjustment;
  if (!alignment.adjusted() || !adjustment.freed) return lens;
  lens.found = adjustment.bundle.model.cameras.at(camera_id);
  lens.used = true;
  if (lens.found.model != lens.told.model) lens.told = alignment.told_cameras.at(camera_id);
  const auto at = adjustment.camera_covariances.find(camera_id);
  if (at == adjustment.camera_covariances.end()) return lens;
  lens.SetCovariance(at->second);
  return lens;
}

}  // namespace

Json CamerasToJson(const Alignment& alignment) {
  const LensCheck& check = alignment.lenses;
  Json json = Json::array();
  for (size_t i = 0; i < check.lenses.size(); ++i) {
    const LensFinding& lens = check.lenses[i];
    uint32_t camera_id = lens.camera_ids.front();
    for (const auto& [id, index] : check.lens_of_camera) {
      if (check.mended && index == static_cast<int>(i)) camera_id = id;
    }
    Json one = LensToJson(LastWordOn(lens, camera_id, alignment));
    one["focal_px"]["by_photos"] = lens.found.MeanFocalLength();
    one["focal_px"]["sigma_by_photos"] =
        std::isfinite(lens.focal_sigma) ? Json(lens.focal_sigma) : Json(nullptr);
    json.push_back(one);
  }
  return json;
}

}  // namespace roomtex
