#include "core/report.h"

#include <cmath>

#include "core/frames.h"
#include "core/output_file.h"

namespace roomtex {

void Report::SetUntrusted(const std::string& reason) {
  SetUnfinished(reason);
  ends_untrusted_ = true;
}

void Report::SetUnfinished(const std::string& reason) {
  reason_ += (reason_.empty() ? "" : " ") + reason;
}

Json NumberOrNull(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

double NumberAt(const Json& json, std::initializer_list<const char*> keys) {
  const Json* at = &json;
  for (const char* key : keys) {
    if (!at->is_object() || !at->contains(key)) return std::nan("");
    at = &(*at)[key];
  }
  return at->is_number() ? at->get<double>() : std::nan("");
}

Json ToJson(const Eigen::VectorXd& vector) {
  return Json(std::vector<double>(vector.data(), vector.data() + vector.size()));
}

Json ToJson(const Similarity& similarity) {
  Json json;
  json["scale"] = similarity.scale;
  json["rotation_wxyz"] = ToJson(WxyzFromQuaternion(similarity.rotation));
  json["translation"] = ToJson(similarity.translation);
  return json;
}

void WriteJson(const std::string& path, const Json& json) {
  OutputFile file(path);
  file.stream() << json.dump(2, ' ', false, Json::error_handler_t::replace) << '\n';
  file.Commit();
}

}  // namespace roomtex
