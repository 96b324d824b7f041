// The measured motion of the camera against the true one.

#include <cmath>

#include <gtest/gtest.h>

#include "capture/association/associated_views_photo.h"
#include "capture/association/associated_views_shift.h"
#include "tests/capture/association/associate_scene.h"

namespace roomtex {
namespace {

cv::Mat1b Grey(const cv::Mat& photo) {
  cv::Mat1b grey;
  cv::cvtColor(photo, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

// Other places than those of FurnishedScene(), with edges all over.
const AssociateScene& TwoPlaces() {
  static const AssociateScene scene(2);
  return scene;
}

struct Motion {
  double x, y;
};
constexpr Motion kMotions[] = {{0, 0},        {0.1, 0},   {0.3, 0},    {0.35, -0.35},
                               {-0.55, 0.58}, {0.8, 0.0}, {2.4, -1.7}, {14.3, 9.6}};

// Largest error of the offset over the motions, each at one of two places.
double WorstError(const AssociateScene& scene) {
  const cv::Mat1b plain_photos[] = {Grey(scene.TakePhoto(0, Take())),
                                    Grey(scene.TakePhoto(1, Take()))};
  double worst = 0;
  int place = 0;
  for (const Motion& motion : kMotions) {
    place = 1 - place;
    const cv::Mat1b& plain = plain_photos[place];
    Take take;
    take.patterned = true;
    take.shift_x = motion.x;
    take.shift_y = motion.y;
    take.ev = -0.7;
    take.seed = 9;
    const cv::Mat1b patterned = Grey(scene.TakePhoto(place, take));
    const CoarseShift coarse = FindCoarseShift(MakeEdgeThumb(plain), MakeEdgeThumb(patterned), 24);
    const double scale = plain.cols / 384.0;
    EXPECT_LT(std::hypot(scale * coarse.shift.x() - motion.x, scale * coarse.shift.y() - motion.y),
              2.5);
    const CameraShift found = FindCameraShift(plain, patterned, scale * coarse.shift);
    EXPECT_TRUE(found.found);
    EXPECT_GT(found.error_px, 0);
    const double error = std::hypot(found.shift.x() - motion.x, found.shift.y() - motion.y);
    EXPECT_LT(error, 5 * found.error_px + 0.02) << motion.x << " " << motion.y;
    worst = std::max(worst, error);
  }
  return worst;
}

TEST(CameraShift, IsMeasuredToATwentiethOfAPixelInAFurnishedRoom) {
  EXPECT_LT(WorstError(TwoPlaces()), 0.05);
}

TEST(CameraShift, IsMeasuredInAnEmptyRoomWithItsError) {
  const AssociateScene scene(2, false);
  // A floor line and a corner in a photo of a third of a megapixel: what is known is little, and
  // known to be little (the check in WorstError).
  EXPECT_LT(WorstError(scene), 0.5);
}

TEST(CameraShift, SeesARollOfTheCamera) {
  const AssociateScene& scene = TwoPlaces();
  // At the corners, half a diagonal of 432.7 pixels away.
  const double roll_px = RadFromDeg(0.25) * 432.7, offset_px = roll_px / std::sqrt(3);
  for (int place = 0; place < 2; ++place) {
    const cv::Mat1b plain = Grey(scene.TakePhoto(place, Take()));
    Take take;
    take.roll_deg = 0.25;
    take.ev = -0.7;
    take.seed = 4;
    const CameraShift same_light =
        FindCameraShift(plain, Grey(scene.TakePhoto(place, take)), {0, 0});
    EXPECT_NEAR(same_light.roll_px, roll_px, 0.05);
    EXPECT_NEAR(same_light.offset_px, offset_px, 0.03);
    take.patterned = true;
    const CameraShift found = FindCameraShift(plain, Grey(scene.TakePhoto(place, take)), {0, 0});
    EXPECT_NEAR(found.roll_px, roll_px, 0.25);
    EXPECT_NEAR(found.offset_px, offset_px, 0.15);
    EXPECT_NEAR(found.offset_px, offset_px, 3 * found.error_px);
  }
}

TEST(CameraShift, IsNotFoundWithoutEdges) {
  const cv::Mat1b plain(400, 600, uchar{120});
  cv::Mat1b noise(400, 600);
  cv::randu(noise, 60, 200);
  EXPECT_FALSE(FindCameraShift(plain, noise, {0, 0}).found);
}

std::vector<Eigen::Vector2d> RandomPoints(int count, uint64_t seed) {
  RandomStream random(seed);
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < count; ++i) {
    points.emplace_back(random.Uniform(0, 1500), random.Uniform(0, 1000));
  }
  return points;
}

TEST(KeypointShift, IsFoundAmongKeypointsOfThePattern) {
  const std::vector<Eigen::Vector2d> plain = RandomPoints(400, 1);
  std::vector<Eigen::Vector2d> patterned = RandomPoints(8000, 2);
  RandomStream random(3);
  for (int i = 0; i < 250; ++i) {
    patterned.push_back(
        plain[i] + Eigen::Vector2d(1.3 + 0.2 * random.Gaussian(), -0.4 + 0.2 * random.Gaussian()));
  }
  const auto shift = FindKeypointShift(plain, patterned, {0, 0});
  ASSERT_TRUE(shift.has_value());
  EXPECT_NEAR(shift->shift.x(), 1.3, 0.06);
  EXPECT_NEAR(shift->shift.y(), -0.4, 0.06);
  EXPECT_NEAR(shift->num_common, 250, 30);
  EXPECT_LT(shift->error_px, 0.1);
}

TEST(KeypointShift, IsNotFoundWhereOnlyChanceBringsThemTogether) {
  EXPECT_FALSE(FindKeypointShift(RandomPoints(400, 1), RandomPoints(8000, 2), {0, 0}).has_value());
  EXPECT_FALSE(FindKeypointShift({}, RandomPoints(10, 2), {0, 0}).has_value());
  EXPECT_FALSE(FindKeypointShift(RandomPoints(5, 1), RandomPoints(5, 1), {0, 0}).has_value());
}

}  // namespace
}  // namespace roomtex
