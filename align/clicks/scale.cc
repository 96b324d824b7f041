#include "align/clicks/scale.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/frames.h"
#include "core/option_fields.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// The part of the scans that the photo can see, for the ray caster: a scan of millions of samples
// needs hundreds of megabytes there, the share of it before one photo does not.
struct VisiblePart {
  std::vector<Eigen::Vector3d> points;
  std::vector<Triangle> triangles;
};

// A sample counts as inside the photo with this share of the photo's size around it.
constexpr double kMargin = 0.1;

bool IsInView(const CameraProjection& projection, double max_radius2, const Eigen::Vector3d& p) {
  if (!(projection.Depth(p) > 1e-6)) return false;  // NaN (missing) as well
  if (projection.camera().IsPanorama()) return true;
  if (projection.camera().IsPerspective()) {
    const double x = p.x() / p.z(), y = p.y() / p.z();
    if (x * x + y * y > max_radius2) return false;
  }
  const auto x_in_img = projection.ImgFromCam(p);
  if (!x_in_img) return false;
  const double dx = kMargin * projection.camera().width;
  const double dy = kMargin * projection.camera().height;
  return x_in_img->x() > -dx && x_in_img->y() > -dy &&
         x_in_img->x() < projection.camera().width + dx &&
         x_in_img->y() < projection.camera().height + dy;
}

// Largest squared radius of the normalised coordinates that the photo's border reaches, with the
// margin.
double MaxRadius2(const CameraProjection& projection) {
  const Camera& camera = projection.camera();
  double radius2 = 0;
  for (int side = 0; side < 4; ++side) {
    for (int k = 0; k <= 16; ++k) {
      const double u = k / 16.0;
      const Eigen::Vector2d at(side < 2 ? u : side - 2, side < 2 ? side : u);
      const auto x = projection.CamFromImg({at.x() * camera.width, at.y() * camera.height});
      if (!x) return std::numeric_limits<double>::infinity();
      radius2 = std::max(radius2, x->squaredNorm());
    }
  }
  return radius2 * (1 + 4 * kMargin) * (1 + 4 * kMargin);
}

// The cone about the camera's axis that the photo lies in, against a sphere around the triangle:
// false only where no part of it can be in view. Corners: camera frame.
bool MayBeInView(double half_angle, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                 const Eigen::Vector3d& c) {
  const Eigen::Vector3d middle = (a + b + c) / 3;
  const double radius = std::max({(a - middle).norm(), (b - middle).norm(), (c - middle).norm()});
  const double distance = middle.norm();
  if (!(distance > radius)) return distance == distance;  // NaN = a corner is missing
  const double from_axis = std::acos(std::clamp(middle.z() / distance, -1.0, 1.0));
  return from_axis - std::asin(radius / distance) < half_angle;
}

VisiblePart FindVisiblePart(const CameraProjection& projection, const Rigid& cam_from_scan,
                            const std::vector<Scan>& scans,
                            const std::vector<std::vector<Triangle>>& meshes) {
  VisiblePart part;
  const double max_radius2 = MaxRadius2(projection);
  const double half_angle =
      projection.camera().IsPerspective() ? std::atan(std::sqrt(max_radius2)) : kPi;
  const Eigen::Matrix3d r = cam_from_scan.rotation.toRotationMatrix();
  for (size_t s = 0; s < scans.size(); ++s) {
    const std::vector<Eigen::Vector3d>& points = scans[s].points;
    std::vector<int> renumbered(points.size(), -1);
    for (size_t i = 0; i < points.size(); ++i) {
      if (!IsInView(projection, max_radius2, r * points[i] + cam_from_scan.translation)) continue;
      renumbered[i] = static_cast<int>(part.points.size());
      part.points.push_back(points[i]);
    }
    const auto in_cam = [&](int i) -> Eigen::Vector3d {
      return r * points[i] + cam_from_scan.translation;
    };
    for (const Triangle& t : meshes[s]) {
      const bool all = renumbered[t[0]] >= 0 && renumbered[t[1]] >= 0 && renumbered[t[2]] >= 0;
      // A wall of a mesh can be two triangles, whose corners no photo shows.
      if (!all && (scans[s].organised ||
                   !MayBeInView(half_angle, in_cam(t[0]), in_cam(t[1]), in_cam(t[2])))) {
        continue;
      }
      for (const int corner : t) {
        if (renumbered[corner] >= 0) continue;
        renumbered[corner] = static_cast<int>(part.points.size());
        part.points.push_back(points[corner]);
      }
      part.triangles.push_back({renumbered[t[0]], renumbered[t[1]], renumbered[t[2]]});
    }
  }
  return part;
}

class DepthFinder {
 public:
  DepthFinder(const CameraProjection& projection, const Rigid& cam_from_scan,
              const RayCaster& surface)
      : projection_(projection), cam_from_scan_(cam_from_scan), surface_(surface) {}

  // Depth (CameraProjection::Depth) of the nearest scan surface behind a pixel.
  std::optional<double> At(const Eigen::Vector2d& x_in_img) const {
    const auto ray = projection_.RayFromImg(x_in_img);
    if (!ray) return std::nullopt;
    const Eigen::Vector3d direction = (cam_from_scan_.rotation.conjugate() * *ray).normalized();
    const auto hit = surface_.Cast(cam_from_scan_.TargetOriginInSource(), direction);
    if (!hit) return std::nullopt;
    return projection_.Depth(cam_from_scan_ * hit->point);
  }

  // The surface around the pixel has no edge: on a plane the inverse depth is linear over the
  // photo.
  bool IsSmooth(const Eigen::Vector2d& x_in_img, double depth, const ScaleOptions& options) const {
    for (const Eigen::Vector2d& side : {Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1),
                                        Eigen::Vector2d(0.7, 0.7), Eigen::Vector2d(0.7, -0.7)}) {
      const auto before = At(x_in_img - options.edge_px * side);
      const auto after = At(x_in_img + options.edge_px * side);
      if (!before || !after) return false;
      const double expected = 2 / (1 / *before + 1 / *after);
      if (!(std::abs(depth / expected - 1) < options.max_depth_step)) return false;
      if (!(std::abs(*before / *after - 1) < 10 * options.max_depth_step)) return false;
    }
    return true;
  }

 private:
  const CameraProjection& projection_;
  Rigid cam_from_scan_;
  const RayCaster& surface_;
};

// A feature with a sparse point: what its depth in the scan says.
struct Feature {
  Eigen::Vector2d x_in_img = Eigen::Vector2d::Zero();
  double sparse_depth = 0;
  bool has_surface = false;
  double ratio = 0;  // 0: no smooth surface
};

constexpr int kFeaturesPerChunk = 64;

}  // namespace

void ScaleOptions::Declare(OptionFields* fields) {
  fields
      ->Number("Scale.edge_px", &edge_px,
               "Pixels; features nearer to a depth edge do not count for the scale (at least twice "
               "the error of the picks is kept); larger = stricter.")
      .NotNegative();
  fields
      ->Number("Scale.max_depth_step", &max_depth_step,
               "A surface is smooth where its depth differs from the mean of those on both sides "
               "by less than this share; larger = more tolerant.")
      .Positive();
  fields
      ->Number("Scale.max_deviations", &max_deviations,
               "Features whose scale is off the median by more than this many robust standard "
               "deviations are left out; larger = more tolerant.")
      .Positive();
  fields
      ->Int("Scale.max_features", &max_features,
            "Of more features than this every k-th is looked at; larger = slower.")
      .Positive();
}

std::vector<std::string> ScaleOptions::Problems() const { return ProblemsOf(*this); }

ScaleEstimate EstimateScale(const SparseModel& model, const SparseImage& image,
                            const Rigid& cam_from_scan, const std::vector<Scan>& scans,
                            const std::vector<std::vector<Triangle>>& meshes,
                            const ScaleOptions& options) {
  const CameraProjection projection(model.cameras.at(image.camera_id));
  const VisiblePart part = FindVisiblePart(projection, cam_from_scan, scans, meshes);
  const RayCaster surface(part.points, part.triangles);
  return EstimateScale(model, image, cam_from_scan, surface, options, 1);
}

ScaleEstimate EstimateScale(const SparseModel& model, const SparseImage& image,
                            const Rigid& cam_from_scan, const RayCaster& surface,
                            const ScaleOptions& options, int num_threads) {
  const CameraProjection projection(model.cameras.at(image.camera_id));
  const DepthFinder depths(projection, cam_from_scan, surface);
  std::vector<Feature> features;
  for (size_t i = 0; i < image.points2d.size(); ++i) {
    if (image.point3d_ids[i] == kInvalidPoint3dId) continue;
    const auto point = model.points.find(image.point3d_ids[i]);
    if (point == model.points.end()) continue;
    const double alpha = projection.Depth(image.cam_from_model * point->second.x_in_model);
    if (alpha > 0) features.push_back({image.points2d[i], alpha, false, 0});
  }
  if (features.size() > static_cast<size_t>(options.max_features)) {
    const size_t stride = (features.size() - 1) / options.max_features + 1;
    size_t kept = 0;
    for (size_t i = 0; i < features.size(); i += stride) features[kept++] = features[i];
    features.resize(kept);
  }
  const int count = static_cast<int>(features.size());
  ParallelFor(num_threads, 0, (count + kFeaturesPerChunk - 1) / kFeaturesPerChunk, [&](int chunk) {
    const int end = std::min(count, (chunk + 1) * kFeaturesPerChunk);
    for (int i = chunk * kFeaturesPerChunk; i < end; ++i) {
      const auto beta = depths.At(features[i].x_in_img);
      features[i].has_surface = beta.has_value();
      if (!beta || !depths.IsSmooth(features[i].x_in_img, *beta, options)) continue;
      features[i].ratio = *beta / features[i].sparse_depth;  // Thesis (7.3), inverted
    }
  });
  ScaleEstimate estimate;
  std::vector<double> ratios;
  for (const Feature& feature : features) {
    estimate.num_candidates += feature.has_surface;
    if (feature.ratio > 0) ratios.push_back(feature.ratio);
  }
  if (ratios.empty()) return estimate;
  const double median = Median(ratios);
  const double mad = MedianAbsoluteDeviation(ratios, median);
  estimate.relative_mad = mad / median;
  const double limit = options.max_deviations * kSigmaPerMad * mad;
  double sum = 0;
  for (const double ratio : ratios) {
    if (!(std::abs(ratio - median) <= limit)) continue;
    sum += ratio;
    ++estimate.num_features;
  }
  estimate.scale = sum / estimate.num_features;
  return estimate;
}

}  // namespace roomtex
