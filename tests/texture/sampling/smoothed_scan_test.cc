#include "texture/sampling/smoothed_scan.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/texture/sampling/two_walls.h"
#include "texture/sampling/mesh_tiles.h"

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

TEST(SmoothedScan, TakesMostOfTheRangeNoiseOut) {
  const TwoWalls scene;
  const Scan truth = scene.MakeScan(200, 200);
  Scan noisy = truth;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.003);
  for (Eigen::Vector3d& p : noisy.points) p += noise(random) * p.normalized();
  const SmoothedScan surface = MakeSmoothedScan(noisy, {}, {}, 2);
  EXPECT_NEAR(surface.range_noise, 0.003, 0.0006);
  EXPECT_NEAR(surface.angular_spacing, 1.0 / 199, 1e-4);
  EXPECT_LT(PlaneRms(surface.points, truth.points), 0.35 * PlaneRms(noisy.points, truth.points));
  // Along the ray, and never far: depth edges stay sharp.
  for (size_t i = 0; i < truth.points.size(); ++i) {
    ASSERT_LT(surface.points[i].normalized().cross(noisy.points[i].normalized()).norm(), 1e-9);
    ASSERT_LT((surface.points[i] - noisy.points[i]).norm(), 6 * surface.range_noise);
  }
}

TEST(SmoothedScan, LeavesAnExactScanWhereItIs) {
  const TwoWalls scene;
  const Scan scan = scene.MakeScan(150, 150);
  const SmoothedScan surface = MakeSmoothedScan(scan, {}, {}, 1);
  for (size_t i = 0; i < scan.points.size(); ++i) {
    ASSERT_LT((surface.points[i] - scan.points[i]).norm(), 5e-4);
  }
}

TEST(SmoothedScan, CanKeepTheMeasuredPoints) {
  Scan scan = TwoWalls().MakeScan(50, 50);
  SmoothedScanOptions options;
  options.reduce_range_noise = false;
  const SmoothedScan surface = MakeSmoothedScan(scan, {}, options, 1);
  for (size_t i = 0; i < scan.points.size(); ++i) ASSERT_EQ(surface.points[i], scan.points[i]);
}

TEST(SmoothedScan, KeepsACornerSharpInSpiteOfNoise) {
  // Two walls that meet in a vertical edge, seen from inside.
  Scan scan;
  scan.num_columns = scan.num_rows = 160;
  const auto truth = [](const Eigen::Vector3d& d) -> Eigen::Vector3d {
    const double left = 3 / (-d.z() - d.x()), right = 3 / (-d.z() + d.x());
    return d * std::min(left > 0 ? left : 1e9, right > 0 ? right : 1e9);
  };
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0, 0.002);
  std::vector<Eigen::Vector3d> exact;
  for (int r = 0; r < 160; ++r) {
    for (int c = 0; c < 160; ++c) {
      const double azimuth = 0.003 * (c - 80), elevation = 0.003 * (80 - r);
      const Eigen::Vector3d d(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                              -std::cos(azimuth) * std::cos(elevation));
      exact.push_back(truth(d));
      scan.points.push_back(exact.back() + noise(random) * d);
      scan.intensity.push_back(1);
    }
  }
  const SmoothedScan surface = MakeSmoothedScan(scan, {}, {}, 1);
  double all = 0, at_corner = 0;
  int num_at_corner = 0;
  for (int r = 0; r < 160; ++r) {
    for (int c = 0; c < 160; ++c) {
      const double error = (surface.points[scan.Index(c, r)] - exact[scan.Index(c, r)]).norm();
      all += error * error / (160 * 160);
      if (std::abs(c - 80) > 4) continue;
      at_corner += error * error;
      ++num_at_corner;
    }
  }
  EXPECT_LT(std::sqrt(all), 0.0006);
  EXPECT_LT(std::sqrt(at_corner / num_at_corner), 0.0012);
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
  const SmoothedScan surface = MakeSmoothedScan(scan, {}, {}, 1);
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

TEST(OccluderTiles, FringesReachOneSpacingBeyondTheLastSample) {
  const TwoWalls scene;
  Scan scan = scene.MakeScan(130, 130);
  const auto reach = [&scan]() {  // of the fringes at the board's range
    const SmoothedScan surface = MakeSmoothedScan(scan, {}, {}, 1);
    double x = 0, y = 0;
    for (const MeshTile& tile : MakeOccluderTiles(scan, surface).fringes) {
      for (int i = 0; i < tile.points.size(); ++i) {
        const Eigen::Vector3d p =
            tile.points.origin +
            Eigen::Vector3d(tile.points.x[i], tile.points.y[i], tile.points.z[i]);
        EXPECT_GT(p.z(), -2.5);
        x = std::max(x, p.x());
        y = std::max(y, p.y());
      }
    }
    return Eigen::Vector2d(x, y);
  };
  double last = 0;
  for (const Eigen::Vector3d& p : scan.points) {
    if (p.z() > -3) last = std::max(last, p.x());
  }
  const double spacing = 2 * 1.0 / 129;
  EXPECT_GT(reach().x(), scene.board_half - 0.1 * spacing);
  EXPECT_NEAR(reach().x(), last + spacing, 0.3 * spacing);
  EXPECT_GT(reach().y(), scene.board_half - 0.1 * spacing);
  // The same when nothing was measured behind.
  for (Eigen::Vector3d& p : scan.points) {
    if (p.z() < -3) p = Scan::MissingPoint();
  }
  EXPECT_NEAR(reach().x(), last + spacing, 0.3 * spacing);
}

}  // namespace
}  // namespace roomtex
