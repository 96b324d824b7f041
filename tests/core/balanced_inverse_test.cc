#include "core/balanced_inverse.h"

#include <limits>

#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace roomtex {
namespace {

TEST(BalancedInverse, IsTheInverseHoweverTheUnknownsDifferInSize) {
  Eigen::Matrix3d root;
  root << 2, 1, 0, -1, 3, 1, 0, 1, 1;
  const Eigen::DiagonalMatrix<double, 3> units(1e6, 1, 1e-6);
  const Eigen::Matrix3d normal = units * (root.transpose() * root) * units;
  const auto inverse = BalancedInverse(normal, 1e-12);
  ASSERT_TRUE(inverse.has_value());
  EXPECT_THAT(Eigen::Matrix3d(normal * *inverse), IsNearMatrix(Eigen::Matrix3d::Identity(), 1e-3));
  EXPECT_THAT(Eigen::Matrix3d(units * *inverse * units * (root.transpose() * root) * 1.0),
              IsNearMatrix(Eigen::Matrix3d::Identity(), 1e-9));
}

TEST(BalancedInverse, IsNoneWhereADirectionIsOpen) {
  const Eigen::Vector2d along(1, 2);
  EXPECT_FALSE(BalancedInverse(along * along.transpose(), 1e-12));
  EXPECT_FALSE(BalancedInverse(Eigen::Matrix2d::Zero(), 1e-12));
  EXPECT_FALSE(
      BalancedInverse(Eigen::Matrix2d::Constant(std::numeric_limits<double>::quiet_NaN()), 1e-12));
}

}  // namespace
}  // namespace roomtex
