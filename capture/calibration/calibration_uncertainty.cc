#include "capture/calibration/calibration_uncertainty.h"

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "core/decompositions.h"
#include "core/projection_jacobian.h"

namespace roomtex {
namespace {

constexpr double kNotKnown = std::numeric_limits<double>::infinity();

// How the position of a viewing ray changes with the parameters and with a turn of the camera.
struct Derivatives {
  Eigen::Matrix<double, 2, kMaxCameraParams> by_params;
  Eigen::Matrix<double, 2, 3> by_turn;
};

Derivatives DeriveAt(const Camera& camera, const Eigen::Vector2d& ray) {
  const auto seen = ProjectRay<kMaxCameraParams>(
      camera.model, camera.params.data(), static_cast<int>(camera.params.size()), ray.x(), ray.y());
  // (x, y, 1) turned by w: (x, y, 1) + w x (x, y, 1), divided by its third coordinate.
  const double x = ray.x(), y = ray.y();
  Eigen::Matrix<double, 2, 3> ray_by_turn;
  ray_by_turn << -x * y, 1 + x * x, -y, -1 - y * y, x * y, x;
  return {seen.by_params, seen.by_ray * ray_by_turn};
}

Eigen::Vector2d NoPosition() {
  return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
}

}  // namespace

Eigen::Matrix2Xd PictureGrid(int width, int height) {
  const int longer = 15;
  const int shorter =
      std::max(3, static_cast<int>(std::lround(1.0 * longer * std::min(width, height) /
                                               std::max(width, height))));
  const int columns = width >= height ? longer : shorter, rows = width >= height ? shorter : longer;
  Eigen::Matrix2Xd grid(2, columns * rows);
  for (int i = 0; i < columns * rows; ++i) {
    grid.col(i) << 1.0 * width * (i % columns) / (columns - 1),
        1.0 * height * (i / columns) / (rows - 1);
  }
  return grid;
}

Eigen::Matrix2Xd PictureCorners(int width, int height) {
  Eigen::Matrix2Xd corners(2, 4);
  corners << 0, width, width, 0, 0, 0, height, height;
  return corners;
}

std::vector<double> MappingSigma(const Camera& camera, const Eigen::MatrixXd& covariance,
                                 const Eigen::Matrix2Xd& x_in_img) {
  std::vector<double> sigmas(x_in_img.cols(), kNotKnown);
  const auto n = static_cast<Eigen::Index>(camera.params.size());
  if (!covariance.allFinite()) return sigmas;
  const CameraProjection projection(camera);
  const Eigen::Matrix2Xd grid = PictureGrid(camera.width, camera.height);
  Eigen::Matrix3d by_turns = Eigen::Matrix3d::Zero();
  Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(3, n);
  for (int i = 0; i < grid.cols(); ++i) {
    const auto ray = projection.CamFromImg(grid.col(i));
    if (!ray) continue;
    const Derivatives d = DeriveAt(camera, *ray);
    by_turns += d.by_turn.transpose() * d.by_turn;
    mixed += d.by_turn.transpose() * d.by_params.leftCols(n);
  }
  // The turn that best makes up for a change of the parameters.
  const Eigen::MatrixXd turn_by_params = -by_turns.ldlt().solve(mixed);
  for (int i = 0; i < x_in_img.cols(); ++i) {
    const auto ray = projection.CamFromImg(x_in_img.col(i));
    if (!ray) continue;
    const Derivatives d = DeriveAt(camera, *ray);
    const Eigen::MatrixXd change = d.by_params.leftCols(n) + d.by_turn * turn_by_params;
    sigmas[i] = std::sqrt(std::max(0.0, (change * covariance * change.transpose()).trace()));
  }
  return sigmas;
}

Eigen::Matrix2Xd MappingDifference(const Camera& camera, const Camera& other,
                                   const Eigen::Matrix2Xd& x_in_img, const Eigen::Matrix2Xd& over) {
  const CameraProjection from(camera), to(other);
  const Eigen::Matrix2Xd grid = over.cols() > 0 ? over : PictureGrid(camera.width, camera.height);
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  const auto seen_by_other = [&](const Eigen::Vector3d& ray) { return to.ImgFromCam(turn * ray); };
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector3d>> rays;  // where seen, and along which ray
  for (int i = 0; i < grid.cols(); ++i) {
    if (const auto ray = from.CamFromImg(grid.col(i)))
      rays.emplace_back(grid.col(i), ray->homogeneous());
  }
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const auto& [x, ray] : rays) {
      const auto seen = seen_by_other(ray);
      if (!seen) continue;
      const auto by_turn = DeriveAt(other, (turn * ray).hnormalized()).by_turn;
      normal += by_turn.transpose() * by_turn;
      right += by_turn.transpose() * (x - *seen);
    }
    const Eigen::Vector3d step = SolveSymmetric(normal, right);
    if (!step.allFinite() || !(step.norm() > 1e-10)) break;
    // Not RotationFromVector(): products of matrices, in the order that the report's numbers have.
    turn = Eigen::AngleAxisd(step.norm(), step.normalized()).toRotationMatrix() * turn;
  }
  Eigen::Matrix2Xd difference(2, x_in_img.cols());
  for (int i = 0; i < x_in_img.cols(); ++i) {
    const auto ray = from.CamFromImg(x_in_img.col(i));
    const auto seen = ray ? seen_by_other(ray->homogeneous()) : std::nullopt;
    difference.col(i) = seen ? Eigen::Vector2d(*seen - x_in_img.col(i)) : NoPosition();
  }
  return difference;
}

}  // namespace roomtex
