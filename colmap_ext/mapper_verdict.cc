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
