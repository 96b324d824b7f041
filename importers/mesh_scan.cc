#include "importers/mesh_scan.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace roomtex {

std::array<uint8_t, 3> ColorScale::Bytes(const Eigen::Vector3d& rgb, CellColors* before) {
  if (!rgb.allFinite()) return {0, 0, 0};
  for (const double next : {255.0, 65535.0}) {
    if (rgb.maxCoeff() <= largest_ || largest_ >= next) continue;
    for (std::array<uint8_t, 3>& color : *before) {
      for (uint8_t& value : color) {
        value = static_cast<uint8_t>(std::lround(value * largest_ / next));
      }
    }
    largest_ = next;
  }
  std::array<uint8_t, 3> bytes;
  for (size_t k = 0; k < 3; ++k) {
    bytes[k] = static_cast<uint8_t>(
        std::lround(255 * std::clamp(rgb[static_cast<Eigen::Index>(k)] / largest_, 0.0, 1.0)));
  }
  return bytes;
}

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
    if (!scan->colors.empty()) scan->colors[i] = {0, 0, 0};
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

void FindViewpoint(Scan* mesh) {
  constexpr double kWithin = 0.4;  // of the extent, from the middle
  const Bounds bounds = FindBounds(*mesh);
  const Eigen::Vector3d middle = (bounds.min + bounds.max) / 2;
  const Eigen::Vector3d from_middle = mesh->scan_from_station.translation - middle;
  const Eigen::Vector3d extent = bounds.max - bounds.min;
  if ((from_middle.array().abs() <= kWithin * extent.array()).all()) return;
  mesh->viewpoint = mesh->scan_from_station.Inverse() * middle;
}

void FinishCloud(const std::string& path, double max_range, Scan* scan) {
  const Eigen::Vector3d station = scan->Station();
  size_t kept = 0;
  for (size_t i = 0; i < scan->points.size(); ++i) {
    const double range = (scan->points[i] - station).norm();
    if (!std::isfinite(range) || (max_range > 0 && range > max_range)) continue;
    scan->points[kept] = scan->points[i];
    if (!scan->colors.empty()) scan->colors[kept] = scan->colors[i];
    if (!scan->normals.empty()) {
      const Eigen::Vector3f& normal = scan->normals[i];
      const bool is_one = normal.allFinite() && normal.norm() > 0.5f;
      scan->normals[kept] = is_one ? normal.normalized() : Eigen::Vector3f::Zero().eval();
    }
    scan->intensity[kept++] = scan->intensity[i];
  }
  scan->points.resize(kept);
  scan->intensity.resize(kept);
  if (!scan->colors.empty()) scan->colors.resize(kept);
  if (!scan->normals.empty()) scan->normals.resize(kept);
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
