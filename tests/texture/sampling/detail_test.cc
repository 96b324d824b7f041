#include "texture/sampling/detail.h"

#include <cmath>

#include <gtest/gtest.h>

namespace roomtex {
namespace {

Scan Grid(int columns, int rows) {
  Scan scan;
  scan.num_columns = columns;
  scan.num_rows = rows;
  return scan;
}

GridLinks AllLinked(const Scan& scan) {
  GridLinks links;
  links.bits.assign(static_cast<size_t>(scan.num_columns) * scan.num_rows,
                    GridLinks::kRight | GridLinks::kDown);
  return links;
}

// Slope of b over a, both without their mean.
double Slope(const std::vector<double>& a, const std::vector<double>& b) {
  double mean_a = 0, mean_b = 0, ab = 0, aa = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    mean_a += a[i] / static_cast<double>(a.size());
    mean_b += b[i] / static_cast<double>(a.size());
  }
  for (size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean_a) * (b[i] - mean_b);
    aa += (a[i] - mean_a) * (a[i] - mean_a);
  }
  return ab / aa;
}

// One row of fine stripes: the truth (dominant photo), and blends that kept a share of it.
TEST(PreserveDetail, BringsTheDetailBackOnceHoweverMuchTheBlendKept) {
  const Scan scan = Grid(200, 20);
  const size_t count = 200 * 20;
  for (double kept : {0.0, 0.5, 0.95}) {
    DominantMap dominant;
    dominant.photo.assign(count, 0);
    dominant.fits.assign(count, 1);
    std::vector<Eigen::Vector3f> blend(count);
    std::vector<double> truth, result;
    for (size_t i = 0; i < count; ++i) {
      const auto stripe = static_cast<float>(0.1 * std::sin(2.1 * static_cast<double>(i % 200)));
      dominant.color.push_back(Eigen::Vector3f::Constant(0.4f + stripe));
      blend[i] = Eigen::Vector3f::Constant(0.5f + static_cast<float>(kept) * stripe);
      truth.push_back(stripe);
    }
    PreserveDetail(scan, AllLinked(scan), dominant, DetailOptions(), 1, &blend);
    double mean = 0;
    for (const Eigen::Vector3f& color : blend) {
      result.push_back(color[0]);
      mean += color[0] / static_cast<double>(count);
    }
    EXPECT_NEAR(Slope(truth, result), 1, 0.03) << kept;
    EXPECT_NEAR(mean, 0.5, 2e-3) << kept;  // the low frequencies are the blend's
  }
}

TEST(PreserveDetail, LeavesTheBlendAloneAtSeams) {
  const Scan scan = Grid(40, 10);
  DominantMap dominant;
  dominant.fits.assign(400, 1);
  for (int i = 0; i < 400; ++i) {
    dominant.photo.push_back(i % 40 < 20 ? 0 : 1);
    dominant.color.push_back(Eigen::Vector3f::Constant(i % 40 < 20 ? 0.2f : 0.6f));
  }
  std::vector<Eigen::Vector3f> blend(400, Eigen::Vector3f::Constant(0.4f));
  DetailOptions options;
  options.border = 8;
  PreserveDetail(scan, AllLinked(scan), dominant, options, 1, &blend);
  for (int i = 0; i < 400; ++i) EXPECT_NEAR(blend[i][0], 0.4, 0.002) << i % 40;
}

TEST(PreserveDetail, DoesNotBleedOverDepthEdgesAndHoles) {
  const Scan scan = Grid(40, 10);
  GridLinks links = AllLinked(scan);
  DominantMap dominant;
  dominant.photo.assign(400, 0);
  dominant.fits.assign(400, 1);
  for (int i = 0; i < 400; ++i) {
    if (i % 40 == 19) links.bits[i] = GridLinks::kDown;  // depth edge between columns 19 and 20
    if (i % 40 == 30) {
      dominant.photo[i] = -1;  // hole
      dominant.fits[i] = 0;
      dominant.color.push_back(Eigen::Vector3f::Constant(99));
      continue;
    }
    dominant.color.push_back(Eigen::Vector3f::Constant(i % 40 < 20 ? 0.2f : 0.8f));
  }
  std::vector<Eigen::Vector3f> blend(400, Eigen::Vector3f::Constant(0.4f));
  DetailOptions options;
  options.border = 0;
  PreserveDetail(scan, links, dominant, options, 1, &blend);
  // Even colour on either side: no detail anywhere, however large the step between the sides.
  for (int i = 0; i < 400; ++i) EXPECT_NEAR(blend[i][0], 0.4, 1e-5) << i % 40;
}

TEST(DominanceBorders, DilateByTheGivenNumberOfSamples) {
  std::vector<int16_t> photo(20 * 5, 3);
  for (int row = 0; row < 5; ++row) {
    for (int column = 10; column < 20; ++column) photo[row * 20 + column] = 7;
  }
  const std::vector<uint8_t> thin = DominanceBorders(20, 5, photo, 0);
  const std::vector<uint8_t> wide = DominanceBorders(20, 5, photo, 3);
  for (int column = 0; column < 20; ++column) {
    EXPECT_EQ(thin[40 + column] != 0, column == 9 || column == 10) << column;
    EXPECT_EQ(wide[40 + column] != 0, column >= 6 && column <= 13) << column;
  }
}

TEST(PreserveDetail, DoesNotDependOnTheNumberOfThreads) {
  const Scan scan = Grid(300, 100);
  DominantMap dominant;
  dominant.fits.assign(30000, 1);
  std::vector<Eigen::Vector3f> one;
  for (int i = 0; i < 30000; ++i) {
    dominant.photo.push_back(static_cast<int16_t>(i / 7000));
    dominant.color.emplace_back(0.5f + 0.2f * std::sin(0.7f * static_cast<float>(i)), 0.3f, 0.1f);
    one.emplace_back(0.4f, 0.3f, 0.2f);
  }
  std::vector<Eigen::Vector3f> two = one;
  PreserveDetail(scan, AllLinked(scan), dominant, DetailOptions(), 1, &one);
  PreserveDetail(scan, AllLinked(scan), dominant, DetailOptions(), 4, &two);
  for (size_t i = 0; i < one.size(); ++i) ASSERT_EQ(one[i], two[i]);
}

}  // namespace
}  // namespace roomtex
