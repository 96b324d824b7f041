#include "texture/scan_surface.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/texture/two_walls.h"
#include "texture/mesh_tiles.h"

namespace roomtex {
namespace {

// Distance from the plane that a sample lies on, root mean square over those off the board's
// outline.
double PlaneRms(const std::vector<Eigen::Vector3d>& points,
                const std::vector<Eigen::Vector3d>& truth) {
  double sum = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    const double d = points[i].z() - truth[i].z();
    sum += d * d;
  }
  return std::sqrt(sum / static_cast<double>(points.size()));
}

TEST(ScanSurface, TakesMostOfTheRangeNoiseOut) {
  const TwoWalls scene;
  const Scan truth = scene.MakeScan(200, 200);
  Scan noisy = truth;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.003);
  for (Eigen::Vector3d& p : noisy.points) p += noise(random) * p.normalized();
  const ScanSurface surface = MakeScanSurface(noisy, {}, {}, 2);
  EXPECT_NEAR(surface.range_noise, 0.003, 0.0006);
  EXPECT_NEAR(surface.angular_spacing, 1.0 / 199, 1e-4);
  EXPECT_LT(PlaneRms(surface.points, truth.points), 0.35 * PlaneRms(noisy.points, truth.points));
  // Along the ray, and never far: depth edges stay sharp.
  for (size_t i = 0; i < truth.points.size(); ++i) {
    ASSERT_LT(surface.points[i].normalized().cross(noisy.points[i].normalized()).norm(), 1e-9);
    ASSERT_LT((surface.points[i] - noisy.points[i]).norm(), 6 * surface.range_noise);
  }
}

TEST(ScanSurface, LeavesAnExactScanWhereItIs) {
  const TwoWalls scene;
  const Scan scan = scene.MakeScan(150, 150);
  const ScanSurface surface = MakeScanSurface(scan, {}, {}, 1);
  for (size_t i = 0; i < scan.points.size(); ++i) {
    ASSERT_LT((surface.points[i] - scan.points[i]).norm(), 5e-4);
  }
}

TEST(ScanSurface, CanKeepTheMeasuredPoints) {
  Scan scan = TwoWalls().MakeScan(50, 50);
  ScanSurfaceOptions options;
  options.reduce_range_noise = false;
  const ScanSurface surface = MakeScanSurface(scan, {}, options, 1);
  for (size_t i = 0; i < scan.points.size(); ++i) ASSERT_EQ(surface.points[i], scan.points[i]);
}

TEST(GridLinks, EndAtDepthEdges) {
  const TwoWalls scene;
  const Scan scan = scene.MakeScan(100, 100);
  const GridLinks links = FindGridLinks(scan, BuildScanMesh(scan, {}));
  for (int row = 0; row < 100; ++row) {
    for (int column = 0; column < 100; ++column) {
      const int i = scan.Index(column, row);
      if (column < 99) {
        const bool jump = std::abs(scan.points[i].z() - scan.points[i + 1].z()) > 1;
        ASSERT_EQ((links.bits[i] & GridLinks::kRight) != 0, !jump) << column << " " << row;
      } else {
        ASSERT_EQ(links.bits[i] & GridLinks::kRight, 0);
      }
    }
  }
}

TEST(OccluderTiles, HoldEveryTriangleAndASampleTileEverySampleOnce) {
  const Scan scan = TwoWalls().MakeScan(130, 70);
  const ScanSurface surface = MakeScanSurface(scan, {}, {}, 1);
  const OccluderTiles tiles = MakeOccluderTiles(scan, surface);
  size_t triangles = 0;
  for (const MeshTile& tile : tiles.surface) {
    triangles += tile.triangles.size();
    for (int i = 0; i < tile.points.size(); ++i) {
      ASSERT_LE(std::hypot(tile.points.x[i], tile.points.y[i], tile.points.z[i]),
                tile.points.radius);
    }
  }
  EXPECT_EQ(triangles, surface.triangles.size());
  EXPECT_FALSE(tiles.shadows.empty());  // around the board
  std::vector<int> count(scan.points.size(), 0);
  int next_slot = 0;
  for (const SampleTile& tile :
       MakeSampleTiles(130, 70, surface.points, surface.normals, scan.Station())) {
    EXPECT_EQ(tile.first_slot, next_slot);
    next_slot += tile.points.size();
    for (int i : tile.index) ++count[i];
  }
  for (int c : count) ASSERT_EQ(c, 1);
}

}  // namespace
}  // namespace roomtex
