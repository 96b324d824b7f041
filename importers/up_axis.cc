#include "importers/up_axis.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "core/scan_mesh.h"
#include "core/statistics.h"
#include "core/surfels.h"

namespace roomtex {
namespace {

// Share of the variance of the elevation over `up` that the row alone explains, with the elevation
// falling from row to row; 0 when it does not fall.
double ExplainedByRow(const Scan& scan, const Eigen::Vector3d& up, int every) {
  double n = 0, k1 = 0, k2 = 0, e1 = 0, e2 = 0, ke = 0;
  for (int row = 0; row < scan.num_rows; row += every) {
    for (int column = 0; column < scan.num_columns; column += every) {
      const int index = scan.Index(column, row);
      if (scan.IsMissing(index)) continue;
      const Eigen::Vector3d offset = scan.points[index] - scan.Station();
      const double range = offset.norm();
      if (!(range > 0)) continue;
      const double elevation = std::asin(std::clamp(offset.dot(up) / range, -1.0, 1.0));
      n += 1, k1 += row, k2 += static_cast<double>(row) * row;
      e1 += elevation, e2 += elevation * elevation, ke += row * elevation;
    }
  }
  const double covariance = n * ke - k1 * e1;
  const double variances = (n * k2 - k1 * k1) * (n * e2 - e1 * e1);
  if (!(n >= 16) || !(variances > 0) || covariance >= 0) return 0;
  return covariance * covariance / variances;
}

// About kSurfacePoints points, evenly over the surface of a mesh or among those of a cloud.
Scan ThinnedSurface(const Scan& scan) {
  constexpr int kSurfacePoints = 50000;
  Scan thin;
  thin.organised = false;
  thin.scan_from_station = scan.scan_from_station;
  thin.viewpoint = scan.viewpoint;
  if (scan.kind() == Scan::Kind::kCloud) {
    const size_t every = scan.points.size() / kSurfacePoints + 1;
    for (size_t i = 0; i < scan.points.size(); i += every) thin.points.push_back(scan.points[i]);
  } else {
    thin.points = SpreadProbes(scan.points, scan.triangles, kSurfacePoints).points;
  }
  thin.intensity.assign(thin.points.size(), 0.0f);
  thin.num_columns = static_cast<int>(thin.points.size());
  thin.num_rows = 1;
  return thin;
}

// Shares of the surface, and how long the middle 96 % of it are.
struct AxisEvidence {
  double level = 0, upright = 0, length = 0;

  double plumb() const { return level + upright; }
};

AxisEvidence EvidenceFor(const Scan& patches, int axis) {
  constexpr double kTilt = 0.087;  // radians
  AxisEvidence evidence;
  double area = 0;
  std::vector<double> places;
  for (const Triangle& t : patches.triangles) {
    const Eigen::Vector3d& a = patches.points[t[0]];
    const Eigen::Vector3d normal = (patches.points[t[1]] - a).cross(patches.points[t[2]] - a);
    const double size = normal.norm();
    if (!(size > 0)) continue;
    const double along = std::abs(normal[axis]) / size;
    area += size;
    if (along > std::cos(kTilt)) evidence.level += size;
    if (along < std::sin(kTilt)) evidence.upright += size;
    places.push_back(a[axis]);
  }
  if (!(area > 0)) return evidence;
  evidence.level /= area;
  evidence.upright /= area;
  const auto rank = [&places](double share) {
    return AtRank(&places, static_cast<size_t>(share * static_cast<double>(places.size() - 1)));
  };
  evidence.length = rank(0.98) - rank(0.02);
  return evidence;
}

bool SurfaceSaysY(const Scan& scan) {
  constexpr double kMostlyPlumb = 0.5, kClearly = 0.15, kLeastLevel = 0.08;
  constexpr double kLowestRoom = 1.8, kHighestRoom = 6, kLongRoom = 1.6;  // metres, metres, heights
  const Scan patches = FindCloudSurface(ThinnedSurface(scan), 1).patches;
  const AxisEvidence x = EvidenceFor(patches, 0), y = EvidenceFor(patches, 1),
                     z = EvidenceFor(patches, 2);
  if (!(y.plumb() > kMostlyPlumb) || !(y.level > kLeastLevel)) return false;
  if (y.plumb() > z.plumb() + kClearly) return true;
  if (z.plumb() > y.plumb() + kClearly) return false;
  return y.length > kLowestRoom && y.length < kHighestRoom &&
         std::min(x.length, z.length) > kLongRoom * y.length && y.level > 1.5 * z.level &&
         y.level > 1.5 * x.level;
}

}  // namespace

Eigen::Vector3d FindUpAxis(const Scan& scan) {
  if (!scan.organised) {
    return SurfaceSaysY(scan) ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
  }
  if (scan.num_rows < 4) return Eigen::Vector3d::UnitZ();
  const double cells = static_cast<double>(scan.num_columns) * scan.num_rows;
  const int every = std::max(1, static_cast<int>(std::sqrt(cells / 1e5)));
  const double over_y = ExplainedByRow(scan, Eigen::Vector3d::UnitY(), every);
  const double over_z = ExplainedByRow(scan, Eigen::Vector3d::UnitZ(), every);
  return over_y > 0.98 && over_z < 0.9 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
}

const std::vector<std::string>& UpAxisNames() {
  static const std::vector<std::string> kNames = {"x", "y", "z", "-x", "-y", "-z"};
  return kNames;
}

Eigen::Vector3d UpAxisOf(const std::string& name) {
  return (name.front() == '-' ? -1.0 : 1.0) * Eigen::Vector3d::Unit(name.back() - 'x');
}

std::string NameOfUpAxis(const Eigen::Vector3d& up) {
  for (const std::string& name : UpAxisNames()) {
    if ((UpAxisOf(name) - up).norm() < 1e-9) return name;
  }
  return "";
}

}  // namespace roomtex
