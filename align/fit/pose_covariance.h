#pragma once
// How exact each photo's pose is after the adjustment to the scan's surface: the covariance of all
// poses together, by the normal equations with the points eliminated (Schur complement; Triggs et
// al. 2000).

#include <cstdint>
#include <map>

#include <Eigen/Core>

#include "align/fit/plane_bundle.h"

namespace roomtex {

// Of (w, centre) with x_in_cam = exp(w) R (x_in_scan - centre): rad^2, rad m, m^2; `scan`.
using PoseCovariances = std::map<uint32_t, Eigen::Matrix<double, 6, 6>>;

// More photos than this would need a dense matrix of more than 2400 x 2400.
inline constexpr size_t kMaxPosesTogether = 400;

// By image_id, for the photos that took part, and of the cameras' parameters where lenses are
// adjusted (of cameras that are one lens the same), by camera_id; what a lens leaves open is in the
// poses', too. Image noise is that of the bundle; what stays unknown of a surface is taken to be
// the same for all points within half a metre of it, so that thousands of points on a wall do not
// make it exact. More than max_poses photos are taken in groups of their order, each as if there
// were no others: that says more than all photos leave open, never less. Empty for a bundle that is
// not usable, without the group where something stays open. What the rows' motions leave open is in
// them; for more than half of max_poses photos by what each photo's own adds where all others are
// known.
struct BundleCovariances {
  PoseCovariances poses;
  std::map<uint32_t, Eigen::MatrixXd> cameras;
};
BundleCovariances FindCovariances(const PlaneBundleInput& input, const PlaneBundle& bundle,
                                  const PlaneBundleOptions& options,
                                  size_t max_poses = kMaxPosesTogether);

}  // namespace roomtex
