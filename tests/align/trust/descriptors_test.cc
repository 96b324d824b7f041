#include "align/trust/descriptors.h"

#include <cmath>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/features2d.hpp>

#include "core/random_stream.h"

namespace roomtex {
namespace {

// Few large values and many small ones, as in SIFT.
cv::Mat1f RandomSift(int rows, uint64_t seed) {
  RandomStream random(seed);
  cv::Mat1f sift(rows, 128);
  for (float& value : sift) value = static_cast<float>(200 * std::pow(random.Uniform(), 4));
  return sift;
}

cv::Mat1f AsFloat(const Descriptors& descriptors) {
  cv::Mat1f values;
  descriptors.convertTo(values, CV_32F, 1.0 / kDescriptorLength);
  return values;
}

TEST(Descriptors, RootsAreOfUnitLengthAndFoldedOnesAsLong) {
  const cv::Mat1f sift = RandomSift(50, 1);
  const Descriptors roots = RootSift(sift), folded = FoldGradients(roots);
  ASSERT_EQ(folded.cols, 64);
  for (int i = 0; i < sift.rows; ++i) {
    // Rounding down takes away half a unit of each of 128 values.
    EXPECT_LE(cv::norm(AsFloat(roots.row(i))), 1);
    EXPECT_GT(cv::norm(AsFloat(roots.row(i))), 0.999);
    EXPECT_LE(cv::norm(AsFloat(folded.row(i))), 1);
    EXPECT_GT(cv::norm(AsFloat(folded.row(i))), 0.998);
    const double sum = cv::sum(sift.row(i))[0];
    for (int k = 0; k < 128; k += 17) {
      EXPECT_NEAR(roots(i, k), kDescriptorLength * std::sqrt(sift(i, k) / sum), 1.01);
    }
  }
}

TEST(Descriptors, OppositeGradientsFoldAlike) {
  const cv::Mat1f sift = RandomSift(10, 2);
  cv::Mat1f opposite(sift.size());
  for (int i = 0; i < sift.rows; ++i) {
    for (int k = 0; k < 128; ++k) opposite(i, k) = sift(i, k / 8 * 8 + (k + 4) % 8);
  }
  const Descriptors a = RootSift(sift), b = RootSift(opposite);
  const Descriptors folded_a = FoldGradients(a), folded_b = FoldGradients(b);
  for (int i = 0; i < sift.rows; ++i) {
    EXPECT_EQ(DescriptorDistance(folded_a, i, folded_b, i), 0);
    EXPECT_GT(DescriptorDistance(a, i, b, i), 0.3);
  }
}

TEST(Descriptors, TheNearestAreThoseThatABruteSearchFinds) {
  const Descriptors of = RootSift(RandomSift(70, 3)), among = RootSift(RandomSift(333, 4));
  for (const bool fold : {false, true}) {
    const Descriptors a = fold ? FoldGradients(of) : of, b = fold ? FoldGradients(among) : among;
    std::vector<std::vector<cv::DMatch>> expected;
    cv::BFMatcher(cv::NORM_L2).knnMatch(AsFloat(a), AsFloat(b), expected, 5);
    const auto found = FindNearestDescriptors(a, b, 5);
    ASSERT_EQ(found.size(), 70u);
    for (size_t i = 0; i < found.size(); ++i) {
      ASSERT_EQ(found[i].size(), 5u);
      for (size_t k = 0; k < 5; ++k) {
        EXPECT_NEAR(found[i][k].distance, expected[i][k].distance, 1e-5);
        EXPECT_NEAR(found[i][k].distance,
                    DescriptorDistance(a, static_cast<int>(i), b, found[i][k].row), 1e-6);
      }
      EXPECT_EQ(found[i][0].row, expected[i][0].trainIdx);
      EXPECT_NE(found[i][1].row, found[i][0].row);
    }
  }
}

TEST(Descriptors, OfAlikeOnesTheFirstAndNoMoreThanThereAre) {
  Descriptors among = RootSift(RandomSift(3, 5));
  among.row(1).copyTo(among.row(2));
  const auto found = FindNearestDescriptors(among, among, 5);
  ASSERT_EQ(found[2].size(), 3u);
  EXPECT_EQ(found[2][0].row, 1);
  EXPECT_EQ(found[2][1].row, 2);
  EXPECT_EQ(found[2][1].distance, 0);
  EXPECT_TRUE(FindNearestDescriptors(Descriptors(0, 128), among, 5).empty());
}

TEST(Descriptors, WithoutGradientsOneIsAsFarFromAllAsTheyAreLong) {
  const Descriptors none = RootSift(cv::Mat1f::zeros(1, 128)), some = RootSift(RandomSift(1, 6));
  EXPECT_EQ(cv::norm(none), 0);
  EXPECT_NEAR(DescriptorDistance(none, 0, some, 0), 1, 1e-3);
}

}  // namespace
}  // namespace roomtex
