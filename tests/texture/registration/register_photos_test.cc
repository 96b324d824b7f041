// A simulated room whose photos stand where they are said to stand, or not quite.

#include "texture/registration/register_photos.h"

#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "core/frames.h"
#include "core/twist.h"
#include "tests/texture/colored_room.h"

namespace roomtex {
namespace {

class RegisterPhotosTest : public ColoredRoomTest {
 protected:
  static void SetUpTestSuite() { Make(Options()); }
};

TEST_F(RegisterPhotosTest, PhotosThatAgreeStayAsTheyAre) {
  const std::vector<PhotoView> photos = Photos(0, 0);
  const ColorizeResult without = Colorize(photos, "none"), with = Colorize(photos, "pose");
  EXPECT_EQ(with.scans[0].samples.rgb, without.scans[0].samples.rgb);
  EXPECT_TRUE(without.registration.photos.empty());
  ASSERT_EQ(with.registration.photos.size(), photos.size());
  for (const PhotoRegistration& photo : with.registration.photos) {
    EXPECT_FALSE(photo.corrected);
    EXPECT_LT(photo.shift_before_px, 0.5);
    EXPECT_GT(photo.share_measured, 0.5);
  }
}

TEST_F(RegisterPhotosTest, PosesThatAreOffAreBroughtTogether) {
  const std::vector<PhotoView> photos = Photos(0.2, 0.01);
  const ColorizeResult without = Colorize(photos, "none"), with = Colorize(photos, "pose"),
                       measured = Colorize(photos, "measure");
  const double best = Psnr(Colorize(Photos(0, 0), "none")), worst = Psnr(without);
  EXPECT_GT(best, worst + 3);
  EXPECT_GT(Psnr(with), worst + 0.6 * (best - worst));
  EXPECT_LT(with.disagreement.after, 0.8 * without.disagreement.after);
  // What is only measured changes no colour.
  EXPECT_EQ(measured.scans[0].samples.rgb, without.scans[0].samples.rgb);
  double before = 0, after = 0;
  for (size_t i = 0; i < photos.size(); ++i) {
    EXPECT_TRUE(with.registration.photos[i].corrected);
    EXPECT_FALSE(measured.registration.photos[i].corrected);
    EXPECT_EQ(measured.registration.photos[i].shift_before_px,
              with.registration.photos[i].shift_before_px);
    before += with.registration.photos[i].shift_before_px;
    after += with.registration.photos[i].shift_after_px;
  }
  EXPECT_LT(after, 0.3 * before);
}

TEST_F(RegisterPhotosTest, OnePhotoAmongManyIsPutRight) {
  const double best = Psnr(Colorize(Photos(0, 0), "none"));
  std::vector<PhotoView> photos = Photos(0, 0);
  Eigen::Matrix<double, 6, 1> step = Eigen::Matrix<double, 6, 1>::Zero();
  step[1] = RadFromDeg(0.8);
  photos[4].cam_from_scan = Moved(photos[4].cam_from_scan, step);
  const ColorizeResult without = Colorize(photos, "none"), with = Colorize(photos, "pose");
  EXPECT_LT(Psnr(without), best - 0.5);
  EXPECT_GT(Psnr(with), best - 0.5 * (best - Psnr(without)));
  EXPECT_NEAR(with.registration.photos[4].turned_deg, 0.8, 0.2);
  EXPECT_GT(with.registration.photos[4].shift_before_px,
            3 * with.registration.photos[4].shift_after_px);
}

// Site and map grids have their origin far away.
TEST_F(RegisterPhotosTest, CamerasAreTurnedWhereTheyStand) {
  const auto registered = [](const Eigen::Vector3d& origin) {
    std::vector<PhotoView> photos = Photos(0, 0);
    for (size_t i = 0; i < photos.size(); ++i) {
      Eigen::Matrix<double, 6, 1> step = Eigen::Matrix<double, 6, 1>::Zero();
      step[i % 3] = RadFromDeg(i % 2 == 0 ? 0.2 : -0.2);
      photos[i].cam_from_scan = MovedInPlace(photos[i].cam_from_scan, step);
      photos[i].cam_from_scan.translation -= photos[i].cam_from_scan.rotation * origin;
    }
    Scan scan = room_->MakeScan();
    for (Eigen::Vector3d& x : scan.points) x += origin;
    scan.scan_from_station.translation += origin;
    Progress quiet(true);
    ColorizeOptions options;
    options.registration.mode = "pose";
    return ColorizeScans({scan}, photos, options, 2, &quiet).registration.photos;
  };
  const auto here = registered(Eigen::Vector3d::Zero());
  const auto there = registered({3000, -2000, 500});
  double turned = 0, moved = 0;
  for (size_t i = 0; i < here.size(); ++i) {
    EXPECT_NEAR(there[i].turned_deg, here[i].turned_deg, 0.02);
    EXPECT_NEAR(there[i].moved, here[i].moved, 1e-3);
    turned += here[i].turned_deg / static_cast<double>(here.size());
    moved += here[i].moved / static_cast<double>(here.size());
  }
  EXPECT_NEAR(turned, 0.2, 0.06);
  EXPECT_LT(moved, 5e-3);
}

TEST_F(RegisterPhotosTest, AWarpSaysWhatTheCameraDoesNot) {
  const double best = Psnr(Colorize(Photos(0, 0), "none"));
  std::vector<PhotoView> photos = Photos(0, 0);
  for (PhotoView& photo : photos) photo.camera.params[2] += 4;  // principal point
  EXPECT_LT(Psnr(Colorize(photos, "none")), best - 3);
  PhotoWarp warp(photos[0].camera.width, photos[0].camera.height, 40);
  for (int n = 0; n < warp.num_nodes(); ++n) warp.Shift(n) = {-4, 0};
  for (PhotoView& photo : photos) photo.warp = std::make_shared<const PhotoWarp>(warp);
  EXPECT_NEAR(Psnr(Colorize(photos, "none")), best, 0.2);
}

TEST_F(RegisterPhotosTest, ThreadsChangeNothing) {
  const std::vector<PhotoView> photos = Photos(0.2, 0.01);
  for (const char* mode : {"pose", "warp"}) {
    EXPECT_EQ(Colorize(photos, mode, 1).scans[0].samples.rgb,
              Colorize(photos, mode, 3).scans[0].samples.rgb)
        << mode;
  }
}

TEST_F(RegisterPhotosTest, OnePhotoOrNoneIsNoProblem) {
  std::vector<PhotoView> photos = Photos(0, 0);
  photos.resize(1);
  const ColorizeResult alone = Colorize(photos, "pose");
  ASSERT_EQ(alone.registration.photos.size(), 1u);
  EXPECT_FALSE(alone.registration.photos[0].corrected);
  EXPECT_EQ(alone.registration.photos[0].share_measured, 0);
  for (const double px : alone.registration.photos[0].map_px) EXPECT_TRUE(std::isnan(px));
}

}  // namespace
}  // namespace roomtex
