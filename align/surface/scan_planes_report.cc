#include "align/surface/scan_planes_report.h"

#include <algorithm>
#include <cmath>

namespace roomtex {
namespace {

constexpr double kLeastRms = 0.001, kFarthest = 0.01;  // metres

}  // namespace

int CountPointsOnPlane(const ScanPlane& plane, const SparseModel& aligned) {
  const double limit = std::min(3 * std::max(plane.rms, kLeastRms), kFarthest);
  int count = 0;
  for (const auto& [id, point] : aligned.points) {
    count += std::abs(plane.Distance(point.x_in_model)) < limit && plane.Covers(point.x_in_model);
  }
  return count;
}

Json ScanPlanesToJson(const std::vector<ScanPlane>& planes, const SparseModel& aligned) {
  Json all = Json::array();
  for (const ScanPlane& plane : planes) {
    Json one;
    one["normal"] = ToJson(plane.normal);
    one["point"] = ToJson(plane.point);
    one["area_m2"] = plane.area_m2;
    one["num_samples"] = plane.num_samples;
    one["num_points"] = CountPointsOnPlane(plane, aligned);
    one["rms_m"] = plane.rms;
    all.push_back(one);
  }
  return all;
}

}  // namespace roomtex
