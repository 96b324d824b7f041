#pragma once
// What an alignment is worth in millimetres: the covariance of the similarity, propagated to where
// it matters (forward propagation; Hartley and Zisserman 2004, 5.2).

#include <cstdint>
#include <map>
#include <vector>

#include <Eigen/Core>

#include "align/fit/pose_covariance.h"
#include "align/fit/similarity_fit.h"
#include "align/trust/disagreement.h"
#include "core/scan.h"

namespace roomtex {

// Standard deviation of the position of a point that moves with the similarity, metres (root of the
// trace of J C J^T with J = [I, -(x - c)_x, x - c]); infinite if the fit leaves something open.
double PositionSigmaAt(const SimilarityFit& fit, const Eigen::Vector3d& x_in_scan);

struct ExpectedError {
  double at_cameras = 0;     // median over the photos, metres
  double at_far_corner = 0;  // the largest over the corners of the scan's bounding box, metres
  Eigen::Vector3d far_corner = Eigen::Vector3d::Zero();  // `scan`
  double rotation = 0;                                   // radians, root of the trace
  double scale = 0;                                      // relative
};

struct PhotoSigma {
  double position = 0;  // metres, root of the trace
  double rotation = 0;  // radians, root of the trace
};

using CameraCentres = std::map<uint32_t, Eigen::Vector3d>;  // `scan`, by image_id
CameraCentres FindCameraCentres(const SparseModel& model, const Similarity& scan_from_model);

// Of the photos, by image_id. The larger of two: the photo's own
// covariance where there is one (of an adjusted model), and that of the similarity at its place;
// beside it how far sparse model and scan disagree in what the photo sees, and as much as they do
// before the median photo, for what the fit has taken up and nothing shows: twelve rooms of a
// drifting depth camera were off by that much more (docs/real-rooms.md).
std::map<uint32_t, PhotoSigma> FindPhotoSigmas(const PoseCovariances& covariances,
                                               const CameraCentres& centres,
                                               const SimilarityFit& fit,
                                               const ShapeDisagreement& disagreement);

// Sets at_cameras and rotation to the medians over the photos, and adds the disagreement of the
// room to what is expected at the far corner; leaves them if there are no photos.
void SetExpectedErrorAtCameras(const std::map<uint32_t, PhotoSigma>& sigmas,
                               const ShapeDisagreement& disagreement, ExpectedError* error);

ExpectedError PropagateError(const SimilarityFit& fit, const CameraCentres& centres,
                             const std::vector<Scan>& scans);

}  // namespace roomtex
