#include "align/trust/expected_error.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/statistics.h"

namespace roomtex {
namespace {

// Medians over the photos that see the surface; 0 if none does.
PhotoDisagreement OfTheMedianPhoto(const ShapeDisagreement& disagreement) {
  std::vector<double> shifts, rotations;
  for (const auto& [image_id, photo] : disagreement.photos) {
    shifts.push_back(photo.shift);
    rotations.push_back(photo.rotation);
  }
  return {Median(&shifts), Median(&rotations)};
}

}  // namespace

double PositionSigmaAt(const SimilarityFit& fit, const Eigen::Vector3d& x_in_scan) {
  const Eigen::Vector3d x = x_in_scan - fit.pivot;
  Eigen::Matrix<double, 3, 7> jacobian;
  jacobian.leftCols<3>().setIdentity();
  jacobian.middleCols<3>(3) << 0, x.z(), -x.y(), -x.z(), 0, x.x(), x.y(), -x.x(), 0;  // -(x)_x
  jacobian.col(6) = x;
  const double variance = (jacobian * fit.covariance * jacobian.transpose()).trace();
  return variance >= 0 ? std::sqrt(variance) : std::numeric_limits<double>::infinity();
}

CameraCentres FindCameraCentres(const SparseModel& model, const Similarity& scan_from_model) {
  CameraCentres centres;
  for (const auto& [image_id, image] : model.images) {
    centres[image_id] = scan_from_model * image.cam_from_model.TargetOriginInSource();
  }
  return centres;
}

std::map<uint32_t, PhotoSigma> FindPhotoSigmas(const PoseCovariances& covariances,
                                               const CameraCentres& centres,
                                               const SimilarityFit& fit,
                                               const ShapeDisagreement& disagreement) {
  const double rotation = std::sqrt(fit.covariance.block<3, 3>(3, 3).trace());
  const PhotoDisagreement taken_up = OfTheMedianPhoto(disagreement);
  std::map<uint32_t, PhotoSigma> sigmas;
  for (const auto& [image_id, centre] : centres) {
    PhotoSigma sigma{PositionSigmaAt(fit, centre), rotation};
    const auto own = covariances.find(image_id);
    if (own != covariances.end()) {
      sigma.position = std::max(sigma.position, std::sqrt(own->second.block<3, 3>(3, 3).trace()));
      sigma.rotation = std::max(sigma.rotation, std::sqrt(own->second.block<3, 3>(0, 0).trace()));
    }
    const auto seen = disagreement.photos.find(image_id);
    const bool known = seen != disagreement.photos.end();
    sigma.position =
        std::hypot(sigma.position, known ? seen->second.shift : disagreement.rms, taken_up.shift);
    sigma.rotation =
        std::hypot(sigma.rotation, known ? seen->second.rotation : 0, taken_up.rotation);
    sigmas[image_id] = sigma;
  }
  return sigmas;
}

void SetExpectedErrorAtCameras(const std::map<uint32_t, PhotoSigma>& sigmas,
                               const ShapeDisagreement& disagreement, ExpectedError* error) {
  if (sigmas.empty()) return;
  std::vector<double> positions, rotations;
  for (const auto& [image_id, sigma] : sigmas) {
    positions.push_back(sigma.position);
    rotations.push_back(sigma.rotation);
  }
  error->at_cameras = Median(&positions);
  error->rotation = Median(&rotations);
  error->at_far_corner = std::hypot(error->at_far_corner, disagreement.rms);
}

ExpectedError PropagateError(const SimilarityFit& fit, const CameraCentres& centres,
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
  for (const auto& [image_id, centre] : centres) sigmas.push_back(PositionSigmaAt(fit, centre));
  error.at_cameras = Median(&sigmas, error.at_cameras);
  const double rotation2 = fit.covariance.block<3, 3>(3, 3).trace();
  error.rotation = rotation2 >= 0 ? std::sqrt(rotation2) : std::numeric_limits<double>::infinity();
  error.scale = std::sqrt(std::max(fit.covariance(6, 6), 0.0));
  return error;
}

}  // namespace roomtex
