#include "texture/sampling/looked_past.h"

#include <vector>

#include <gtest/gtest.h>

#include "tests/texture/sampling/two_walls.h"
#include "texture/sampling/visibility.h"

namespace roomtex {
namespace {

constexpr int kSamples = 240;  // along a row and a column, over one radian
constexpr double kSpacing = 1.0 / (kSamples - 1);

TEST(LookedPast, KnowsWhatIsFree) {
  const TwoWalls scene;
  const Scan scan = scene.MakeScan(kSamples, kSamples, 0.5, {1.5, 0, 0});
  const LookedPast looked_past(scan, kSpacing, 0);
  EXPECT_TRUE(looked_past({0.3, 0, -2.5}));  // behind the board of who stands in the middle
  EXPECT_FALSE(looked_past({0, 0, -2.2}));   // behind it from here
  EXPECT_FALSE(looked_past({0, 0, -2}));     // on it
  EXPECT_TRUE(looked_past({0.9, 0, -3.9}));
  EXPECT_FALSE(looked_past({0.9, 0, -4}));  // on the wall
  EXPECT_FALSE(looked_past({0.9, 0, -4.1}));
  EXPECT_FALSE(looked_past({1.5, 3, -2}));  // where it did not look
  EXPECT_FALSE(looked_past({1.5, 0, 2}));
  // The noise of the range counts.
  EXPECT_FALSE(LookedPast(scan, kSpacing, 0.05)({0.9, 0, -3.9}));
}

// In the middle and beside it, and a photo between them.
class TwoStations : public ::testing::Test {
 protected:
  struct Counts {
    int visible = 0, in_shadow = 0, wrong = 0;
  };

  // How the photo sees what the second station has of the wall to the right of the board.
  Counts Look(const std::vector<OccluderTiles>& occluders) const {
    const PhotoView view = scene_.View({0.6, 0.1, 0.2}, "a");
    const PhotoProjector projector(view);
    const PhotoVisibility visibility(projector, occluders, kSpacing, {});
    const CameraProjection exact(view.camera);
    Counts counts;
    for (const Eigen::Vector3d& point : scans_[1].points) {
      const Eigen::Vector3d in_cam = view.cam_from_scan * point;
      const auto at = exact.ImgFromCam(in_cam);
      if (point.x() < 0.3 || !at || !exact.InImage(*at)) continue;
      const bool is_visible =
          (scene_.Hit(view.Centre(), point - view.Centre()) - point).norm() < 1e-6;
      const Sight sight = visibility.Look(static_cast<float>(at->x()), static_cast<float>(at->y()),
                                          static_cast<float>(in_cam.z()));
      counts.visible += is_visible;
      counts.in_shadow += is_visible && sight == Sight::kShadow;
      counts.wrong += !is_visible && sight == Sight::kClear;
    }
    return counts;
  }

  std::vector<OccluderTiles> Occluders(ShadowsOfStations* shadows) const {
    std::vector<OccluderTiles> occluders;
    for (const Scan& scan : scans_) {
      const SmoothedScan surface = MakeSmoothedScan(scan, {}, {}, 1);
      occluders.push_back(MakeOccluderTiles(scan, surface));
      if (shadows != nullptr) shadows->Take(scan, kSpacing, 0, &occluders.back());
    }
    return occluders;
  }

  const TwoWalls scene_;
  const std::vector<Scan> scans_ = {scene_.MakeScan(kSamples, kSamples),
                                    scene_.MakeScan(kSamples, kSamples, 0.5, {1.2, 0, 0})};
};

TEST_F(TwoStations, WhatTheOtherOneLookedPastIsNoShadow) {
  const Counts each_alone = Look(Occluders(nullptr));
  EXPECT_GT(each_alone.visible, 5000);
  EXPECT_GT(each_alone.in_shadow, 500);

  ShadowsOfStations shadows;
  std::vector<OccluderTiles> occluders = Occluders(&shadows);
  for (const OccluderTiles& tiles : occluders) EXPECT_TRUE(tiles.shadows.empty());
  shadows.Give(&occluders.back(), 2);
  const Counts together = Look(occluders);
  EXPECT_EQ(together.visible, each_alone.visible);
  // Beside the edge of the board it is not sure to have looked.
  EXPECT_LE(together.in_shadow, each_alone.in_shadow / 50);
  EXPECT_EQ(together.wrong, 0);
  // What lies behind the board for both is a shadow still.
  EXPECT_FALSE(occluders.back().shadows.empty());
}

TEST_F(TwoStations, OneAloneKeepsItsShadowsAsTheyAre) {
  const SmoothedScan surface = MakeSmoothedScan(scans_[0], {}, {}, 1);
  OccluderTiles tiles = MakeOccluderTiles(scans_[0], surface);
  const size_t num_tiles = tiles.shadows.size();
  ASSERT_GT(num_tiles, 0u);
  const std::vector<float> x = tiles.shadows[0].points.x;
  ShadowsOfStations shadows;
  shadows.Take(scans_[0], kSpacing, 0, &tiles);
  shadows.Give(&tiles, 2);
  ASSERT_EQ(tiles.shadows.size(), num_tiles);
  EXPECT_EQ(tiles.shadows[0].points.x, x);
}

}  // namespace
}  // namespace roomtex
