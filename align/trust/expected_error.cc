#include "align/trust/expected_error.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/statistics.h"

namespace roomtex {

double PositionSigmaAt(const SimilarityFit& fit, const Eigen::Vector3d& x_in_scan) {
  const Eigen::Vector3d x = x_in_scan - fit.pivot;
  Eigen::Matrix<double, 3, 7> jacobian;
  jacobian.leftCols<3>().setIdentity();
  jacobian.middleCols<3>(3) << 0, x.z(), -x.y(), -x.z(), 0, x.x(), x.y(), -x.x(), 0;  // -(x)_x
  jacobian.col(6) = x;
  const double variance = (jacobian * fit.covariance * jacobian.transpose()).trace();
  return variance >= 0 ? std::sqrt(variance) : std::numeric_limits<double>::infinity();
}

std::map<uint32_t, PhotoSigma> FindPhotoSigmas(const PoseCovariances& covariances,
                                               const SparseModel& adjusted,
                                               const SimilarityFit& fit) {
  const double rotation = std::sqrt(fit.covariance.block<3, 3>(3, 3).trace());
  std::map<uint32_t, PhotoSigma> sigmas;
  for (const auto& [image_id, covariance] : covariances) {
    const Eigen::Vector3d centre =
        adjusted.images.at(image_id).cam_from_model.TargetOriginInSource();
    sigmas[image_id] = {
        std::max(std::sqrt(covariance.block<3, 3>(3, 3).trace()), PositionSigmaAt(fit, centre)),
        std::max(std::sqrt(covariance.block<3, 3>(0, 0).trace()), rotation)};
  }
  return sigmas;
}

void SetExpectedErrorAtCameras(const std::map<uint32_t, PhotoSigma>& sigmas, ExpectedError* error) {
  if (sigmas.empty()) return;
  std::vector<double> positions, rotations;
  for (const auto& [image_id, sigma] : sigmas) {
    positions.push_back(sigma.position);
    rotations.push_back(sigma.rotation);
  }
  error->at_cameras = Median(&positions);
  error->rotation = Median(&rotations);
}

ExpectedError PropagateError(const SimilarityFit& fit,
                             const std::vector<Eigen::Vector3d>& camera_centres,
                             const std::vector<Scan>& scans) {
  ExpectedError error;
  Bounds bounds;
  for (const Scan& scan : scans) {
    const Bounds one = FindBounds(scan);
    bounds.min = bounds.min.cwiseMin(one.min);
    bounds.max = bounds.max.cwiseMax(one.max);
  }
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d x;
    for (int k = 0; k < 3; ++k) x[k] = corner >> k & 1 ? bounds.max[k] : bounds.min[k];
    const double sigma = PositionSigmaAt(fit, x);
    if (!(sigma > error.at_far_corner)) continue;
    error.at_far_corner = sigma;
    error.far_corner = x;
  }
  std::vector<double> sigmas;
  for (const Eigen::Vector3d& centre : camera_centres)
    sigmas.push_back(PositionSigmaAt(fit, centre));
  error.at_cameras = Median(&sigmas, error.at_cameras);
  const double rotation2 = fit.covariance.block<3, 3>(3, 3).trace();
  error.rotation = rotation2 >= 0 ? std::sqrt(rotation2) : std::numeric_limits<double>::infinity();
  error.scale = std::sqrt(std::max(fit.covariance(6, 6), 0.0));
  return error;
}

}  // namespace roomtex
