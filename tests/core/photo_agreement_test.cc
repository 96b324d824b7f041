#include "core/photo_agreement.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/random_stream.h"

namespace roomtex {
namespace {

using Seen = std::vector<std::pair<int, float>>;

DividedPhotos DividedBy(const Seen& seen) {
  PhotoComparison comparison(6);
  comparison.Add(seen);
  return comparison.Divided();
}

TEST(DividedPhotos, AreTwoGroupsOfTwoThatAgreeEach) {
  EXPECT_EQ(DividedBy({{0, 0.2f}, {1, 0.6f}, {2, 0.22f}, {3, 0.58f}}).num_divided, 1u);
  EXPECT_EQ(DividedBy({{0, 0.2f}, {1, 0.6f}, {2, 0.22f}, {3, 0.58f}, {4, 0.61f}}).num_divided, 1u);
}

TEST(DividedPhotos, AreNotWhereOneDiffersOrAllDo) {
  // Somebody walked through one photo; a mirror shows each photo something else; noise.
  for (const Seen& seen : {Seen{{0, 0.2f}, {1, 0.6f}, {2, 0.61f}, {3, 0.6f}},
                           Seen{{0, 0.2f}, {1, 0.35f}, {2, 0.5f}, {3, 0.65f}}}) {
    const DividedPhotos divided = DividedBy(seen);
    EXPECT_EQ(divided.num_samples, 1u);
    EXPECT_EQ(divided.num_unlike, 1u);
    EXPECT_EQ(divided.num_divided, 0u);
  }
  const DividedPhotos alike = DividedBy({{0, 0.5f}, {1, 0.52f}, {2, 0.56f}, {3, 0.58f}});
  EXPECT_EQ(alike.num_unlike, 0u);
  EXPECT_EQ(alike.num_divided, 0u);
}

TEST(DividedPhotos, NeedFourPhotos) {
  EXPECT_EQ(DividedBy({{0, 0.2f}, {1, 0.6f}, {2, 0.2f}}).num_samples, 0u);
}

TEST(DividedPhotos, OfTooFewSamplesAreNoFold) {
  for (const size_t num : {500u, 2000u}) {
    PhotoComparison comparison(4);
    for (size_t i = 0; i < num; ++i) {
      const float a = 0.2f + 0.01f * (i % 7), b = 0.7f - 0.01f * (i % 5);
      comparison.Add({{0, a}, {1, a}, {2, b}, {3, b}});
    }
    EXPECT_EQ(comparison.Divided().ShareOfAll(), 1);
    EXPECT_EQ(comparison.Contradicts(), num > 1000);
  }
}

// In another light photos stand against each other, but show the same.
TEST(DividedPhotos, InTwoLightsAreNoFold) {
  PhotoComparison comparison(4);
  for (int i = 0; i < 3000; ++i) {
    const float a = 0.1f + 0.1f * (i % 8);
    comparison.Add({{0, a}, {1, a}, {2, 0.5f * a}, {3, 0.5f * a}});
  }
  EXPECT_GT(comparison.Divided().ShareOfUnlike(), 0.3);
  EXPECT_FALSE(comparison.Contradicts());
}

// A fold with more than two groups: everybody shows something else.
TEST(PhotoComparison, PhotosThatShowNothingAlikeContradict) {
  RandomStream random(7);
  for (const double contrast : {0.02, 0.5}) {
    PhotoComparison comparison(5);
    for (int i = 0; i < 3000; ++i) {
      std::vector<std::pair<int, float>> seen;
      for (int photo = 0; photo < 5; ++photo) {
        seen.emplace_back(photo, static_cast<float>(0.2 + contrast * random.Uniform()));
      }
      comparison.Add(seen);
    }
    // Of a bare wall there is nothing but noise.
    EXPECT_EQ(comparison.Contradicts(), contrast > 0.1);
  }
}

TEST(PhotoAgreement, IsThatWithTheMedianOfTheOthers) {
  PhotoComparison comparison(5);
  for (int i = 0; i < 100; ++i) {
    const float a = 0.005f * i;
    comparison.Add({{0, a}, {1, 0.4f * a}, {2, 1 - a}, {3, a}});
    comparison.Add({{4, a}, {0, a}});  // two say nothing
  }
  const std::vector<PhotoAgreement> agreement = comparison.Agreement();
  EXPECT_EQ(agreement[4].num_samples, 0u);
  EXPECT_EQ(agreement[4].correlation, 0);
  for (const int photo : {0, 1, 3}) {
    EXPECT_EQ(agreement[photo].num_samples, 100u);
    EXPECT_NEAR(agreement[photo].correlation, 1, 1e-5);
    EXPECT_NEAR(agreement[photo].difference, 0, 1e-3);
  }
  EXPECT_NEAR(agreement[2].correlation, -1, 1e-5);
  // Nothing of it is explained: its whole scatter, of a uniform distribution 0.5 wide.
  EXPECT_NEAR(agreement[2].difference, 0.5 / std::sqrt(12.0), 1e-3);
}

}  // namespace
}  // namespace roomtex
