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

namespace {

void MakeMissing(size_t i, Scan* scan) {
  scan->points[i] = Scan::MissingPoint();
  scan->intensity[i] = 0;
  if (!scan->colors.empty()) scan->colors[i] = {0, 0, 0};
}

void RemoveOpenTriangles(Scan* scan) {
  const auto is_open = [scan](const Triangle& t) {
    return std::any_of(t.begin(), t.end(), [scan](int i) { return scan->IsMissing(i); });
  };
  scan->triangles.erase(std::remove_if(scan->triangles.begin(), scan->triangles.end(), is_open),
                        scan->triangles.end());
}

// Points of a cloud for which keep(point) is false go, with what belongs to them.
template <typename Keep>
void KeepPoints(const Keep& keep, Scan* scan) {
  size_t kept = 0;
  for (size_t i = 0; i < scan->points.size(); ++i) {
    if (!keep(scan->points[i])) continue;
    scan->points[kept] = scan->points[i];
    if (!scan->colors.empty()) scan->colors[kept] = scan->colors[i];
    if (!scan->normals.empty()) scan->normals[kept] = scan->normals[i];
    scan->intensity[kept++] = scan->intensity[i];
  }
  scan->num_left_out += static_cast<int64_t>(scan->points.size() - kept);
  scan->points.resize(kept);
  scan->intensity.resize(kept);
  if (!scan->colors.empty()) scan->colors.resize(kept);
  if (!scan->normals.empty()) scan->normals.resize(kept);
  scan->num_columns = static_cast<int>(kept);
  scan->num_rows = 1;
}

}  // namespace

void FinishMesh(const std::string& path, double max_range, Scan* scan) {
  scan->organised = false;
  scan->path = path;
  scan->num_columns = static_cast<int>(scan->points.size());
  scan->num_rows = 1;
  const Eigen::Vector3d station = scan->Station();
  for (size_t i = 0; i < scan->points.size(); ++i) {
    const double range = (scan->points[i] - station).norm();
    if (std::isfinite(range) && (max_range <= 0 || range <= max_range)) continue;
    MakeMissing(i, scan);
  }
  RemoveOpenTriangles(scan);
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
  KeepPoints(
      [&](const Eigen::Vector3d& point) {
        const double range = (point - station).norm();
        return std::isfinite(range) && (max_range <= 0 || range <= max_range);
      },
      scan);
  for (Eigen::Vector3f& normal : scan->normals) {
    const bool is_one = normal.allFinite() && normal.norm() > 0.5f;
    normal = is_one ? normal.normalized() : Eigen::Vector3f::Zero().eval();
  }
  scan->triangles.clear();
  scan->path = path;
  scan->organised = false;
  if (!scan->points.empty()) return;
  throw InputError(path, "", "holds no measured point",
                   max_range > 0 ? "Give a larger --max_range" : "Give another file");
}

size_t LeaveOutFar(Scan* scan) {
  const auto is_far = [](const Eigen::Vector3d& point) {
    const bool is_missing = !(point.x() == point.x());
    return !is_missing && !(point.array().abs() <= kFarthest).all();
  };
  const auto count =
      static_cast<size_t>(std::count_if(scan->points.begin(), scan->points.end(), is_far));
  if (count == 0) return 0;
  if (scan->kind() == Scan::Kind::kCloud) {
    KeepPoints([&](const Eigen::Vector3d& point) { return !is_far(point); }, scan);
    return count;
  }
  for (size_t i = 0; i < scan->points.size(); ++i) {
    if (is_far(scan->points[i])) MakeMissing(i, scan);
  }
  RemoveOpenTriangles(scan);
  return count;
}

}  // namespace roomtex
