#include "texture/view/view_shifts.h"

#include <filesystem>

#include "core/json_text.h"

namespace roomtex {
namespace {

// Empty if anything in it is not as it should be.
Json MapOf(const Json& image) {
  constexpr size_t kMost = 64;  // rows, columns
  const auto found = image.find("shift_map_px");
  if (found == image.end() || !found->is_array() || found->size() > kMost) return Json::array();
  for (const Json& row : *found) {
    if (!row.is_array() || row.empty() || row.size() > kMost) return Json::array();
    if (row.size() != found->front().size()) return Json::array();
    for (const Json& value : row) {
      if (!value.is_null() && !(value.is_number() && value.get<double>() >= 0)) {
        return Json::array();
      }
    }
  }
  return *found;
}

}  // namespace

std::map<std::string, Json> ReadViewShifts(const std::string& folder) {
  const Json report = ReadJsonIfAny((std::filesystem::path(folder) / "report.json").string());
  std::map<std::string, Json> shifts;
  const auto images = report.is_object() ? report.find("images") : report.end();
  if (images == report.end() || !images->is_array()) return shifts;
  for (const Json& image : *images) {
    if (!image.is_object() || !image.contains("name") || !image["name"].is_string()) continue;
    const double before = NumberAt(image, {"shift_px", "before"});
    const double after = NumberAt(image, {"shift_px", "after"});
    const double mm = NumberAt(image, {"shift_before_mm"});
    // Of a photo at which nothing could be compared 0 says nothing.
    if (!(before >= 0 && after >= 0 && mm >= 0 && NumberAt(image, {"share_measured"}) > 0))
      continue;
    shifts[image["name"].get<std::string>()] = {
        {"before_px", before}, {"after_px", after}, {"before_mm", mm}, {"map_px", MapOf(image)}};
  }
  return shifts;
}

}  // namespace roomtex
