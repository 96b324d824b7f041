#include "importers/mesh_scan.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace roomtex {

void FinishMesh(const std::string& path, double max_range, Scan* scan) {
  scan->organised = false;
  scan->path = path;
  scan->num_columns = static_cast<int>(scan->points.size());
  scan->num_rows = 1;
  const Eigen::Vector3d station = scan->Station();
  for (size_t i = 0; i < scan->points.size(); ++i) {
    const double range = (scan->points[i] - station).norm();
    if (std::isfinite(range) && (max_range <= 0 || range <= max_range)) continue;
    scan->points[i] = Scan::MissingPoint();
    scan->intensity[i] = 0;
  }
  const auto is_open = [scan](const Triangle& t) {
    return std::any_of(t.begin(), t.end(), [scan](int i) { return scan->IsMissing(i); });
  };
  scan->triangles.erase(std::remove_if(scan->triangles.begin(), scan->triangles.end(), is_open),
                        scan->triangles.end());
  if (!scan->triangles.empty()) return;
  throw InputError(path, "", "holds no triangle with three measured corners",
                   max_range > 0 ? "Give a larger --max_range" : "Give another file");
}

void FinishCloud(const std::string& path, double max_range, Scan* scan) {
  const Eigen::Vector3d station = scan->Station();
  size_t kept = 0;
  for (size_t i = 0; i < scan->points.size(); ++i) {
    const double range = (scan->points[i] - station).norm();
    if (!std::isfinite(range) || (max_range > 0 && range > max_range)) continue;
    scan->points[kept] = scan->points[i];
    scan->intensity[kept++] = scan->intensity[i];
  }
  scan->points.resize(kept);
  scan->intensity.resize(kept);
  scan->triangles.clear();
  scan->path = path;
  scan->organised = false;
  scan->num_columns = static_cast<int>(kept);
  scan->num_rows = 1;
  if (kept > 0) return;
  throw InputError(path, "", "holds no measured point",
                   max_range > 0 ? "Give a larger --max_range" : "Give another file");
}

}  // namespace roomtex
