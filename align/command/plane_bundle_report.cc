#include "align/command/plane_bundle_report.h"

#include <algorithm>
#include <cmath>

#include "core/frames.h"

namespace roomtex {

namespace {

Json BendToJson(const Alignment& alignment) {
  const ModelAdjustment& adjustment = alignment.adjustment;
  if (!adjustment.bend) return nullptr;
  double range = 0, azimuth = 0;
  for (const SurfaceConstraint& c : adjustment.bundle.constraints) {
    const Eigen::Vector2d at =
        adjustment.bend->bend.At(adjustment.bundle.model.points.at(c.point3d_id).x_in_model);
    range = std::max(range, std::abs(at[0]));
    azimuth = std::max(azimuth, std::abs(at[1]));
  }
  Json json;
  json["rms_m"] = adjustment.bend->bend_rms;
  json["followed"] = adjustment.bend->followed;
  json["max_range_share"] = range;
  json["max_azimuth_deg"] = DegFromRad(azimuth);
  return json;
}

Json CornersToJson(const CornerAdjustment& corners) {
  if (corners.num_corners == 0) return nullptr;
  return {{"num_corners", corners.num_corners},
          {"num_photos", corners.num_photos},
          {"held_out_before_px", NumberOrNull(corners.held_out_before_px)},
          {"held_out_after_px", NumberOrNull(corners.held_out_after_px)},
          {"correlation_before", NumberOrNull(corners.correlation_before)},
          {"correlation_after", NumberOrNull(corners.correlation_after)},
          {"used", corners.used}};
}

}  // namespace

Json PlaneBundleToJson(const Alignment& alignment) {
  const PlaneBundle& bundle = alignment.adjustment.bundle;
  if (bundle.model.images.empty()) return nullptr;
  Json json;
  json["used"] = alignment.adjusted();
  json["reason"] = bundle.reason;
  json["num_points"] = bundle.constraints.size();
  json["num_on_patches"] = std::count_if(bundle.constraints.begin(), bundle.constraints.end(),
                                         [](const SurfaceConstraint& c) { return c.on_patch; });
  json["sigma_px"] = bundle.sigma_px;
  json["num_rounds"] = bundle.num_rounds;
  json["bending_m"] = bundle.max_bending;
  json["not_adjusted"] = Json::array();
  for (const uint32_t id : bundle.idle_images) {
    json["not_adjusted"].push_back(bundle.model.images.at(id).name);
  }
  json["scan_bend"] = BendToJson(alignment);
  json["corners"] = CornersToJson(alignment.corners);
  return json;
}

void SetNumPointsOfPlanes(const Alignment& alignment, Json* planes) {
  const std::vector<int>& counts = alignment.adjustment.bundle.num_points_of_plane;
  for (size_t i = 0; alignment.adjusted() && i < counts.size() && i < planes->size(); ++i) {
    (*planes)[i]["num_points"] = counts[i];
  }
}

}  // namespace roomtex
