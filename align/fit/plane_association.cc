#include "align/fit/plane_association.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/statistics.h"

namespace roomtex {
namespace {

// Cosine; the surface must face the mean direction to the cameras by at least this. Flatter than 80
// degrees nobody finds a feature again.
constexpr double kMinFacing = 0.15;
// Planes whose normals differ by less (cosine) lie behind each other rather than meet in an edge.
constexpr double kParallel = 0.9;
// A patch farther from the plane than this many standard deviations is another surface.
constexpr double kLeavesPlane = 2.5;
// A patch thicker than this many times the typical one is not flat.
constexpr double kMaxThickness = 3.0;
// Metres; what may be unknown, along the surface's normal, of a point that two photos alone show.
// No third says that their match is right, and where their rays hardly cross (a camera that turns
// on the spot, the desk) it may lie on any surface near by.
constexpr double kMaxSigmaOfTwo = 0.01;

// How far the surface itself leaves the plane, metres (root mean square): the distances of the
// patches on it, in which the noise of the samples is averaged out.
double Unevenness(const ScanPlane& plane, const ScanPatches& patches) {
  double sum = 0;
  int count = 0;
  for (const ScanPatch& patch : patches.patches()) {
    const double distance = plane.Distance(patch.point);
    if (!(std::abs(distance) < 3 * plane.rms)) continue;
    if (patch.normal.dot(plane.normal) < kParallel || !plane.Covers(patch.point)) continue;
    sum += distance * distance - patch.thickness * patch.thickness / patch.num_samples;
    ++count;
  }
  return count > 0 ? std::sqrt(std::max(0.0, sum / count)) : plane.rms;
}

struct Candidate {
  SurfaceConstraint constraint;
  double distance = 0;    // metres, absolute
  double deviations = 0;  // distance / standard deviation of point and surface together
};

class Association {
 public:
  Association(const std::vector<ScanPlane>& planes, const ScanPatches& patches,
              const PlaneAssociationOptions& options)
      : planes_(planes),
        patches_(patches),
        options_(options),
        typical_thickness_(patches.TypicalThickness()) {
    for (const ScanPlane& plane : planes) {
      plane_sigmas_.push_back(std::hypot(options.surface_noise, Unevenness(plane, patches)));
    }
  }

  // Planes within options.max_distance and `gate` standard deviations.
  std::vector<Candidate> Planes(const SurfacePoint& point, double gate) const {
    std::vector<Candidate> found;
    for (size_t i = 0; i < planes_.size(); ++i) {
      const ScanPlane& plane = planes_[i];
      const double distance = std::abs(plane.Distance(point.x_in_sparse));
      if (!(distance <= options_.max_distance)) continue;
      SurfaceConstraint constraint{0, plane.point, plane.normal, plane_sigmas_[i],
                                   static_cast<int>(i)};
      const auto candidate = Judge(point, constraint, gate);
      if (candidate && plane.Covers(point.x_in_sparse)) found.push_back(*candidate);
    }
    return found;
  }

  std::optional<Candidate> Patch(const SurfacePoint& point, double gate) const {
    const double reach = std::hypot(options_.max_distance, patches_.cell_size());
    const auto nearest = patches_.FindNearest(point.x_in_sparse, reach);
    if (!nearest) return std::nullopt;
    const ScanPatch& patch = patches_.patches()[nearest->patch];
    if (patch.thickness > kMaxThickness * typical_thickness_) return std::nullopt;
    const Eigen::Vector3d offset = point.x_in_sparse - patch.point;
    const double beside = (offset - nearest->distance * patch.normal).norm();
    if (beside > patches_.cell_size()) return std::nullopt;
    return Judge(point, {0, patch.point, patch.normal, PatchSigma(patch, beside), -1, true}, gate);
  }

  // The patch is off the plane by more than its noise.
  bool Leaves(const SurfaceConstraint& patch, int plane) const {
    const double noise = std::sqrt(
        std::max(0.0, patch.sigma * patch.sigma - options_.surface_noise * options_.surface_noise));
    return std::abs(planes_[plane].Distance(patch.point)) > kLeavesPlane * noise;
  }

 private:
  // Of the patch's distance `beside` metres from its middle: its samples' noise turns its normal,
  // too, the more the smaller it is.
  double PatchSigma(const ScanPatch& patch, double beside) const {
    const double curved2 =
        patch.thickness * patch.thickness - typical_thickness_ * typical_thickness_;
    const double extent2 = patches_.cell_size() * patches_.cell_size() / 12;
    const double noise2 =
        patch.thickness * patch.thickness / patch.num_samples * (1 + beside * beside / extent2);
    return std::sqrt(options_.surface_noise * options_.surface_noise + noise2 +
                     std::max(0.0, curved2));
  }

  std::optional<Candidate> Judge(const SurfacePoint& point, SurfaceConstraint constraint,
                                 double gate) const {
    const Eigen::Vector3d& n = constraint.normal;
    if (!(n.dot(point.to_cameras) > kMinFacing * point.to_cameras.norm())) return std::nullopt;
    const double own_variance = n.dot(point.covariance * n);
    if (point.num_observations < 3 && !(own_variance <= kMaxSigmaOfTwo * kMaxSigmaOfTwo)) {
      return std::nullopt;
    }
    const double variance = own_variance + constraint.sigma * constraint.sigma;
    const double distance = std::abs(constraint.Distance(point.x_in_sparse));
    constraint.point3d_id = point.point3d_id;
    const Candidate candidate{constraint, distance, distance / std::sqrt(variance)};
    if (!(distance <= options_.max_distance) || !(candidate.deviations <= gate)) {
      return std::nullopt;
    }
    return candidate;
  }

  const std::vector<ScanPlane>& planes_;
  const ScanPatches& patches_;
  const PlaneAssociationOptions& options_;
  const double typical_thickness_;
  std::vector<double> plane_sigmas_;
};

const Candidate& Best(const std::vector<Candidate>& candidates) {
  return *std::min_element(
      candidates.begin(), candidates.end(),
      [](const Candidate& a, const Candidate& b) { return a.deviations < b.deviations; });
}

bool MeetInAnEdge(const std::vector<Candidate>& candidates) {
  const Eigen::Vector3d& normal = Best(candidates).constraint.normal;
  return std::any_of(candidates.begin(), candidates.end(), [&](const Candidate& other) {
    return other.constraint.normal.dot(normal) < kParallel;
  });
}

}  // namespace

std::vector<SurfaceConstraint> AssociateWithSurface(const std::vector<SurfacePoint>& points,
                                                    const std::vector<ScanPlane>& planes,
                                                    const ScanPatches& patches,
                                                    const PlaneAssociationOptions& options) {
  const Association association(planes, patches, options);
  constexpr double kAnyDeviation = std::numeric_limits<double>::infinity();
  std::vector<double> deviations;
  for (const SurfacePoint& point : points) {
    const auto on_planes = association.Planes(point, kAnyDeviation);
    if (!on_planes.empty()) {
      deviations.push_back(Best(on_planes).deviations);
    } else if (options.surface) {
      const auto on_patch = association.Patch(point, kAnyDeviation);
      if (on_patch) deviations.push_back(on_patch->deviations);
    }
  }
  const double gate = options.gate * std::max(1.0, kSigmaPerMad * Median(deviations));

  std::vector<SurfaceConstraint> constraints;
  for (const SurfacePoint& point : points) {
    const auto on_planes = association.Planes(point, gate);
    if (!on_planes.empty() && MeetInAnEdge(on_planes)) continue;
    std::optional<SurfaceConstraint> best;
    if (!on_planes.empty()) best = Best(on_planes).constraint;
    if (options.surface) {
      const auto on_patch = association.Patch(point, gate);
      if (on_patch && (!best || association.Leaves(on_patch->constraint, best->plane))) {
        const int plane = best ? best->plane : -1;
        best = on_patch->constraint;
        best->plane = plane;
      }
    }
    if (best) constraints.push_back(*best);
  }
  return constraints;
}

}  // namespace roomtex
