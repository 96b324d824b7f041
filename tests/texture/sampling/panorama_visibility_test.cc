// Depth maps of panoramas.

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "texture/sampling/visibility.h"

namespace roomtex {
namespace {

// A closed box about the origin as twelve triangles: every one is much larger than a pixel, some
// hold a pole, some cross the seam.
MeshTile Box(const Eigen::Vector3d& half) {
  MeshTile tile;
  for (int k = 0; k < 8; ++k) {
    tile.points.Add(
        half.cwiseProduct(Eigen::Vector3d(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1)));
  }
  const uint16_t faces[6][4] = {{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}};
  for (const auto& f : faces) {
    tile.triangles.push_back({f[0], f[1], f[2]});
    tile.triangles.push_back({f[0], f[2], f[3]});
  }
  return tile;
}

PhotoView View(const Eigen::Quaterniond& rotation) {
  PhotoView view;
  view.camera = {1, CameraModel::kEquirectangular, 1024, 512, {1024, 512}};
  view.cam_from_scan = {rotation, rotation * -Eigen::Vector3d(0.3, -0.2, 0.25)};
  return view;
}

TEST(PanoramaDepthMap, HasNoHolesAndTheTrueDistanceEverywhere) {
  const Eigen::Vector3d half(2, 1.3, 1.6);
  for (const double tilt : {0.0, 0.1, 0.9}) {
    const PhotoView view = View(
        Eigen::Quaterniond(Eigen::AngleAxisd(tilt, Eigen::Vector3d(1, 0.3, -0.2).normalized())));
    const PhotoProjector projector(view);
    DepthMap map(1024, 512, 1, true);
    map.Draw(projector, {Box(half)});
    int num_holes = 0;
    double worst = 0;
    for (int y = 0; y < 512; ++y) {
      for (int x = 0; x < 1024; ++x) {
        const float w = map.inverse_depth()(y, x);
        num_holes += w == 0;
        const Eigen::Vector3d ray = *projector.camera().RayFromImg({x + 0.5, y + 0.5});
        const Eigen::Vector3d direction = view.cam_from_scan.rotation.conjugate() * ray;
        double distance = 1e9;
        for (int k = 0; k < 3; ++k) {
          const double wall = direction[k] > 0 ? half[k] : -half[k];
          distance = std::min(distance, (wall - view.Centre()[k]) / direction[k]);
        }
        worst = std::max(worst, std::abs(w * distance - 1));
      }
    }
    EXPECT_EQ(num_holes, 0) << tilt;
    EXPECT_LT(worst, 0.012) << tilt;
  }
}

TEST(PanoramaVisibility, TheSeamIsNoDepthBoundary) {
  const PhotoView view = View(Eigen::Quaterniond::Identity());
  const PhotoProjector projector(view);
  OccluderTiles tiles;
  tiles.surface = {Box({2, 1.3, 1.6})};
  OcclusionOptions options;
  const PhotoVisibility visibility(projector, {tiles}, 0, options);
  for (int y = 180; y < 340; y += 4) {  // between the edges of floor and ceiling
    EXPECT_EQ(visibility.boundary_mask()(y, 0), 0) << y;
    EXPECT_EQ(visibility.boundary_mask()(y, visibility.boundary_mask().cols - 1), 0) << y;
  }
  // What lies behind the wall is hidden, in all directions.
  for (const float x : {0.2f, 256.f, 512.f, 1023.9f}) {
    EXPECT_EQ(visibility.Look(x, 256, 3.5f), Sight::kHidden) << x;
    EXPECT_NE(visibility.Look(x, 256, 1.0f), Sight::kHidden) << x;
  }
}

// Triangles all over the room, as a broken mesh has them: each alone would be split thousands of
// times.
TEST(PanoramaDepthMap, SplitsAreBoundedByTheMapAndTheNumberOfTriangles) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> anywhere(-3, 3);
  MeshTile tile;
  constexpr uint16_t kNumTriangles = 3000;
  for (uint16_t k = 0; k < kNumTriangles; ++k) {
    for (int corner = 0; corner < 3; ++corner) {
      tile.points.Add({anywhere(generator), anywhere(generator), anywhere(generator)});
    }
    const auto first = static_cast<uint16_t>(3 * k);
    tile.triangles.push_back(
        {first, static_cast<uint16_t>(first + 1), static_cast<uint16_t>(first + 2)});
  }
  const PhotoProjector projector(View(Eigen::Quaterniond::Identity()));
  DepthMap map(1024, 512, 0.25, true);
  EXPECT_LE(map.Draw(projector, {tile}), 256 * 128 + 8 * kNumTriangles + 1);
  // Those of a whole room are far from the bound.
  DepthMap room(1024, 512, 1, true);
  EXPECT_LT(room.Draw(projector, {Box({2, 1.3, 1.6})}), 1024 * 512 / 10);
}

}  // namespace
}  // namespace roomtex
