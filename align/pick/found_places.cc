#include "align/pick/found_places.h"

#include <algorithm>

#include "colmap_ext/sparse_model.h"

namespace roomtex {
namespace {

// The value, or null if there is none.
Json KeyOf(const Json& json, const char* name) {
  return json.is_object() ? json.value(name, Json()) : Json();
}

// The report itself, or that of each sparse model, in their order.
Json ReportsOfModels(const Json& report) {
  const Json models = KeyOf(report, "models");
  return models.is_array() ? models : Json::array({report});
}

std::string PhotoToConfirmIn(const Json& report, const PickScene& scene) {
  const Json reports = ReportsOfModels(report);
  for (int model = 0; model < static_cast<int>(reports.size()); ++model) {
    if (KeyOf(KeyOf(reports[model], "search"), "hint_decides") != true) continue;
    for (const PickPhoto* photo : scene.Ranked({})) {
      if (photo->model == model && !photo->missing) return photo->name();
    }
  }
  return "";
}

}  // namespace

bool IsMirroredReading(const Json& report, const PickScene& scene) {
  const Json scans = KeyOf(report, "scans");
  return std::any_of(scans.begin(), scans.end(), [&scene](const Json& scan) {
    const Json azimuth = KeyOf(scan, "azimuth");
    const std::string read = azimuth.is_string() ? azimuth.get<std::string>() : "";
    return !read.empty() && read != scene.azimuth();
  });
}

std::shared_ptr<const FoundPlaces> ReadFoundPlaces(const std::string& aligned_path,
                                                   const Json& report, const PickScene& scene) {
  const Json reports = ReportsOfModels(report);
  const bool searched = std::any_of(reports.begin(), reports.end(), [](const Json& one) {
    return KeyOf(one, "search").is_object();
  });
  // A refusal leaves the model of an earlier run beside it.
  const bool has_model = KeyOf(report, "images").is_array();
  if (!searched || !has_model || IsMirroredReading(report, scene)) return nullptr;
  auto found = std::make_shared<FoundPlaces>();
  found->trusted = KeyOf(report, "trusted") == true;
  if (!found->trusted) found->confirm_in = PhotoToConfirmIn(report, scene);
  const SparseModel model = ReadSparseModel(aligned_path);
  std::map<uint32_t, std::shared_ptr<const CameraProjection>> projections;
  for (const auto& [id, camera] : model.cameras) {
    projections[id] = std::make_shared<const CameraProjection>(camera);
  }
  for (const auto& [id, image] : model.images) {
    found->photos[image.name] = {image.cam_from_model, projections.at(image.camera_id)};
  }
  return found;
}

}  // namespace roomtex
