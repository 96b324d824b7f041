#include "capture/simulation/camera_faults.h"

#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "capture/simulation/simulated_room.h"
#include "core/photo.h"
#include "tests/capture/simulation/small_room.h"

namespace roomtex {
namespace {

TEST(CameraFaults, ResponseCurvesRiseFromBlackToWhite) {
  for (const std::string& name : ResponseTable::Names()) {
    const ResponseTable table(name);
    EXPECT_NEAR(table.Grey(0), 0, 1e-4) << name;
    EXPECT_NEAR(table.Grey(1), 255, 1e-3) << name;
    EXPECT_NEAR(table.Grey(2), 255, 1e-3) << name;
    float before = -1;
    for (int i = 0; i <= 1000; ++i) {
      const float linear = static_cast<float>(i) / 1000;
      ASSERT_GT(table.Grey(linear), before) << name << " " << linear;
      before = table.Grey(linear);
      EXPECT_NEAR(before, 255 * ResponseTable::Encode(name, linear), 0.2) << name << " " << linear;
    }
  }
}

TEST(CameraFaults, VignettingLosesItsShareInTheCorner) {
  EXPECT_EQ(VignettingAt(0, 0.4), 1);
  EXPECT_NEAR(VignettingAt(1, 0.4), 0.6, 1e-12);
  EXPECT_EQ(VignettingAt(0.7, 0), 1);
}

// Mean sRGB-linear light of a square around a place, r, g, b.
Eigen::Vector3d MeanLight(const cv::Mat& photo, int x, int y) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int dy = 0; dy < 12; ++dy) {
    for (int dx = 0; dx < 12; ++dx) {
      const auto& bgr = photo.at<cv::Vec3b>(y + dy, x + dx);
      for (int k = 0; k < 3; ++k) sum[k] += LinearFromSrgbByte()[bgr[2 - k]] / 144;
    }
  }
  return sum;
}

TEST(CameraFaults, ShowInThePhotosAsTheTruthSays) {
  SimulatedRoomOptions options = SmallRoom();
  options.photo_noise = 0;
  options.exposure_range_ev = 0;
  const cv::Mat plain = SimulatedRoom(options).RenderPhoto(1);
  options.vignetting = 0.5;
  options.white_balance_ev = 0.3;
  const SimulatedRoom room(options);
  const cv::Mat faulty = room.RenderPhoto(1);
  const Eigen::Vector3d tint = room.WhiteBalance(1).cast<double>();
  EXPECT_GT((tint - Eigen::Vector3d::Ones()).norm(), 0.01);
  int num_compared = 0, num_corners = 0;
  for (const int x : {0, plain.cols / 2, plain.cols - 12}) {
    for (const int y : {0, plain.rows / 2, plain.rows - 12}) {
      const double dx = x + 6 - room.camera().params[2], dy = y + 6 - room.camera().params[3];
      const double radius2 =
          4 * (dx * dx + dy * dy) / (plain.cols * plain.cols + plain.rows * plain.rows);
      const Eigen::Vector3d light = MeanLight(plain, x, y);
      if (light.maxCoeff() > 0.6) continue;  // may be clipped
      ++num_compared;
      num_corners += x != plain.cols / 2 && y != plain.rows / 2;
      const Eigen::Vector3d wanted = VignettingAt(radius2, 0.5) * tint.cwiseProduct(light);
      EXPECT_LT((MeanLight(faulty, x, y) - wanted).cwiseAbs().maxCoeff(), 0.02) << x << " " << y;
    }
  }
  EXPECT_GE(num_compared, 5);  // measured: 6
  EXPECT_GE(num_corners, 2) << "where vignetting is strongest";
}

TEST(CameraFaults, WrongExifIsWrongWhereItSaysSo) {
  SimulatedRoomOptions options = SmallRoom();
  options.wrong_exif = "one";
  const SimulatedRoom one(options);
  options.wrong_exif = "all";
  const SimulatedRoom all(options);
  for (int photo = 0; photo < options.num_photos; ++photo) {
    const double share = one.NotedTime(photo) / one.ExposureTime(photo);
    EXPECT_NEAR(share, photo == options.num_photos / 2 ? 0.25 : 1, 1e-12);
    EXPECT_NEAR(all.NotedTime(photo), all.NotedTime(0), 1e-12);
  }
}

}  // namespace
}  // namespace roomtex
