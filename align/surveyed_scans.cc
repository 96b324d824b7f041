#include "align/surveyed_scans.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace roomtex {
namespace {

constexpr double kSpacing = 0.02;  // metres; between the points of a mesh without a grid

// Metres from a place between the samples of a grid to the nearest of them, at most, around this
// one. Of the neighbours to either side the nearer one counts: the other may lie beyond an edge.
double HalfDiagonal(const Scan& scan, int sample) {
  const int row = sample / scan.num_columns, column = sample % scan.num_columns;
  const auto spacing = [&](int dx, int dy) {
    double nearer = std::numeric_limits<double>::infinity();
    for (const int sign : {-1, 1}) {
      const int x = column + sign * dx, y = row + sign * dy;
      if (x < 0 || y < 0 || x >= scan.num_columns || y >= scan.num_rows) continue;
      const int other = scan.Index(x, y);
      if (scan.IsMissing(other)) continue;
      nearer = std::min(nearer, (scan.points[other] - scan.points[sample]).norm());
    }
    return std::isfinite(nearer) ? nearer : 0.0;
  };
  return 0.5 * std::hypot(spacing(1, 0), spacing(0, 1));
}

}  // namespace

SurveyedScans::SurveyedScans(const std::vector<Scan>& scans, const SurveyOptions& options)
    : scans_(scans), options_(options) {}

const ScanPatches& SurveyedScans::patches() const {
  return patches_.Get([&] { return ScanPatches(scans_, options_.patches); });
}

const std::vector<ScanPlane>& SurveyedScans::planes() const {
  return planes_.Get([&] { return FindScanPlanes(scans_, options_.planes, options_.num_threads); });
}

const std::vector<std::vector<Triangle>>& SurveyedScans::meshes() const {
  return meshes_.Get([&] {
    std::vector<std::vector<Triangle>> meshes;
    for (const Scan& scan : scans_) meshes.push_back(BuildScanMesh(scan, options_.mesh));
    return meshes;
  });
}

const FreeSpace& SurveyedScans::free_space() const {
  return free_space_.Get([&] { return FreeSpace(scans_, options_.coarse_samples); });
}

const ScanViewer& SurveyedScans::viewer() const {
  return viewer_.Get([&] { return ScanViewer(scans_, free_space()); });
}

std::vector<double> SurveyedScans::DistancesOf(const std::vector<Eigen::Vector3d>& points) const {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  std::vector<double> distances(points.size(), kNone);
  for (const Scan& scan : scans_) {
    std::vector<double> distance2(points.size(), kNone);
    std::vector<int> nearest(points.size(), -1);
    int sample = 0;  // of a grid
    const auto compare = [&](const Eigen::Vector3d& x_in_scan) {
      for (size_t i = 0; i < points.size(); ++i) {
        const double value = (points[i] - x_in_scan).squaredNorm();
        if (!(value < distance2[i])) continue;
        distance2[i] = value;
        nearest[i] = sample;
      }
    };
    if (scan.organised) {
      for (; sample < static_cast<int>(scan.points.size()); ++sample) {
        if (!scan.IsMissing(sample)) compare(scan.points[sample]);
      }
    } else {
      VisitSurface(scan, kSpacing, compare);
    }
    for (size_t i = 0; i < points.size(); ++i) {
      if (nearest[i] < 0) continue;
      const double between = scan.organised ? HalfDiagonal(scan, nearest[i]) : 0;
      distances[i] = std::min(distances[i], std::max(0.0, std::sqrt(distance2[i]) - between));
    }
  }
  return distances;
}

}  // namespace roomtex
