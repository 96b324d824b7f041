#include "core/row_motion.h"

#include <utility>

#include <gtest/gtest.h>

#include "core/frames.h"

namespace roomtex {
namespace {

RowMotion Hand() {
  RowMotion motion;
  motion.turn = RadFromDeg(1.0) * Eigen::Vector3d(0.5, -0.6, 0.4);
  motion.move = {0.008, -0.006, 0.004};
  return motion;
}

Camera Phone(bool upright) {
  Camera camera;
  camera.model = CameraModel::kOpenCv;
  camera.width = 1600;
  camera.height = 1200;
  camera.params = {1300, 1310, 800, 600, 0.05, -0.02, 0.001, -0.001};
  if (upright) {
    std::swap(camera.width, camera.height);
    std::swap(camera.params[2], camera.params[3]);
  }
  return camera;
}

class RowMotionTest : public testing::TestWithParam<bool> {};

// The row at which a point is shown is the one that saw it there, and stopped it is where the
// camera of the middle row has it.
TEST_P(RowMotionTest, ShowsPointsByTheRowThatSeesThem) {
  const CameraProjection projection(Phone(GetParam()));
  const RowMotion motion = Hand();
  double most_moved = 0;
  for (double x = -0.4; x <= 0.4; x += 0.1) {
    for (double y = -0.4; y <= 0.4; y += 0.1) {
      for (const double depth : {1.0, 4.0}) {
        const Eigen::Vector3d x_in_cam = depth * Eigen::Vector3d(x, y, 1);
        const auto shown = ImgFromMovingCam(projection, motion, x_in_cam);
        ASSERT_TRUE(shown);
        const double share = GetParam() ? shown->x() / 1200 - 0.5 : shown->y() / 1200 - 0.5;
        const Eigen::Vector3d seen = x_in_cam + share * (motion.turn.cross(x_in_cam) + motion.move);
        EXPECT_LT((*projection.ImgFromCam(seen) - *shown).norm(), 0.01);
        const Eigen::Vector2d still = *projection.ImgFromCam(x_in_cam);
        EXPECT_LT((KeypointOfStillRows(projection, motion, x_in_cam, *shown) - still).norm(), 0.01);
        most_moved = std::max(most_moved, (*shown - still).norm());
      }
    }
  }
  EXPECT_GT(most_moved, 8);
}

INSTANTIATE_TEST_SUITE_P(LyingAndUpright, RowMotionTest, testing::Bool());

TEST(RowMotion, CamerasThatStandStillShowWhatTheirModelSays) {
  const CameraProjection projection(Phone(false));
  const Eigen::Vector3d x_in_cam(0.3, -0.2, 2);
  EXPECT_EQ(ImgFromMovingCam(projection, RowMotion(), x_in_cam), projection.ImgFromCam(x_in_cam));
  EXPECT_FALSE(ImgFromMovingCam(projection, Hand(), {0, 0, -1}));
}

}  // namespace
}  // namespace roomtex
