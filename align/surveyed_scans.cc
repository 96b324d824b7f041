#include "align/surveyed_scans.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace roomtex {
namespace {

constexpr double kSpacing = 0.02;  // metres; between the points of a mesh without a grid

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
  std::vector<double> distance2(points.size(), std::numeric_limits<double>::infinity());
  for (const Scan& scan : scans_) {
    VisitSurface(scan, kSpacing, [&](const Eigen::Vector3d& x_in_scan) {
      for (size_t i = 0; i < points.size(); ++i) {
        distance2[i] = std::min(distance2[i], (points[i] - x_in_scan).squaredNorm());
      }
    });
  }
  for (double& value : distance2) value = std::sqrt(value);
  return distance2;
}

}  // namespace roomtex
