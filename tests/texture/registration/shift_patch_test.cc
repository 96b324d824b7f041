#include "texture/registration/shift_patch.h"

#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "texture/registration/shared_samples.h"

namespace roomtex {
namespace {

// Smooth, different in every direction.
float Pattern(float x, float y) {
  return 128 + 40 * std::sin(0.31f * x + 0.12f * y) + 35 * std::cos(0.07f * x - 0.36f * y);
}
float Stripes(float x, float) { return 128 + 60 * std::sin(0.4f * x); }
float Plain(float, float) { return 128; }

using Texture = float (*)(float, float);

cv::Mat1b Draw(Texture texture) {
  cv::Mat1b picture(60, 60);
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 60; ++x) {
      picture(y, x) = static_cast<uint8_t>(
          std::lround(texture(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f)));
    }
  }
  return picture;
}

// What others would say who see everything `shift` pixels away, darker by half.
std::vector<ExpectedPixel> Expect(Texture texture, const Eigen::Vector2f& shift) {
  std::vector<ExpectedPixel> expected;
  for (int i = 0; i < 225; ++i) {
    const Eigen::Vector2f place(20.3f + 1.4f * static_cast<float>(i % 15),
                                19.8f + 1.4f * static_cast<float>(i / 15));
    const Eigen::Vector2f shown = place + shift;
    expected.push_back({place, 0.5f * texture(shown.x(), shown.y())});
  }
  return expected;
}

TEST(ShiftPatch, FindsAShiftBetweenThePixelsInAnyLight) {
  const Eigen::Vector2f truth(1.7f, -2.35f);
  const PatchShift found = FindPatchShift(Draw(Pattern), Expect(Pattern, truth), 3);
  ASSERT_TRUE(found.is_found());
  EXPECT_NEAR(found.shift.x(), truth.x(), 0.1);
  EXPECT_NEAR(found.shift.y(), truth.y(), 0.1);
  EXPECT_GT(found.likeness, 0.99);
}

// Light that grows evenly stays what it is on every level, so that a place tells its own number.
TEST(ShiftPatch, APlaceIsTheSameOnEveryLevelOfThePyramid) {
  LevelPicture picture;
  picture.scale = {0.5f, 1};
  picture.grey = cv::Mat1b(64, 64);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) picture.grey(y, x) = static_cast<uint8_t>(x + 2 * y);
  }
  const Eigen::Vector2f in_photo(61.4f, 30.3f);
  const float here = GreyAt(picture.grey, picture.Place(in_photo));
  EXPECT_NEAR(here, 30.7 - 0.5 + 2 * (30.3 - 0.5), 0.01);
  for (picture.level = 1; picture.level <= 2; ++picture.level) {
    cv::Mat1b half;
    cv::pyrDown(picture.grey, half);
    picture.grey = half;
    // Greys are rounded to whole ones.
    EXPECT_NEAR(GreyAt(picture.grey, picture.Place(in_photo)), here, 0.5) << picture.level;
  }
}

TEST(ShiftPatch, KnowsNothingAlongStripes) {
  const PatchShift found = FindPatchShift(Draw(Stripes), Expect(Stripes, {1.2f, 0}), 2);
  ASSERT_TRUE(found.is_found());
  EXPECT_NEAR(found.shift.x(), 1.2, 0.1);
  EXPECT_LT(found.information(1, 1), 1e-3f * found.information(0, 0));
}

TEST(ShiftPatch, FindsNothingWithoutTextureOrLikeness) {
  EXPECT_FALSE(FindPatchShift(Draw(Plain), Expect(Plain, {0, 0}), 2).is_found());
  EXPECT_FALSE(FindPatchShift(Draw(Plain), Expect(Pattern, {0, 0}), 2).is_found());
  std::vector<ExpectedPixel> negative = Expect(Pattern, {0, 0});
  for (ExpectedPixel& pixel : negative) pixel.grey = 200 - pixel.grey;
  EXPECT_FALSE(FindPatchShift(Draw(Pattern), negative, 1).is_found());
  EXPECT_FALSE(FindPatchShift(Draw(Pattern), {}, 2).is_found());
}

TEST(ShiftPatch, GreysAreLinearBetweenPixelsAndNegativeOutside) {
  const cv::Mat1b picture = (cv::Mat1b(2, 2) << 10, 20, 30, 60);
  EXPECT_NEAR(GreyAt(picture, {0.5f, 0.5f}), 10, 1e-5);
  EXPECT_NEAR(GreyAt(picture, {1.0f, 1.0f}), 30, 1e-5);
  EXPECT_LT(GreyAt(picture, {0.3f, 1.0f}), 0);
  EXPECT_LT(GreyAt(picture, {1.0f, 1.6f}), 0);
  EXPECT_LT(GreyAt(picture, {std::nanf(""), 1.0f}), 0);
}

TEST(PatchShift, LikenessIsThatOfWhereItStands) {
  const cv::Mat1b picture = Draw(Pattern);
  const auto here = PatchLikeness(picture, Expect(Pattern, {0, 0}));
  const auto beside = PatchLikeness(picture, Expect(Pattern, {2, 1}));
  ASSERT_TRUE(here && beside);
  EXPECT_GT(*here, 0.99);
  EXPECT_LT(*beside, 0.95);
  EXPECT_FALSE(PatchLikeness(Draw(Plain), Expect(Pattern, {0, 0})));
}

}  // namespace
}  // namespace roomtex
