#include "align/trust/free_space.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/scan_mesh.h"

namespace roomtex {
namespace {

// Metres, and a share of a ray's length: scans that differ by less show one surface.
constexpr double kSameSurface = 0.02, kSameSurfaceShare = 0.005;

}  // namespace

FreeSpace::FreeSpace(const std::vector<Scan>& scans, int max_samples) {
  for (const Scan& scan : scans) {
    const double share = static_cast<double>(scan.points.size()) * scans.size() / max_samples;
    const int stride =
        scan.organised ? std::max(1, static_cast<int>(std::ceil(std::sqrt(share)))) : 1;
    const Scan thin = Thinned(scan, stride);
    const std::vector<Triangle> triangles = BuildScanMesh(thin, ScanMeshOptions());
    const std::vector<uint8_t> grey = IntensityAsGrey(thin);
    const int offset = static_cast<int>(points_.size());
    thinnings_.push_back({scan.organised, offset, static_cast<int>(triangles_.size()), stride,
                          thin.num_columns, scan.num_columns});
    points_.insert(points_.end(), thin.points.begin(), thin.points.end());
    grey_.insert(grey_.end(), grey.begin(), grey.end());
    for (const Triangle& t : triangles) {
      triangles_.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    }
    if (!scan.organised) continue;
    stations_.push_back(scan.Station());
    scan_of_station_.push_back(static_cast<int>(thinnings_.size()) - 1);
    if (scans.size() > 1) {
      station_casters_.push_back(std::make_unique<RayCaster>(thin.points, triangles));
    }
  }
  caster_ = std::make_unique<RayCaster>(points_, triangles_);
}

FreeSpace::Place FreeSpace::Locate(const Eigen::Vector3d& x_in_scan, double tolerance) const {
  Place place = Place::kUnknown;
  for (size_t s = 0; s < stations_.size(); ++s) {
    const Eigen::Vector3d offset = x_in_scan - stations_[s];
    const double range = offset.norm();
    if (!(range > 0) || !std::isfinite(range)) continue;
    const RayCaster& caster = station_casters_.empty() ? *caster_ : *station_casters_[s];
    const auto hit = caster.Cast(stations_[s], offset / range);
    if (!hit) continue;
    if (std::abs(hit->distance - range) <= tolerance) return Place::kSurface;
    if (hit->distance > range) place = Place::kFloating;
    if (place == Place::kUnknown) place = Place::kHidden;
  }
  return place;
}

RayHit FreeSpace::AsNearestStationHasIt(const Eigen::Vector3d& origin,
                                        const Eigen::Vector3d& direction, const RayHit& hit) const {
  std::vector<std::pair<double, size_t>> nearest;
  for (size_t s = 0; s < station_casters_.size(); ++s) {
    nearest.emplace_back((hit.point - stations_[s]).norm(), s);
  }
  std::sort(nearest.begin(), nearest.end());
  const double tolerance = kSameSurface + kSameSurfaceShare * hit.distance;
  for (const auto& [distance, s] : nearest) {
    auto own = station_casters_[s]->Cast(origin, direction);
    if (!own || std::abs(own->distance - hit.distance) > tolerance) continue;
    own->triangle += thinnings_[scan_of_station_[s]].first_triangle;
    return *own;
  }
  return hit;
}

std::optional<FreeSpace::Sight> FreeSpace::Look(const Eigen::Vector3d& origin,
                                                const Eigen::Vector3d& direction) const {
  auto hit = caster_->Cast(origin, direction);
  if (!hit) return std::nullopt;
  if (!station_casters_.empty()) hit = AsNearestStationHasIt(origin, direction, *hit);
  const Triangle& t = triangles_[hit->triangle];
  const Eigen::Vector3d& a = points_[t[0]];
  const Eigen::Vector3d ab = points_[t[1]] - a, ac = points_[t[2]] - a, ap = hit->point - a;
  const Eigen::Vector3d normal = ab.cross(ac);
  const double area2 = normal.squaredNorm();
  if (!(area2 > 0)) return std::nullopt;
  const double v = std::clamp(ap.cross(ac).dot(normal) / area2, 0.0, 1.0);
  const double w = std::clamp(ab.cross(ap).dot(normal) / area2, 0.0, 1.0 - v);
  Sight sight;
  sight.x_in_scan = hit->point;
  sight.grey = static_cast<float>((1 - v - w) * grey_[t[0]] + v * grey_[t[1]] + w * grey_[t[2]]);
  LocateInGrid(t, {1 - v - w, v, w}, &sight);
  return sight;
}

void FreeSpace::LocateInGrid(const Triangle& triangle, const Eigen::Vector3d& weights,
                             Sight* sight) const {
  sight->scan = static_cast<int>(thinnings_.size()) - 1;
  while (triangle[0] < thinnings_[sight->scan].first_point) --sight->scan;
  const Thinning& thinning = thinnings_[sight->scan];
  sight->column = sight->row = 0;
  if (!thinning.organised) {
    sight->column = sight->row = std::numeric_limits<double>::quiet_NaN();
    return;
  }
  int first_column = 0;
  for (int k = 0; k < 3; ++k) {
    const int index = triangle[k] - thinning.first_point;
    int column = thinning.stride * (index % thinning.thin_columns);
    if (k == 0) first_column = column;
    // A triangle over the seam of a full turn.
    if (2 * (column - first_column) > thinning.num_columns) column -= thinning.num_columns;
    if (2 * (first_column - column) > thinning.num_columns) column += thinning.num_columns;
    sight->column += weights[k] * column;
    sight->row += weights[k] * thinning.stride * (index / thinning.thin_columns);
  }
  if (sight->column < 0) sight->column += thinning.num_columns;
}

}  // namespace roomtex
