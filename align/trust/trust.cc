#include "align/trust/trust.h"

#include <algorithm>
#include <cmath>

#include "core/option_fields.h"

namespace roomtex {

double TrustOptions::PickRmsLimit(const Camera& camera) const {
  if (max_pick_rms_px > 0) return max_pick_rms_px;
  return std::max(10.0, 0.004 * std::hypot(camera.width, camera.height));
}

void TrustOptions::Declare(OptionFields* fields) {
  fields
      ->Number("Trust.max_pick_rms_px", &max_pick_rms_px,
               "Pixels; picks that miss by more (rms) are not trusted; 0 = 10, or 0.4 % of the "
               "photo's diagonal if that is more; larger = more tolerant.")
      .NotNegative();
  fields
      ->Number("Trust.max_scale_mad", &max_scale_mad,
               "Spread of the scale over the features (relative); larger = more tolerant.")
      .Positive();
  fields
      ->Int("Trust.min_scale_features", &min_scale_features,
            "Features that the scale must rest on; larger = stricter.")
      .Positive();
  fields
      ->Number("Trust.surface_tolerance", &surface_tolerance,
               "Metres; sparse points this near to the surface are on it; larger = more tolerant.")
      .Positive();
  fields
      ->Number("Trust.min_surface_share", &min_surface_share,
               "Share of the sparse points visible to the scanner that must be on the surface; "
               "larger = stricter.")
      .AtLeast(0)
      .AtMost(1);
  fields
      ->Number(
          "Trust.max_changed_share", &max_changed_share,
          "Share of the sparse points that may float in space the scanner saw to be empty while as "
          "many lie behind its surface: another room, or things moved; larger = more tolerant.")
      .AtLeast(0)
      .AtMost(1);
  fields
      ->Number(
          "Trust.min_shown_share", &min_shown_share,
          "Share of the corners of the scan's intensity that the photos must show there, beyond "
          "chance; photos of another room with the same walls and furniture show less; larger = "
          "stricter.")
      .AtLeast(0)
      .AtMost(1);
  fields
      ->Number("Trust.min_camera_share", &min_camera_share,
               "Share of the photos that must not lie behind the surface; larger = stricter.")
      .AtLeast(0)
      .AtMost(1);
  fields
      ->Number("Trust.max_position_sigma", &max_position_sigma,
               "Metres; how uncertain the picks may leave the camera's position; larger = more "
               "tolerant.")
      .Positive();
}

std::vector<std::string> TrustOptions::Problems() const { return ProblemsOf(*this); }

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

namespace {

// Around a corner of the room the scanner sees nothing either, and photos are taken there. A camera
// that stands right has the surface that it shows before it, the front turned to it; one behind a
// wall has the wall between, or looks at its back.
bool SeesItsPoints(const SparseModel& model, const SparseImage& image,
                   const Similarity& scan_from_sparse, const ScanPatches& surface,
                   const FreeSpace& free_space, double tolerance) {
  constexpr size_t kMostPoints = 60;
  constexpr int kFewestPoints = 10;
  const Eigen::Vector3d centre = scan_from_sparse * image.cam_from_model.TargetOriginInSource();
  std::vector<Eigen::Vector3d> points;
  for (const uint64_t id : image.point3d_ids) {
    const auto point = model.points.find(id);
    if (point != model.points.end()) points.push_back(scan_from_sparse * point->second.x_in_model);
  }
  const size_t every = points.size() / kMostPoints + 1;
  int num_on_surface = 0, num_seen = 0;
  for (size_t i = 0; i < points.size(); i += every) {
    const auto nearest = surface.FindNearest(points[i], std::hypot(tolerance, surface.cell_size()));
    if (!nearest || !(std::abs(nearest->distance) < tolerance)) continue;
    ++num_on_surface;
    const Eigen::Vector3d to_camera = centre - points[i];
    if (!(surface.patches()[nearest->patch].normal.dot(to_camera) > 0)) continue;
    const double distance = to_camera.norm();
    const auto sight = free_space.Look(centre, -to_camera / distance);
    num_seen += !sight || (sight->x_in_scan - centre).norm() > distance - 2 * tolerance;
  }
  return num_on_surface >= kFewestPoints && 2 * num_seen > num_on_surface;
}

}  // namespace

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
    placement.num_cameras_free +=
        place != FreeSpace::Place::kHidden ||
        SeesItsPoints(model, image, scan_from_sparse, surface, free_space, tolerance);
  }
  return placement;
}

}  // namespace roomtex
