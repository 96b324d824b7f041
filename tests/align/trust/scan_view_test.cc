// What of a scan is one smooth surface: noise is no edge.

#include "align/trust/scan_view.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace roomtex {
namespace {

constexpr int kColumns = 200, kRows = 100;

// A wall 3 m before the scanner whose right half stands `step` metres nearer. noise: of the ranges,
// metres, one standard deviation.
Scan WallWithStep(double step, double noise) {
  Scan scan;
  scan.organised = true;
  scan.num_columns = kColumns;
  scan.num_rows = kRows;
  std::mt19937 random(1);
  std::normal_distribution<double> error(0, noise);
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const Eigen::Vector3d ray(0.008 * (column - kColumns / 2), 0.008 * (row - kRows / 2), 1);
      const double depth = column < kColumns / 2 ? 3 : 3 - step;
      scan.points.emplace_back(depth * ray + error(random) * ray.normalized());
    }
  }
  return scan;
}

// Share of the smooth samples in these columns.
double SmoothShare(const Scan& scan, int begin, int end) {
  const std::vector<uint8_t> smooth = FindSmoothSamples(scan);
  int num = 0;
  for (int row = 1; row + 1 < kRows; ++row) {
    for (int column = begin; column < end; ++column) num += smooth[scan.Index(column, row)];
  }
  return static_cast<double>(num) / ((kRows - 2) * (end - begin));
}

TEST(SmoothSamples, AreAllOfAWallAndNoneBesideAStep) {
  for (const double noise : {0.0, 0.002, 0.036}) {  // none, a laser's, a depth camera's
    SCOPED_TRACE(noise);
    const Scan scan = WallWithStep(1, noise);
    EXPECT_GT(SmoothShare(scan, 2, kColumns / 2 - 2), 0.95);
    EXPECT_GT(SmoothShare(scan, kColumns / 2 + 2, kColumns - 2), 0.95);
    EXPECT_LT(SmoothShare(scan, kColumns / 2 - 1, kColumns / 2 + 1), 0.01);
  }
}

TEST(SmoothSamples, OfAnExactScanEndAtASmallStep) {
  EXPECT_EQ(SmoothShare(WallWithStep(0.12, 0.002), kColumns / 2 - 1, kColumns / 2 + 1), 0);
}

}  // namespace
}  // namespace roomtex
