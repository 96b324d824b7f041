#include "capture/pattern/pattern_photo.h"

#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "capture/pattern/pattern.h"
#include "capture/simulation/room_pictures.h"
#include "tests/capture/pattern/pattern_camera.h"

namespace roomtex {
namespace {

class PatternPhoto : public ::testing::Test {
 protected:
  PatternPhoto() : pattern_(MakePattern(Options(0))), features_(FindFeatures(pattern_)) {}
  static PatternOptions Options(int seed) {
    PatternOptions options;
    options.width = 1280;
    options.height = 720;
    options.random_seed = seed;
    return options;
  }
  PatternPhotoCheck Check(const WallView& view) const {
    return CheckPatternPhoto(TakePhoto(pattern_, view, 3), pattern_, features_, 2);
  }
  static bool Says(const PatternPhotoCheck& check, const std::string& text) {
    for (const std::string& sentence : check.verdict) {
      if (sentence.find(text) != std::string::npos) return true;
    }
    return false;
  }

  cv::Mat1b pattern_;
  PatternFeatures features_;
};

TEST_F(PatternPhoto, IsFoundWhereItIs) {
  WallView view = SmallView();
  view.turn_deg = 15;
  view.roll_deg = 3;
  const PatternPhotoCheck check = Check(view);
  EXPECT_TRUE(check.usable);
  ASSERT_EQ(check.planes.size(), 1u);
  EXPECT_GT(check.on_planes, 600);
  const cv::Matx33d truth = PhotoFromPattern(view, pattern_.size());
  for (const cv::Point corner : {cv::Point(60, 60), cv::Point(1200, 60), cv::Point(640, 670)}) {
    const cv::Vec3d p(corner.x, corner.y, 1);
    const cv::Vec3d want = truth * p, have = check.planes[0].photo_from_pattern * p;
    EXPECT_NEAR(have[0] / have[2], want[0] / want[2], 1);
    EXPECT_NEAR(have[1] / have[2], want[1] / want[2], 1);
  }
  // 2 m over 1280 pixels, 3 m away, seen by a camera of 1012 pixels focal length.
  EXPECT_NEAR(check.planes[0].photo_pixels, 0.527, 0.03);
  EXPECT_EQ(check.verdict.size(), 1u) << check.verdict.back();
}

TEST_F(PatternPhoto, HasItsBlurMeasured) {
  for (const double blur : {0.7, 1.5, 3.0}) {
    WallView view = SmallView();
    view.distance = 1.4;
    view.blur_px = blur;
    const PatternPhotoCheck check = Check(view);
    EXPECT_NEAR(check.blur_px, blur, 0.3 + 0.15 * blur);
    EXPECT_EQ(Says(check, "focus the projector"), blur > 2);
  }
}

TEST_F(PatternPhoto, HasItsBlurMeasuredInItsOwnPixelsWhenItIsLarge) {
  WallView view = SmallView();
  view.width = 4000;
  view.height = 1600;
  view.distance = 2;
  view.blur_px = 4;
  const PatternPhotoCheck check = Check(view);
  EXPECT_TRUE(check.usable);
  EXPECT_NEAR(check.blur_px, 4, 0.9);
  EXPECT_NEAR(check.planes[0].photo_pixels, 2.45, 0.08);
}

TEST_F(PatternPhoto, OverExposedIsSaid) {
  WallView view = SmallView();
  view.gain = 2.5;
  const PatternPhotoCheck check = Check(view);
  EXPECT_GT(check.over_exposed, 0.2);
  EXPECT_TRUE(Says(check, "over-exposed"));
}

TEST_F(PatternPhoto, PaleAndDarkIsSaid) {
  WallView view = SmallView();
  view.room_light = 4;
  EXPECT_TRUE(Says(Check(view), "pale"));
  view.room_light = 0.2;
  view.gain = 0.02;
  EXPECT_TRUE(Says(Check(view), "dark"));
}

TEST_F(PatternPhoto, OfAnotherSeedOrOfNoPatternIsNotUsable) {
  const cv::Mat1b photo = TakePhoto(MakePattern(Options(1)), SmallView(), 3);
  EXPECT_FALSE(CheckPatternPhoto(photo, pattern_, features_, 2).usable);
  EXPECT_FALSE(CheckPatternPhoto(DrawCity(1200, 800, 1), pattern_, features_, 2).usable);
  const cv::Mat plain(400, 600, CV_8UC3, cv::Scalar::all(180));
  const PatternPhotoCheck check = CheckPatternPhoto(plain, pattern_, features_, 2);
  EXPECT_FALSE(check.usable);
  EXPECT_TRUE(check.planes.empty());
  EXPECT_TRUE(std::isnan(check.blur_px));
}

TEST_F(PatternPhoto, InACornerIsFoundOnBothWalls) {
  WallView left = SmallView(), right = SmallView();
  left.turn_deg = 35;
  right.turn_deg = -35;
  const cv::Mat1b a = TakePhoto(pattern_, left, 1), b = TakePhoto(pattern_, right, 2);
  cv::Mat1b photo = a.clone();
  const int middle = photo.cols / 2;
  b.colRange(middle, photo.cols).copyTo(photo.colRange(middle, photo.cols));
  const PatternPhotoCheck check = CheckPatternPhoto(photo, pattern_, features_, 2);
  ASSERT_GE(check.planes.size(), 2u);
  EXPECT_GT(check.planes[1].matched, 150);
  EXPECT_TRUE(check.usable);
}

}  // namespace
}  // namespace roomtex
