#include "core/scan_mesh.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <random>
#include <set>

#include <gmock/gmock.h>

#include "core/frames.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

// Range along a unit direction; 0 = nothing there.
using RangeFunction = std::function<double(const Eigen::Vector3d& direction)>;

struct GridOptions {
  double first_azimuth_deg = -60, last_azimuth_deg = 60;
  double first_elevation_deg = 40, last_elevation_deg = -40;  // top row first
  double step_deg = 0.25;
  double range_noise = 0;  // standard deviation, metres
  Eigen::Vector3d station = Eigen::Vector3d::Zero();
};

// A scan as the thesis describes it: a grid in azimuth and elevation around the station, azimuth 0
// along -z, y up.
Scan MakeScan(const RangeFunction& range_of, const GridOptions& options = {}) {
  Scan scan;
  scan.num_columns =
      static_cast<int>(
          std::lround((options.last_azimuth_deg - options.first_azimuth_deg) / options.step_deg)) +
      1;
  scan.num_rows =
      static_cast<int>(std::lround((options.first_elevation_deg - options.last_elevation_deg) /
                                   options.step_deg)) +
      1;
  scan.scan_from_station.translation = options.station;
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 1);
  for (int row = 0; row < scan.num_rows; ++row) {
    const double elevation = RadFromDeg(options.first_elevation_deg - row * options.step_deg);
    for (int column = 0; column < scan.num_columns; ++column) {
      const double azimuth = RadFromDeg(options.first_azimuth_deg + column * options.step_deg);
      const Eigen::Vector3d direction(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                                      -std::cos(azimuth) * std::cos(elevation));
      double range = range_of(direction);
      if (range > 0) range += options.range_noise * noise(random);
      scan.points.push_back(range > 0 ? Eigen::Vector3d(options.station + range * direction)
                                      : Scan::MissingPoint());
      scan.intensity.push_back(range > 0 ? 100.0f : 0.0f);
    }
  }
  return scan;
}

// Range to the plane n.x = d.
double RangeToPlane(const Eigen::Vector3d& direction, const Eigen::Vector3d& normal, double d) {
  const double cosine = normal.dot(direction);
  return cosine > 1e-9 ? d / cosine : 0;
}

// Range to the inside of a box around the station.
RangeFunction RoomOf(const Eigen::Vector3d& half_size) {
  return [half_size](const Eigen::Vector3d& direction) {
    double range = 1e9;
    for (int k = 0; k < 3; ++k) {
      if (direction[k] != 0) range = std::min(range, half_size[k] / std::abs(direction[k]));
    }
    return range;
  };
}

int NumQuads(const Scan& scan) { return (scan.num_columns - 1) * (scan.num_rows - 1); }

// Every edge is used at most twice, and in opposite directions: an oriented surface.
void ExpectOrientedSurface(const std::vector<Triangle>& triangles) {
  std::set<std::pair<int, int>> edges;
  for (const Triangle& t : triangles) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_TRUE(edges.emplace(t[k], t[(k + 1) % 3]).second) << "edge twice in one direction";
    }
  }
}

void ExpectFacesTheScanner(const Scan& scan, const std::vector<Triangle>& triangles) {
  for (const Triangle& t : triangles) {
    const Eigen::Vector3d& a = scan.points[t[0]];
    const Eigen::Vector3d normal = (scan.points[t[1]] - a).cross(scan.points[t[2]] - a);
    ASSERT_GT(normal.dot(scan.Station() - a), 0);
  }
}

// Share of the quads that have both triangles, among those whose columns lie in [first, last].
double ConnectedShare(const Scan& scan, const std::vector<Triangle>& triangles) {
  return triangles.size() / (2.0 * NumQuads(scan));
}

TEST(ScanMesh, FacingWallIsWhole) {
  const Scan scan = MakeScan(
      [](const Eigen::Vector3d& d) { return RangeToPlane(d, -Eigen::Vector3d::UnitZ(), 3); });
  const std::vector<Triangle> triangles = BuildScanMesh(scan, {});
  EXPECT_EQ(static_cast<int>(triangles.size()), 2 * NumQuads(scan));
  ExpectOrientedSurface(triangles);
  ExpectFacesTheScanner(scan, triangles);
}

// A wall beside the scanner, seen at up to 80 degrees from its normal, in the density of 3 million
// samples (0.15 degrees) and coarsely, with and without noise.
struct GrazingCase {
  double step_deg, range_noise, distance;
};
class GrazingWall : public testing::TestWithParam<GrazingCase> {};
INSTANTIATE_TEST_SUITE_P(
    All, GrazingWall,
    testing::Values(GrazingCase{0.15, 0, 1.5}, GrazingCase{0.25, 0, 1.5}, GrazingCase{1.0, 0, 1.5},
                    GrazingCase{0.15, 0.002, 3}, GrazingCase{0.15, 0.002, 1.5},
                    GrazingCase{0.15, 0.002, 0.8}, GrazingCase{0.25, 0.002, 1.5},
                    GrazingCase{0.25, 0.002, 0.8}, GrazingCase{0.25, 0.005, 2}),
    [](const auto& c) {
      return "Step" + std::to_string(static_cast<int>(std::lround(100 * c.param.step_deg))) +
             "Noise" + std::to_string(static_cast<int>(std::lround(1000 * c.param.range_noise))) +
             "Distance" + std::to_string(static_cast<int>(std::lround(10 * c.param.distance)));
    });

TEST_P(GrazingWall, StaysConnected) {
  GridOptions options;
  options.step_deg = GetParam().step_deg;
  options.range_noise = GetParam().range_noise;
  // Normal along +x; azimuth 10 degrees is 80 degrees from it.
  options.first_azimuth_deg = 10;
  options.last_azimuth_deg = 90;
  options.first_elevation_deg = 15;
  options.last_elevation_deg = -15;
  const Scan scan = MakeScan(
      [](const Eigen::Vector3d& d) {
        return RangeToPlane(d, Eigen::Vector3d::UnitX(), GetParam().distance);
      },
      options);
  const std::vector<Triangle> triangles = BuildScanMesh(scan, {});
  ExpectOrientedSurface(triangles);
  ExpectFacesTheScanner(scan, triangles);
  EXPECT_GE(ConnectedShare(scan, triangles), GetParam().range_noise > 0 ? 0.998 : 1.0);
  EXPECT_LE(ConnectedShare(scan, triangles), 1.0);
}

// A box 0.4 m in front of a wall must not be connected to it, at any density and with noise.
class BoxInFrontOfWall : public testing::TestWithParam<GrazingCase> {};
INSTANTIATE_TEST_SUITE_P(
    All, BoxInFrontOfWall,
    testing::Values(GrazingCase{0.15, 0, 3}, GrazingCase{0.25, 0, 3}, GrazingCase{0.15, 0.002, 3},
                    GrazingCase{0.25, 0.002, 3}, GrazingCase{0.25, 0.002, 1.5},
                    GrazingCase{0.25, 0.005, 5}),
    [](const auto& c) {
      return "Step" + std::to_string(static_cast<int>(std::lround(100 * c.param.step_deg))) +
             "Noise" + std::to_string(static_cast<int>(std::lround(1000 * c.param.range_noise))) +
             "Distance" + std::to_string(static_cast<int>(std::lround(10 * c.param.distance)));
    });

TEST_P(BoxInFrontOfWall, IsNotConnectedToIt) {
  GridOptions options;
  options.step_deg = GetParam().step_deg;
  options.range_noise = GetParam().range_noise;
  const double wall = GetParam().distance, front = wall - 0.4;
  const auto on_box = [&](const Eigen::Vector3d& d) {
    const double range = RangeToPlane(d, -Eigen::Vector3d::UnitZ(), front);
    const Eigen::Vector3d x = range * d;
    return range > 0 && std::abs(x.x()) < 0.3 && std::abs(x.y()) < 0.25;
  };
  const Scan scan = MakeScan(
      [&](const Eigen::Vector3d& d) {
        return RangeToPlane(d, -Eigen::Vector3d::UnitZ(), on_box(d) ? front : wall);
      },
      options);
  const std::vector<Triangle> triangles = BuildScanMesh(scan, {});
  ASSERT_FALSE(triangles.empty());
  int num_across = 0;
  for (const Triangle& t : triangles) {
    double nearest = 1e9, farthest = 0;
    for (int corner : t) {
      nearest = std::min(nearest, -scan.points[corner].z());
      farthest = std::max(farthest, -scan.points[corner].z());
    }
    if (farthest - nearest > 0.3) ++num_across;
  }
  EXPECT_EQ(num_across, 0);
  // Apart from the rim of the box everything is there.
  EXPECT_GT(ConnectedShare(scan, triangles), 0.97);
  ExpectOrientedSurface(triangles);
}

TEST(ScanMesh, ThinStepOnAWallIsCut) {
  // A door frame 10 cm in front of the wall, both seen straight, without and with noise.
  for (const double noise : {0.0, 0.001}) {
    GridOptions options;
    options.range_noise = noise;
    options.first_azimuth_deg = -20;
    options.last_azimuth_deg = 20;
    options.first_elevation_deg = 10;
    options.last_elevation_deg = -10;
    const Scan scan = MakeScan(
        [](const Eigen::Vector3d& d) {
          return RangeToPlane(d, -Eigen::Vector3d::UnitZ(), d.x() < 0 ? 2.0 : 2.1);
        },
        options);
    for (const Triangle& t : BuildScanMesh(scan, {})) {
      for (int corner : t) {
        EXPECT_EQ(scan.points[corner].x() < 0, scan.points[t[0]].x() < 0);
      }
    }
  }
}

TEST(ScanMesh, InnerCornersOfARoomStayClosedWithNoise) {
  for (const double noise : {0.0, 0.002}) {
    GridOptions options;
    options.range_noise = noise;
    options.first_azimuth_deg = -180;
    options.last_azimuth_deg = 179.75;
    options.first_elevation_deg = 80;
    options.last_elevation_deg = -60;
    const Scan scan = MakeScan(RoomOf({2.5, 1.4, 2}), options);
    const std::vector<Triangle> triangles = BuildScanMesh(scan, {});
    const double num_quads = scan.num_columns * (scan.num_rows - 1.0);
    EXPECT_GE(triangles.size() / (2 * num_quads), noise > 0 ? 0.999 : 1.0) << noise;
    ExpectOrientedSurface(triangles);
    ExpectFacesTheScanner(scan, triangles);
  }
}

TEST(ScanMesh, ZenithAndNadirAreClosedWithNoise) {
  GridOptions options;
  options.range_noise = 0.002;
  options.first_azimuth_deg = -180;
  options.last_azimuth_deg = 179;
  options.first_elevation_deg = 89;
  options.last_elevation_deg = 60;
  options.step_deg = 1;
  const Scan scan = MakeScan(RoomOf({2.5, 1.4, 2}), options);
  const std::vector<Triangle> triangles = BuildScanMesh(scan, {});
  EXPECT_GE(triangles.size() / (2.0 * scan.num_columns * (scan.num_rows - 1)), 0.999);
}

TEST(ScanMesh, FullTurnIsClosedAndPartOfATurnIsNot) {
  GridOptions options;
  options.step_deg = 1;
  options.first_azimuth_deg = -180;
  options.last_azimuth_deg = 179;
  const Scan full = MakeScan(RoomOf({2.5, 1.4, 2}), options);
  EXPECT_EQ(static_cast<int>(BuildScanMesh(full, {}).size()),
            2 * full.num_columns * (full.num_rows - 1));
  options.last_azimuth_deg = 170;
  const Scan part = MakeScan(RoomOf({2.5, 1.4, 2}), options);
  EXPECT_EQ(static_cast<int>(BuildScanMesh(part, {}).size()), 2 * NumQuads(part));
  // The last column repeats the first direction: closed already, no slivers in between.
  options.last_azimuth_deg = 180;
  const Scan repeated = MakeScan(RoomOf({2.5, 1.4, 2}), options);
  EXPECT_EQ(static_cast<int>(BuildScanMesh(repeated, {}).size()), 2 * NumQuads(repeated));
}

TEST(ScanMesh, CornersOnEitherSideOfAMissingSampleStay) {
  Scan scan = MakeScan(
      [](const Eigen::Vector3d& d) { return RangeToPlane(d, -Eigen::Vector3d::UnitZ(), 3); });
  const size_t whole = BuildScanMesh(scan, {}).size();
  const int missing = scan.Index(100, 50);
  scan.points[missing] = Scan::MissingPoint();
  const std::vector<Triangle> triangles = BuildScanMesh(scan, {});
  for (const Triangle& t : triangles) {
    for (int corner : t) EXPECT_NE(corner, missing);
  }
  // Each of the four quads around it keeps the triangle of its other three corners.
  EXPECT_EQ(triangles.size(), whole - 4);
  ExpectOrientedSurface(triangles);
}

TEST(ScanMesh, ManyMissingSamplesLeaveAnOrientedSurface) {
  Scan scan = MakeScan(RoomOf({2.5, 1.4, 2}));
  std::mt19937 random(3);
  for (Eigen::Vector3d& point : scan.points) {
    if (random() % 4 == 0) point = Scan::MissingPoint();
  }
  const std::vector<Triangle> triangles = BuildScanMesh(scan, {});
  EXPECT_GT(triangles.size(), static_cast<size_t>(NumQuads(scan)) / 2);
  ExpectOrientedSurface(triangles);
  ExpectFacesTheScanner(scan, triangles);
}

TEST(ScanMesh, FacesTheScannerWhereverItStands) {
  GridOptions options;
  options.step_deg = 1;
  options.station = {4.5e5, 12, 5.4e6};  // georeferenced
  Scan scan = MakeScan(RoomOf({2.5, 1.4, 2}), options);
  const std::vector<Triangle> triangles = BuildScanMesh(scan, {});
  EXPECT_EQ(static_cast<int>(triangles.size()), 2 * NumQuads(scan));
  ExpectFacesTheScanner(scan, triangles);
}

TEST(ScanMesh, MirroredColumnOrderFacesTheScannerToo) {
  GridOptions options;
  options.step_deg = 1;
  Scan scan = MakeScan(RoomOf({2.5, 1.4, 2}), options);
  for (int row = 0; row < scan.num_rows; ++row) {
    std::reverse(scan.points.begin() + scan.Index(0, row),
                 scan.points.begin() + scan.Index(0, row) + scan.num_columns);
  }
  const std::vector<Triangle> triangles = BuildScanMesh(scan, {});
  ExpectFacesTheScanner(scan, triangles);
  ExpectOrientedSurface(triangles);
}

TEST(ScanMesh, DoesNotDependOnTheUnitOfLength) {
  GridOptions options;
  options.range_noise = 0.002;
  Scan scan = MakeScan(RoomOf({2.5, 1.4, 2}), options);
  const std::vector<Triangle> in_metres = BuildScanMesh(scan, {});
  for (Eigen::Vector3d& point : scan.points) point *= 1024;
  EXPECT_EQ(BuildScanMesh(scan, {}), in_metres);
}

TEST(ScanMesh, TinyAndEmptyGridsAreNoTrouble) {
  for (const auto& [columns, rows] :
       {std::pair(0, 0), std::pair(1, 5), std::pair(5, 1), std::pair(2, 2)}) {
    Scan scan;
    scan.num_columns = columns;
    scan.num_rows = rows;
    for (int i = 0; i < columns * rows; ++i) {
      scan.points.emplace_back(i % std::max(columns, 1) * 0.01, -(i / std::max(columns, 1)) * 0.01,
                               -1);
      scan.intensity.push_back(0);
    }
    EXPECT_EQ(BuildScanMesh(scan, {}).size(), columns == 2 ? 2u : 0u);
    for (Eigen::Vector3d& point : scan.points) point = Scan::MissingPoint();
    EXPECT_TRUE(BuildScanMesh(scan, {}).empty());
  }
}

TEST(ScanMesh, GivesBackTheTrianglesOfAMesh) {
  Scan scan;
  scan.organised = false;
  scan.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  scan.triangles = {{0, 1, 2}};
  EXPECT_EQ(BuildScanMesh(scan, {}), scan.triangles);
}

TEST(ScanMesh, OptionsAreChecked) {
  EXPECT_TRUE(ScanMeshOptions().Problems().empty());
  ScanMeshOptions options;
  options.max_edge_ratio = 1;
  options.max_bend = -1;
  EXPECT_EQ(options.Problems().size(), 2u);
  options.max_edge_ratio = options.max_bend = std::nan("");
  EXPECT_EQ(options.Problems().size(), 2u);
}

TEST(ScanMesh, SmallerEdgeRatioCutsGrazingWalls) {
  GridOptions options;
  options.first_azimuth_deg = 5;
  options.last_azimuth_deg = 80;
  const Scan scan = MakeScan(
      [](const Eigen::Vector3d& d) { return RangeToPlane(d, Eigen::Vector3d::UnitX(), 1.5); },
      options);
  ScanMeshOptions strict;
  strict.max_edge_ratio = 2;
  EXPECT_LT(BuildScanMesh(scan, strict).size(), 0.8 * BuildScanMesh(scan, {}).size());
}

TEST(VertexNormals, AreUnitAndFaceTheScanner) {
  const Scan scan = MakeScan(
      [](const Eigen::Vector3d& d) { return RangeToPlane(d, -Eigen::Vector3d::UnitZ(), 3); });
  const std::vector<Eigen::Vector3f> normals = VertexNormals(scan, BuildScanMesh(scan, {}));
  ASSERT_EQ(normals.size(), scan.points.size());
  for (const Eigen::Vector3f& normal : normals) {
    EXPECT_THAT(normal, IsNearMatrix(Eigen::Vector3f(0, 0, 1), 1e-4));
  }
  Scan lonely = scan;
  lonely.points.assign(lonely.points.size(), Scan::MissingPoint());
  for (const Eigen::Vector3f& normal : VertexNormals(lonely, {})) EXPECT_EQ(normal.norm(), 0);
}

TEST(Scan, BoundsAndMissingSamples) {
  Scan scan;
  scan.num_columns = 3;
  scan.num_rows = 1;
  scan.points = {{1, 2, 3}, Scan::MissingPoint(), {-1, 5, 0}};
  scan.intensity = {10, 0, 20};
  EXPECT_EQ(scan.NumMissing(), 1);
  EXPECT_EQ(FindBounds(scan).min, Eigen::Vector3d(-1, 2, 0));
  EXPECT_EQ(FindBounds(scan).max, Eigen::Vector3d(1, 5, 3));
  EXPECT_GT(FindBounds(Scan()).min.x(), FindBounds(Scan()).max.x());
}

TEST(Scan, NeedsDoubleBeyondAKilometre) {
  Scan scan;
  EXPECT_FALSE(NeedsDouble(scan));
  scan.points = {Scan::MissingPoint(), {0, 999.9, -999.9}};
  EXPECT_FALSE(NeedsDouble(scan));
  scan.points.push_back({0, 0, -1000.1});
  EXPECT_TRUE(NeedsDouble(scan));
}

TEST(IntensityAsGrey, StretchesMeasuredSamplesAndLeavesMissingOnesBlack) {
  Scan scan;
  scan.num_columns = 1001;
  scan.num_rows = 1;
  for (int i = 0; i < 1001; ++i) {
    scan.points.push_back(i == 500 ? Scan::MissingPoint() : Eigen::Vector3d(i, 0, 0));
    scan.intensity.push_back(static_cast<float>(i == 1000 ? 1e9 : i == 500 ? 0 : 1000 + i));
  }
  const std::vector<uint8_t> grey = IntensityAsGrey(scan);
  EXPECT_EQ(grey[0], 0);
  EXPECT_EQ(grey[500], 0);
  EXPECT_EQ(grey[1000], 255);  // one glint does not darken the rest
  EXPECT_NEAR(grey[501], 128, 2);
  EXPECT_TRUE(std::is_sorted(grey.begin() + 501, grey.end()));
  scan.intensity.assign(scan.intensity.size(), 5.0f);
  EXPECT_EQ(IntensityAsGrey(scan).size(), 1001u);  // no contrast at all
}

}  // namespace
}  // namespace roomtex
