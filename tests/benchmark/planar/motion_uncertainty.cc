#include "tests/benchmark/planar/motion_uncertainty.h"

#include <cmath>
#include <limits>

#include <Eigen/Dense>

#include "core/decompositions.h"
#include "core/frames.h"

namespace roomtex {
namespace {

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

// d(pixel) of one observation: by its view (turn about the view's axes, translation) and its point
// (a, b, w). The point stands at R (a, b, 1) + w t before the division.
struct Derivatives {
  Eigen::Matrix<double, 2, 6> by_view;
  Eigen::Matrix<double, 2, 3> by_point;
};

Derivatives Differentiate(const Rigid& view_from_left, const InverseDepthPoint& point,
                          const Ray& ray) {
  const Eigen::Matrix3d rotation = view_from_left.rotation.toRotationMatrix();
  const Eigen::Vector3d turned = rotation * Eigen::Vector3d(point.x(), point.y(), 1);
  const Eigen::Vector3d x = turned + point.z() * view_from_left.translation;
  Eigen::Matrix<double, 2, 3> divided;
  divided << 1 / x.z(), 0, -x.x() / (x.z() * x.z()), 0, 1 / x.z(), -x.y() / (x.z() * x.z());
  const Eigen::Matrix<double, 2, 3> img_by_x = ray.img_from_ray * divided;
  Derivatives result;
  result.by_view << img_by_x * -Cross(turned), img_by_x * point.z();
  Eigen::Matrix3d x_by_point;
  x_by_point << rotation.leftCols<2>(), view_from_left.translation;
  result.by_point = img_by_x * x_by_point;
  return result;
}

}  // namespace

MotionUncertainty PairUncertainty(const SeedGeometry& geometry,
                                  const std::vector<SeedObservation>& observations,
                                  double noise_px) {
  const Eigen::Index size = 6 * (static_cast<Eigen::Index>(geometry.views_from_left.size()) - 1);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  std::vector<std::vector<const SeedObservation*>> of_point(geometry.points.size());
  for (const SeedObservation& observation : observations) {
    of_point[observation.point].push_back(&observation);
  }
  // Schur complement, point by point.
  for (size_t p = 0; p < of_point.size(); ++p) {
    Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
    Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(size, 3);
    for (const SeedObservation* observation : of_point[p]) {
      const Derivatives d = Differentiate(geometry.views_from_left[observation->view],
                                          geometry.points[p], observation->ray);
      own += d.by_point.transpose() * d.by_point;
      if (observation->view == 0) continue;
      const Eigen::Index at = 6 * (observation->view - 1);
      information.block<6, 6>(at, at) += d.by_view.transpose() * d.by_view;
      mixed.middleRows<6>(at) += d.by_view.transpose() * d.by_point;
    }
    if (of_point[p].size() < 2) continue;  // fixes nothing, and leaves its own depth open
    information -= mixed * own.ldlt().solve(mixed.transpose());
  }
  // The baseline's length is the gauge: only directions across it are left.
  const Eigen::Vector3d baseline = geometry.views_from_left[1].translation.normalized();
  const Eigen::Vector3d across1 = baseline.unitOrthogonal(), across2 = baseline.cross(across1);
  Eigen::MatrixXd free = Eigen::MatrixXd::Zero(size, size - 1);
  free.topLeftCorner<3, 3>().setIdentity();
  free.block<3, 1>(3, 3) = across1;
  free.block<3, 1>(3, 4) = across2;
  free.bottomRightCorner(size - 6, size - 6).setIdentity();
  const Eigen::MatrixXd reduced = free.transpose() * information * free;
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(reduced);
  MotionUncertainty result{std::numeric_limits<double>::infinity(),
                           std::numeric_limits<double>::infinity()};
  if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 0)) return result;
  const Eigen::MatrixXd covariance =
      ldlt.solve(Eigen::MatrixXd::Identity(size - 1, size - 1).leftCols(5)) * noise_px * noise_px;
  const auto largest = [](const Eigen::MatrixXd& part) {
    return DegFromRad(std::sqrt(SymmetricEigen(part).values.maxCoeff()));
  };
  result.rotation_deg = largest(covariance.topLeftCorner(3, 3));
  result.baseline_deg = largest(covariance.block(3, 3, 2, 2));
  return result;
}

}  // namespace roomtex
