#include "texture/sampling/photo_warp.h"

#include <gtest/gtest.h>

namespace roomtex {
namespace {

TEST(PhotoWarp, IsLinearBetweenItsNodesAndZeroWithoutAny) {
  PhotoWarp warp(100, 60, 25);
  EXPECT_EQ(warp.columns(), 5);
  EXPECT_EQ(warp.rows(), 4);  // the last row of nodes lies beyond the border
  EXPECT_TRUE(warp.At(33, 44).isZero());
  for (int n = 0; n < warp.num_nodes(); ++n) {
    const Eigen::Vector2f place = warp.Place(n);
    warp.Shift(n) = {0.1f + 0.02f * place.x(), -0.03f * place.y()};
  }
  for (const Eigen::Vector2f& at :
       {Eigen::Vector2f(0, 0), Eigen::Vector2f(33, 44), Eigen::Vector2f(100, 60)}) {
    const Eigen::Vector2f shift = warp.At(at.x(), at.y());
    EXPECT_NEAR(shift.x(), 0.1f + 0.02f * at.x(), 1e-5);
    EXPECT_NEAR(shift.y(), -0.03f * at.y(), 1e-5);
  }
}

TEST(PhotoWarp, SharesOfTheNodesAddUpToOneOutsideToo) {
  const PhotoWarp warp(100, 60, 25);
  for (const Eigen::Vector2f& at :
       {Eigen::Vector2f(-7, 12), Eigen::Vector2f(51, 59), Eigen::Vector2f(300, 300)}) {
    std::array<int, 4> nodes;
    std::array<float, 4> shares;
    warp.NodesAt(at.x(), at.y(), &nodes, &shares);
    float sum = 0;
    for (int k = 0; k < 4; ++k) {
      EXPECT_GE(nodes[k], 0);
      EXPECT_LT(nodes[k], warp.num_nodes());
      EXPECT_GE(shares[k], 0);
      sum += shares[k];
    }
    EXPECT_NEAR(sum, 1, 1e-6);
  }
}

}  // namespace
}  // namespace roomtex
