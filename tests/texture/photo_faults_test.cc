// Photos of a simulated room that are blurred, or read row by row in a moving hand.

#include <gtest/gtest.h>

#include "tests/texture/colored_room.h"

namespace roomtex {
namespace {

class BlurredPhotosTest : public ColoredRoomTest {
 protected:
  static void SetUpTestSuite() {
    SimulatedRoomOptions options = Options();
    options.blur_px = 1.5;
    options.blurred = 0.5;
    Make(options);
  }
};

TEST_F(BlurredPhotosTest, CountLess) {
  const std::vector<PhotoView> photos = Photos(0, 0);
  ColorizeOptions options;
  const ColorizeResult weighed = Colorize(photos, options);
  options.blend.sharpness_weight = false;
  const ColorizeResult alike = Colorize(photos, options);
  EXPECT_GT(Psnr(weighed), Psnr(alike) + 0.7);
  for (int i = 0; i < room_->NumPhotos(); ++i) {
    // It is measured in any case.
    EXPECT_EQ(weighed.sharpness[i].sharpness, alike.sharpness[i].sharpness);
    EXPECT_GT(weighed.sharpness[i].num_samples, 200u);
    if (room_->IsBlurred(i)) {
      EXPECT_LT(weighed.sharpness[i].sharpness, 0.6) << i;
      EXPECT_LT(weighed.photos[i].weight, 0.3) << i;
    } else {
      EXPECT_GT(weighed.sharpness[i].sharpness, 0.85) << i;
      EXPECT_EQ(weighed.photos[i].weight, 1) << i;
    }
    EXPECT_EQ(alike.photos[i].weight, 1) << i;
  }
  options.blend.sharpness_weight = true;
  EXPECT_EQ(Colorize(photos, options, 1).scans[0].samples.rgb, weighed.scans[0].samples.rgb);
}

class RollingShutterTest : public ColoredRoomTest {
 protected:
  static void SetUpTestSuite() {
    SimulatedRoomOptions options = Options();
    options.rolling_shutter_ms = 30;
    options.hand_turn_deg = 30;
    Make(options);
  }
};

TEST_F(RollingShutterTest, IsFoundAndTakenBack) {
  const std::vector<PhotoView> photos = Photos(0, 0);
  ColorizeOptions options;
  // By default.
  const double unasked = Psnr(Colorize(photos, options));
  options.registration.mode = "none";
  const double without = Psnr(Colorize(photos, options));
  EXPECT_GT(unasked, without + 3);
  options.registration.mode = "pose";
  const ColorizeResult with = Colorize(photos, options);
  options.registration.row_turn_deg = 0;
  const ColorizeResult by_pose_alone = Colorize(photos, options);
  EXPECT_GT(Psnr(with), without + 3);
  EXPECT_GT(Psnr(with), Psnr(by_pose_alone) + 2.5);
  for (size_t i = 0; i < photos.size(); ++i) {
    EXPECT_NEAR(with.registration.photos[i].row_turned_deg, 30 * 0.030, 0.25) << i;
    EXPECT_LT(with.registration.photos[i].turned_deg, 0.15) << i;
    EXPECT_EQ(by_pose_alone.registration.photos[i].row_turned_deg, 0);
  }
}

}  // namespace
}  // namespace roomtex
