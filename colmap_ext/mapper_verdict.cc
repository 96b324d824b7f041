#include "colmap_ext/mapper_verdict.h"

#include <cmath>

#include "core/frames.h"
#include "core/json_text.h"
#include "core/result_names.h"

namespace roomtex {
namespace {

// `count` numbers, or nothing.
std::vector<double> NumbersOf(const Json& list, size_t count) {
  std::vector<double> numbers;
  if (!list.is_array() || list.size() != count) return numbers;
  for (const Json& one : list) {
    if (one.is_number()) numbers.push_back(one.get<double>());
  }
  return numbers.size() == count ? numbers : std::vector<double>();
}

std::vector<std::pair<std::string, Rigid>> ToldPoses(const Json& list, const SparseModel& model) {
  std::vector<std::pair<std::string, Rigid>> poses;
  for (const Json& one : list.is_array() ? list : Json::array()) {
    if (!one.is_object()) continue;
    const Json name = one.value("name", Json());
    const std::vector<double> q = NumbersOf(one.value("rotation_wxyz", Json()), 4);
    const std::vector<double> t = NumbersOf(one.value("translation", Json()), 3);
    if (!name.is_string() || model.FindImage(name) == nullptr || q.empty() || t.empty()) continue;
    const Eigen::Quaterniond turn = QuaternionFromWxyz({q[0], q[1], q[2], q[3]});
    if (!(std::abs(turn.norm() - 1) < 1e-3)) continue;
    poses.push_back({name, {turn.normalized(), {t[0], t[1], t[2]}}});
  }
  return poses;
}

}  // namespace

MapperVerdict ReadMapperVerdict(const std::string& folder, const SparseModel& model) {
  MapperVerdict verdict;
  const Json json = ReadJsonIfAny(folder + "/" + kMapperReportName);
  if (!json.is_object()) return verdict;
  if (json.value("num_reg_images", Json()) != model.images.size() ||
      json.value("num_points", Json()) != model.points.size()) {
    return verdict;
  }
  verdict.refined = json.value("refined_intrinsics", Json()) == true;
  verdict.is_alike = json.value("is_alike", Json()) == true;
  const Json known = json.value("known", Json());
  if (known.is_object() && known.value("placed", Json()) == true) {
    const Json rms = known.value("position_rms_m", Json());
    if (rms.is_number() && rms.get<double>() >= 0) verdict.known_rms = rms.get<double>();
    const Json held = known.value("photos_held", Json::array());
    for (const Json& name : held.is_array() ? held : Json::array()) {
      if (name.is_string() && model.FindImage(name) != nullptr) verdict.photos_held.push_back(name);
    }
  } else if (known.is_object()) {
    verdict.told_poses = ToldPoses(known.value("told", Json()), model);
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
