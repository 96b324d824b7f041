#include "align/pick/scan_rays.h"

#include <algorithm>

#include "core/scan_mesh.h"

namespace roomtex {
namespace {

// What lies nearer to a point than this share of its distance, or than this many metres, is its own
// surface: range noise, and triangles that cut corners.
constexpr double kOwnShare = 0.008, kOwnDistance = 0.008;

}  // namespace

ScanRays::ScanRays(const std::vector<Scan>& scans) {
  std::vector<Eigen::Vector3d> points;
  std::vector<Triangle> triangles;
  for (const Scan& scan : scans) {
    first_triangle_.push_back(static_cast<int>(triangles.size()));
    std::vector<Triangle> mesh = BuildScanMesh(scan, ScanMeshOptions());
    if (scans.size() == 1) {
      caster_.emplace(scan.points, mesh);
      return;
    }
    const int offset = static_cast<int>(points.size());
    points.insert(points.end(), scan.points.begin(), scan.points.end());
    for (const Triangle& t : mesh) {
      triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    }
  }
  caster_.emplace(points, triangles);
}

int ScanRays::ScanOf(int triangle) const {
  const auto next = std::upper_bound(first_triangle_.begin(), first_triangle_.end(), triangle);
  return static_cast<int>(next - first_triangle_.begin()) - 1;
}

bool ScanRays::IsHidden(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const {
  const double distance = (to - from).norm();
  return caster_->IsOccluded(from, to, std::max(kOwnDistance, kOwnShare * distance));
}

}  // namespace roomtex
