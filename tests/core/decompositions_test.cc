#include "core/decompositions.h"

#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace roomtex {
namespace {

TEST(Decompositions, TheShortestRotationTurnsOneDirectionIntoAnother) {
  const Eigen::Vector3d from(1, 2, -0.5), to(-3, 0.1, 2);
  const Eigen::Quaterniond turn = RotationBetween(from, to);
  EXPECT_THAT(Eigen::Vector3d(turn * from.normalized()), IsNearMatrix(to.normalized(), 1e-14));
  EXPECT_NEAR(turn.vec().dot(from), 0, 1e-14);  // about what is normal to both
  const Eigen::Quaterniond half = RotationBetween(from, -2 * from);
  EXPECT_THAT(Eigen::Vector3d(half * from), IsNearMatrix(Eigen::Vector3d(-from), 1e-7));
}

TEST(Decompositions, EigenvaluesAscendAndTheirVectorsGiveTheMatrixBack) {
  const Eigen::MatrixXd root = Eigen::MatrixXd::Random(5, 5);
  const Eigen::MatrixXd symmetric = root + root.transpose();
  const SymmetricEigen eigen(symmetric);
  for (int i = 1; i < 5; ++i) EXPECT_LE(eigen.values[i - 1], eigen.values[i]);
  const Eigen::MatrixXd back =
      eigen.vectors * eigen.values.asDiagonal() * eigen.vectors.transpose();
  EXPECT_THAT(back, IsNearMatrix(symmetric, 1e-13));
}

TEST(Decompositions, TheLastRightSingularVectorIsWhatAMatrixTakesAway) {
  Eigen::MatrixXd a(2, 3);  // fewer rows than columns
  a << 1, 2, 3, -1, 0, 1;
  const Eigen::MatrixXd vectors = RightSingularVectors(a);
  ASSERT_EQ(vectors.cols(), 3);
  EXPECT_NEAR((a * vectors.col(2)).norm(), 0, 1e-14);
  EXPECT_GT((a * vectors.col(0)).norm(), (a * vectors.col(1)).norm());
}

TEST(Decompositions, SymmetricEquationsAreSolvedAlsoNegativeOnes) {
  const Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::Random();
  const Eigen::Matrix<double, 6, 6> A = root * root.transpose() + root.Identity();
  const Eigen::Matrix<double, 6, 1> x = Eigen::Matrix<double, 6, 1>::LinSpaced(1, 6);
  EXPECT_THAT(SolveSymmetric(A, A * x), IsNearMatrix(x, 1e-12));
  EXPECT_THAT(SolveSymmetric(Eigen::MatrixXd(-A), Eigen::VectorXd(-A * x)), IsNearMatrix(x, 1e-12));
  const Eigen::Matrix3d part = A.topLeftCorner<3, 3>();
  EXPECT_THAT(SolveSymmetric(part, part * x.head<3>()),
              IsNearMatrix(Eigen::Vector3d(x.head<3>()), 1e-12));
}

}  // namespace
}  // namespace roomtex
