#include "core/robust_kernel.h"

#include <limits>

#include <gtest/gtest.h>

namespace roomtex {
namespace {

// Of a kernel's cost rho(r): weight = rho'(r) / (2 r), since the cost of a square is r^2.
TEST(Huber, WeightsBelongToItsCost) {
  constexpr double kLimit = 1.5, kStep = 1e-6;
  for (const double r : {0.3, 1.4, 1.6, 20.0}) {
    const double slope = (HuberCost(r + kStep, kLimit) - HuberCost(r - kStep, kLimit)) / 2 / kStep;
    EXPECT_NEAR(HuberWeight(r, kLimit), slope / 2 / r, 1e-8) << r;
  }
}

TEST(Huber, IsPlainSquaresWithoutALimit) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(HuberWeight(7, infinity), 1);
  EXPECT_EQ(HuberCost(7, infinity), 49);
}

TEST(Kernels, AreOneAtZeroAndFall) {
  EXPECT_EQ(HuberWeight(0, 2), 1);
  EXPECT_EQ(CauchyWeight(0), 1);
  EXPECT_EQ(TukeyRootWeight(0, 2), 1);
  EXPECT_EQ(GemanMcClureWeight(0), 1);
  for (double r = 0; r < 5; r += 0.25) {
    EXPECT_GE(HuberWeight(r, 2), HuberWeight(r + 0.25, 2));
    EXPECT_GT(CauchyWeight(r), CauchyWeight(r + 0.25));
    EXPECT_GE(TukeyRootWeight(r, 2), TukeyRootWeight(r + 0.25, 2));
    EXPECT_GT(GemanMcClureWeight(r * r), GemanMcClureWeight((r + 0.25) * (r + 0.25)));
  }
}

TEST(Tukey, IsNothingFromTheGateOn) {
  EXPECT_EQ(TukeyRootWeight(2, 2), 0);
  EXPECT_EQ(TukeyRootWeight(-2.5, 2), 0);
  EXPECT_EQ(TukeyRootWeight(-1, 2), 0.75);
}

TEST(Kernels, MultiplyAWeight) {
  EXPECT_EQ(CauchyWeight(1, 3.0), 1.5);
  EXPECT_EQ(GemanMcClureWeight(1, 3.0), 0.75);
}

}  // namespace
}  // namespace roomtex
