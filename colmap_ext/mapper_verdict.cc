#include "colmap_ext/mapper_verdict.h"

#include "core/json_text.h"

namespace roomtex {

MapperVerdict ReadMapperVerdict(const std::string& folder, const SparseModel& model) {
  MapperVerdict verdict;
  const Json json = ReadJsonIfAny(folder + "/" + kMapperReportName);
  if (!json.is_object()) return verdict;
  if (json.value("num_reg_images", Json()) != model.images.size() ||
      json.value("num_points", Json()) != model.points.size()) {
    return verdict;
  }
  verdict.refined = json.value("refined_intrinsics", Json()) == true;
  const Json known = json.value("known", Json());
  if (known.is_object() && known.value("placed", Json()) == true) {
    const Json rms = known.value("position_rms_m", Json());
    if (rms.is_number() && rms.get<double>() >= 0) verdict.known_rms = rms.get<double>();
    const Json held = known.value("photos_held", Json::array());
    for (const Json& name : held.is_array() ? held : Json::array()) {
      if (name.is_string() && model.FindImage(name) != nullptr) verdict.photos_held.push_back(name);
    }
  }
  const Json reasons = json.value("reasons", Json::array());
  for (const Json& one : reasons.is_array() ? reasons : Json::array()) {
    if (!one.is_object()) continue;
    const Json about = one.value("about", Json()), reason = one.value("reason", Json());
    if (!about.is_string() || !reason.is_string()) continue;
    std::vector<std::string>& list = about == "calibration" ? verdict.calibration
                                     : about == "motion"    ? verdict.motion
                                                            : verdict.photos;
    list.push_back(reason.get<std::string>());
  }
  return verdict;
}

}  // namespace roomtex
