#include "align/trust/trust.h"

#include <algorithm>
#include <cmath>

namespace roomtex {

double TrustOptions::PickRmsLimit(const Camera& camera) const {
  if (max_pick_rms_px > 0) return max_pick_rms_px;
  return std::max(10.0, 0.004 * std::hypot(camera.width, camera.height));
}

std::vector<std::string> TrustOptions::Problems() const {
  std::vector<std::string> problems;
  const auto require = [&problems](bool holds, const std::string& sentence) {
    if (!holds) problems.push_back(sentence);
  };
  require(max_pick_rms_px >= 0, "--Trust.max_pick_rms_px must not be negative");
  require(max_scale_mad > 0, "--Trust.max_scale_mad must be positive");
  require(min_scale_features >= 1, "--Trust.min_scale_features must be positive");
  require(surface_tolerance > 0, "--Trust.surface_tolerance must be positive");
  require(min_surface_share >= 0 && min_surface_share <= 1,
          "--Trust.min_surface_share must lie between 0 and 1");
  require(max_changed_share >= 0 && max_changed_share <= 1,
          "--Trust.max_changed_share must lie between 0 and 1");
  require(min_camera_share >= 0 && min_camera_share <= 1,
          "--Trust.min_camera_share must lie between 0 and 1");
  require(max_position_sigma > 0, "--Trust.max_position_sigma must be positive");
  return problems;
}

double Placement::SurfaceShare() const {
  const int known = num_on_surface + num_floating;
  return known > 0 ? static_cast<double>(num_on_surface) / known : 0;
}

double Placement::CameraShare() const {
  return num_cameras > 0 ? static_cast<double>(num_cameras_free) / num_cameras : 0;
}

double Placement::ChangedShare() const {
  const int known = num_on_surface + num_floating + num_hidden;
  return known > 0 ? static_cast<double>(std::min(num_floating, num_hidden)) / known : 0;
}

Placement CheckPlacement(const SparseModel& model, const std::vector<SurfacePoint>& points,
                         const Similarity& scan_from_sparse, const ScanPatches& surface,
                         const FreeSpace& free_space, const TrustOptions& options) {
  Placement placement;
  const double tolerance = options.surface_tolerance;
  for (const SurfacePoint& point : points) {
    ++placement.num_points;
    const Eigen::Vector3d x_in_scan = scan_from_sparse * point.x_in_sparse;
    const auto nearest = surface.FindNearest(x_in_scan, std::hypot(tolerance, surface.cell_size()));
    if (nearest && std::abs(nearest->distance) < tolerance) {
      ++placement.num_on_surface;
      continue;
    }
    // A point has to stand clear of the surface by its own uncertainty, too, to be called floating.
    const double sigma = scan_from_sparse.scale * std::sqrt(point.covariance.trace());
    // Without a scanner nobody knows what is empty: then every point off the surface counts against
    // it.
    const FreeSpace::Place place =
        free_space.HasStations() ? free_space.Locate(x_in_scan, std::max(2 * tolerance, 3 * sigma))
                                 : FreeSpace::Place::kFloating;
    placement.num_floating += place == FreeSpace::Place::kFloating;
    placement.num_hidden += place == FreeSpace::Place::kHidden;
  }
  for (const auto& [id, image] : model.images) {
    ++placement.num_cameras;
    const Eigen::Vector3d centre = scan_from_sparse * image.cam_from_model.TargetOriginInSource();
    const FreeSpace::Place place = free_space.Locate(centre, tolerance);
    placement.num_cameras_free += place != FreeSpace::Place::kHidden;
  }
  return placement;
}

}  // namespace roomtex
