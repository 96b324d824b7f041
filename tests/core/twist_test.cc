#include "core/twist.h"

#include <gtest/gtest.h>

#include "core/frames.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Vector7 = Eigen::Matrix<double, 7, 1>;

const Eigen::Vector3d kTurn(0.3, -0.4, 1.2), kTurnedPoint(0.5, 2, -3);

TEST(CrossMatrix, MultipliesAsTheCrossProduct) {
  EXPECT_THAT(CrossMatrix(kTurn) * kTurnedPoint, IsNearMatrix(kTurn.cross(kTurnedPoint), 1e-15));
}

TEST(RotationFromVector, TurnsByItsLengthAboutItsDirection) {
  EXPECT_NEAR(RotationAngle(RotationFromVector(kTurn), Eigen::Quaterniond::Identity()),
              kTurn.norm(), 1e-15);
  EXPECT_THAT(RotationFromVector(kTurn) * kTurn, IsNearMatrix(kTurn, 1e-15));
  EXPECT_EQ(RotationFromVector(Eigen::Vector3d::Zero()).coeffs(),
            Eigen::Quaterniond::Identity().coeffs());
}

TEST(VectorFromRotation, IsTheInverseUpToHalfATurn) {
  for (const double scale : {0.0, 1e-200, 1e-9, 0.1, 1.0, 2.3}) {
    const Eigen::Vector3d w = scale * kTurn;
    const Eigen::Quaterniond rotation = RotationFromVector(w);
    EXPECT_THAT(VectorFromRotation(rotation), IsNearMatrix(w, 1e-14)) << scale;
    const Eigen::Quaterniond same(-rotation.coeffs());
    EXPECT_THAT(VectorFromRotation(same), IsNearMatrix(w, 1e-14)) << scale;
  }
  // More than half a turn is less than half a turn the other way round.
  const Eigen::Vector3d axis = kTurn.normalized();
  EXPECT_THAT(VectorFromRotation(RotationFromVector(4 * axis)),
              IsNearMatrix((4 - 2 * kPi) * axis, 1e-14));
}

TEST(RotationWithJacobian, IsTheSameRotationAtAnyAngle) {
  for (const double scale : {0.0, 1e-9, 1e-4, 1e-3, 0.1, 1.0, 2.5}) {
    EXPECT_THAT(RotationWithJacobian(scale * kTurn).rotation,
                IsNearMatrix(RotationFromVector(scale * kTurn).toRotationMatrix(), 1e-13))
        << scale;
  }
}

// exp(w + dw) = exp(L dw) exp(w), to first order.
TEST(RotationWithJacobian, LeftJacobianAgreesWithNumericDifferences) {
  constexpr double kStep = 1e-6;
  for (const double scale : {0.0, 1e-4, 1e-3, 1.0}) {
    const RotationAndJacobian at = RotationWithJacobian(scale * kTurn);
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d dw = kStep * Eigen::Vector3d::Unit(k);
      const Eigen::Matrix3d difference = (RotationWithJacobian(scale * kTurn + dw).rotation -
                                          RotationWithJacobian(scale * kTurn - dw).rotation) /
                                         (2 * kStep);
      EXPECT_THAT(
          difference,
          IsNearMatrix(Eigen::Matrix3d(CrossMatrix(at.left_jacobian.col(k)) * at.rotation), 1e-8));
    }
  }
}

TEST(Moved, OfARigidDoesWhatItsFormulaSays) {
  const Rigid pose = {RotationFromVector({1, 2, 0.5}), {4, 5, 6}};
  const Vector6 step = 1e-5 * (Vector6() << 1, -2, 3, 0.4, 0.5, -0.6).finished();
  const Eigen::Vector3d x = pose * kTurnedPoint;
  const Eigen::Vector3d expected = x + step.head<3>().cross(x - pose.translation) + step.tail<3>();
  EXPECT_THAT(Moved(pose, step) * kTurnedPoint, IsNearMatrix(expected, 1e-8));
  EXPECT_EQ(Moved(pose, Vector6::Zero()).rotation.coeffs(), pose.rotation.coeffs());
}

TEST(Moved, OfASimilarityDoesWhatItsFormulaSays) {
  const Similarity s = {2.5, RotationFromVector({1, 2, 0.5}), {4, 5, 6}};
  const Eigen::Vector3d pivot(1, -1, 2);
  const Vector7 step = 1e-5 * (Vector7() << 1, -2, 3, 0.4, 0.5, -0.6, 0.7).finished();
  const Eigen::Vector3d x = s * kTurnedPoint;
  const Eigen::Vector3d expected =
      x + step.head<3>() + step.segment<3>(3).cross(x - pivot) + step[6] * (x - pivot);
  EXPECT_THAT(Moved(s, pivot, step) * kTurnedPoint, IsNearMatrix(expected, 1e-8));
}

TEST(AngleBetween, IsExactForSmallAngles) {
  EXPECT_NEAR(AngleBetween({1, 0, 0}, {2, 2e-9, 0}), 1e-9, 1e-24);
  EXPECT_DOUBLE_EQ(AngleBetween({1, 0, 0}, {0, 0, 5}), kPi / 2);
  EXPECT_DOUBLE_EQ(AngleBetween({1, 0, 0}, {-3, 0, 0}), kPi);
}

}  // namespace
}  // namespace roomtex
