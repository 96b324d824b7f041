#include "align/surface/scan_planes.h"

#include <cmath>
#include <functional>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/frames.h"
#include "core/scan_mesh.h"
#include "tests/align/trust/scanned_room.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using Eigen::Vector3d;

// A face of the simulated room, normal towards the room; frame: `room`.
struct Face {
  std::string name;
  Vector3d point, normal;
};

std::vector<Face> Shell(const SimulatedRoomOptions& o) {
  return {{"floor", {0, 0, 0}, Vector3d::UnitZ()},
          {"ceiling", {0, 0, o.height}, -Vector3d::UnitZ()},
          {"west wall", {0, 0, 0}, Vector3d::UnitX()},
          {"east wall", {o.width, 0, 0}, -Vector3d::UnitX()},
          {"south wall", {0, 0, 0}, Vector3d::UnitY()},
          {"north wall", {0, o.depth, 0}, -Vector3d::UnitY()}};
}

// Large faces of what stands in the room (capture/simulation/room_furniture.cc, room_shell.cc).
std::vector<Face> Furniture(const SimulatedRoomOptions& o) {
  return {{"table top", {0, 0, 0.74}, Vector3d::UnitZ()},
          {"sideboard top", {0, 0, 0.845}, Vector3d::UnitZ()},
          {"rug", {0, 0, 0.007}, Vector3d::UnitZ()},
          {"sofa seat", {0, 0, 0.43}, Vector3d::UnitZ()},
          {"door leaf", {0, 0.012, 0}, Vector3d::UnitY()},
          {"large picture", {0.025, 0, 0}, Vector3d::UnitX()},
          {"map, 4 mm thick", {0, o.depth - 0.004, 0}, -Vector3d::UnitY()}};
}

struct Found {
  int count = 0;  // planes within 3 mm (the rug lies 7 mm above the floor) and 0.3 degrees
  const ScanPlane* plane = nullptr;
  double angle_deg = 180, offset = 1;
};

double AngleDeg(const Vector3d& a, const Vector3d& b) {
  return DegFromRad(std::atan2(a.cross(b).norm(), a.dot(b)));
}

Found Find(const std::vector<ScanPlane>& planes, const Face& face, const Rigid& scan_from_room,
           double reach = 0.0019) {
  const Vector3d normal = scan_from_room.rotation * face.normal;
  const Vector3d point = scan_from_room * face.point;
  Found found;
  for (const ScanPlane& plane : planes) {
    const double angle = AngleDeg(plane.normal, normal);
    const double offset = normal.dot(plane.point - point);
    if (!(angle < 0.3 && std::abs(offset) < reach)) continue;
    if (++found.count > 1) continue;
    found.plane = &plane;
    found.angle_deg = angle;
    found.offset = offset;
  }
  return found;
}

// A scan of a full turn, elevations of +-45 degrees, of whatever `range` (of a unit direction; 0 =
// nothing there) gives.
Scan ScanOf(int columns, int rows, const std::function<double(const Vector3d&)>& range,
            double noise, double missing = 0) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  Scan scan;
  scan.num_columns = columns;
  scan.num_rows = rows;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double theta = 2 * kPi * (column + 0.5) / columns;
      const double phi = kPi / 4 - kPi / 2 * (row + 0.5) / rows;
      const Vector3d direction(std::sin(theta) * std::cos(phi), std::sin(phi),
                               -std::cos(theta) * std::cos(phi));
      const double measured = range(direction) + noise * normal(random);
      const bool is_missing = uniform(random) < missing || !(range(direction) > 0);
      scan.points.push_back(is_missing ? Scan::MissingPoint() : Vector3d(measured * direction));
      scan.intensity.push_back(is_missing ? 0 : 1);
    }
  }
  return scan;
}

// Range of the wall z = -distance within |x| < half_width (beyond that 0).
double RangeOfWall(const Vector3d& direction, double distance, double half_width) {
  if (!(direction.z() < -0.05)) return 0;
  const double range = distance / -direction.z();
  return std::abs(range * direction.x()) < half_width ? range : 0;
}

TEST(ScanPlanes, FindsTheShellOfAFurnishedRoomOnceAndExactly) {
  for (int seed = 0; seed < 2; ++seed) {
    const ScannedRoom other(seed == 0 ? RoomOptions(0) : RoomOptions(seed));
    const std::vector<ScanPlane> planes = FindScanPlanes(other.scans, ScanPlaneOptions(), -1);
    for (const Face& face : Shell(other.options)) {
      const Found found = Find(planes, face, other.scan_from_room);
      ASSERT_EQ(found.count, 1) << face.name << ", room " << seed;
      EXPECT_LT(found.angle_deg, 0.02) << face.name << ", room " << seed;
      EXPECT_LT(std::abs(found.offset), 0.0005) << face.name << ", room " << seed;
      // Range noise of 2 mm, seen at a slant.
      EXPECT_GT(found.plane->rms, 0.001) << face.name;
      EXPECT_LT(found.plane->rms, 0.00205) << face.name;
    }
    // The shell is larger than anything in it.
    for (int i = 0; i < 4; ++i) EXPECT_GT(planes[i].area_m2, 4) << i;
  }
}

TEST(ScanPlanes, FindsLargeFurnitureOnceAndKeepsItFromTheWalls) {
  const ScannedRoom& room = FurnishedRoom();
  for (const Face& face : Furniture(room.options)) {
    const Found found = Find(PlanesOfFurnishedRoom(), face, room.scan_from_room);
    ASSERT_EQ(found.count, 1) << face.name;
    EXPECT_LT(found.angle_deg, 0.1) << face.name;
    EXPECT_LT(std::abs(found.offset), 0.0005) << face.name;
  }
  // The map, 0.7 m x 0.95 m, a little of it behind the curtain.
  const Face map = Furniture(room.options).back();
  const double area = Find(PlanesOfFurnishedRoom(), map, room.scan_from_room).plane->area_m2;
  EXPECT_NEAR(area, 0.7 * 0.95, 0.05);
}

TEST(ScanPlanes, ComeLargestFirstWithConsistentAxes) {
  const auto& planes = PlanesOfFurnishedRoom();
  ASSERT_GT(planes.size(), 20u);
  const Vector3d station = FurnishedRoom().scans[0].Station();
  for (size_t i = 0; i < planes.size(); ++i) {
    const ScanPlane& plane = planes[i];
    if (i > 0) {
      EXPECT_LE(plane.area_m2, planes[i - 1].area_m2);
    }
    EXPECT_GE(plane.area_m2, ScanPlaneOptions().min_area_m2);
    EXPECT_GT(plane.Distance(station), 0);
    Eigen::Matrix3d axes;
    axes << plane.u, plane.v, plane.normal;
    EXPECT_THAT(axes.transpose() * axes, IsNearMatrix(Eigen::Matrix3d::Identity(), 1e-12));
    EXPECT_NEAR(axes.determinant(), 1, 1e-12);
    EXPECT_GT(plane.num_samples, 100);
  }
}

TEST(ScanPlanes, MeasureTheAreaThatWasSeen) {
  SimulatedRoomOptions options = RoomOptions(1);
  options.bare_walls = true;
  options.furnished = false;
  options.scan_columns = 800;
  options.scan_rows = 400;
  const ScannedRoom room(options);
  const std::vector<ScanPlane> planes = FindScanPlanes(room.scans, ScanPlaneOptions(), -1);
  const auto area = [&](int i) {
    const Found found = Find(planes, Shell(options)[i], room.scan_from_room);
    return found.count == 1 ? found.plane->area_m2 : 0;
  };
  for (int i : {2, 3}) EXPECT_NEAR(area(i), options.depth * options.height, 0.15);
  for (int i : {4, 5}) EXPECT_NEAR(area(i), options.width * options.height, 0.15);
  // Below the scanner, more than 60 degrees down, nothing was measured.
  const double height = -(room.scan_from_room * Vector3d(0, 0, 0)).y();
  const double hole = kPi * std::pow(height / std::tan(RadFromDeg(60)), 2);
  EXPECT_NEAR(area(0), options.width * options.depth - hole, 0.25);
  const ScanPlane& floor = *Find(planes, Shell(options)[0], room.scan_from_room).plane;
  EXPECT_FALSE(floor.Covers(Vector3d(0, -height, 0)));
  EXPECT_TRUE(floor.Covers(Vector3d(1.2 * height / std::tan(RadFromDeg(60)), -height, 0)));
  EXPECT_FALSE(floor.Covers(Vector3d(20, -height, 0)));
}

TEST(ScanPlanes, AreFoundInNoiseThatGrowsWithTheRange) {
  SimulatedRoomOptions options = RoomOptions(2);
  options.range_noise_growth = 1;  // 10 mm at 4 m
  const ScannedRoom furnished(options);
  options.bare_walls = true;
  options.furnished = false;
  const ScannedRoom bare(options);
  const std::vector<ScanPlane> planes = FindScanPlanes(furnished.scans, ScanPlaneOptions(), -1);
  const std::vector<ScanPlane> bare_planes = FindScanPlanes(bare.scans, ScanPlaneOptions(), -1);
  EXPECT_EQ(bare_planes.size(), 7u);  // the shell and the lamp
  for (const Face& face : Shell(options)) {
    const Found found = Find(bare_planes, face, bare.scan_from_room);
    ASSERT_EQ(found.count, 1) << face.name;
    EXPECT_LT(found.angle_deg, 0.02) << face.name;
    EXPECT_LT(std::abs(found.offset), 0.0003) << face.name;
    // Posters 4 mm thick vanish in such noise: the wall comes out between them and itself.
    const Found among_posters = Find(planes, face, furnished.scan_from_room);
    ASSERT_EQ(among_posters.count, 1) << face.name;
    EXPECT_LT(among_posters.angle_deg, 0.15) << face.name;
    EXPECT_LT(std::abs(among_posters.offset), 0.0015) << face.name;
    EXPECT_GT(among_posters.plane->area_m2, 4) << face.name;
  }
}

TEST(ScanPlanes, TolerateMissingSamples) {
  const auto wall = [](const Vector3d& d) { return RangeOfWall(d, 3, 2); };
  const Scan scan = ScanOf(1200, 300, wall, 0.002, 0.3);
  const std::vector<ScanPlane> planes = FindScanPlanes({scan}, ScanPlaneOptions(), -1);
  ASSERT_EQ(planes.size(), 1u);
  EXPECT_LT(AngleDeg(planes[0].normal, Vector3d::UnitZ()), 0.02);
  EXPECT_NEAR(planes[0].point.z(), -3, 0.0003);
  // 4 m wide; at x it reaches up to |y| < sqrt(9 + x^2). A missing sample amid others is no hole.
  const double area = 2 * (2 * std::sqrt(13.0) + 9 * std::asinh(2.0 / 3));
  EXPECT_NEAR(planes[0].area_m2, area, 0.04 * area);
}

TEST(ScanPlanes, KeepParallelSurfacesApartThatAreOneCentimetreApart) {
  // A door leaf, 1 m wide and 2 m high, 1 cm before the wall, without a frame.
  const auto range = [](const Vector3d& d) {
    const double leaf = RangeOfWall(d, 2.99, 0.5);
    if (leaf > 0 && std::abs(leaf * d.y()) < 1) return leaf;
    return RangeOfWall(d, 3, 2.5);
  };
  const Scan scan = ScanOf(1600, 400, range, 0.002);
  const std::vector<ScanPlane> planes = FindScanPlanes({scan}, ScanPlaneOptions(), -1);
  ASSERT_EQ(planes.size(), 2u);
  EXPECT_NEAR(planes[0].point.z(), -3, 0.0002);
  EXPECT_NEAR(planes[1].point.z(), -2.99, 0.0002);
  EXPECT_NEAR(planes[1].area_m2, 2, 0.06);
  EXPECT_LT(AngleDeg(planes[0].normal, planes[1].normal), 0.03);
  EXPECT_FALSE(planes[0].Covers({0, 0, -3}));
  EXPECT_TRUE(planes[1].Covers({0, 0, -3}));
}

TEST(ScanPlanes, JoinAWallBehindAnOccluder) {
  // A pillar from top to bottom cuts the wall in two.
  const auto range = [](const Vector3d& d) {
    const double pillar = RangeOfWall(d, 1.5, 0.2);
    return pillar > 0 ? pillar : RangeOfWall(d, 3, 2.5);
  };
  const Scan scan = ScanOf(1200, 300, range, 0.002);
  const std::vector<ScanPlane> planes = FindScanPlanes({scan}, ScanPlaneOptions(), -1);
  ASSERT_EQ(planes.size(), 2u);
  EXPECT_NEAR(planes[0].point.z(), -3, 0.0003);
  EXPECT_LT(AngleDeg(planes[0].normal, Vector3d::UnitZ()), 0.01);
  EXPECT_TRUE(planes[0].Covers({-1.5, 0, -3}));
  EXPECT_TRUE(planes[0].Covers({1.5, 0, -3}));
  EXPECT_FALSE(planes[0].Covers({0, 0, -3}));  // in the pillar's shadow
  EXPECT_NEAR(planes[1].point.z(), -1.5, 0.0003);
}

TEST(ScanPlanes, AreNotFoundOnSpheresAndCylinders) {
  const auto sphere = [](const Vector3d& d) {  // radius 1, centre 2.5 m away
    const double along = -2.5 * d.z(), inside = along * along - 2.5 * 2.5 + 1;
    return inside > 0 ? along - std::sqrt(inside) : 0;
  };
  const auto inside_of_cylinder = [](const Vector3d& d) {  // radius 2 m, upright
    return 2 / std::hypot(d.x(), d.z());
  };
  const auto pillar = [](const Vector3d& d) {  // radius 0.6 m, axis 2 m away
    const double a = d.x() * d.x() + d.z() * d.z(), b = -2 * d.z();
    const double inside = b * b - a * (4 - 0.36);
    return inside > 0 && b > 0 ? (b - std::sqrt(inside)) / a : 0;
  };
  for (const auto& shape : {std::function<double(const Vector3d&)>(sphere),
                            std::function<double(const Vector3d&)>(inside_of_cylinder),
                            std::function<double(const Vector3d&)>(pillar)}) {
    const Scan scan = ScanOf(800, 200, shape, 0.001);
    EXPECT_EQ(FindScanPlanes({scan}, ScanPlaneOptions(), -1).size(), 0u);
  }
}

TEST(ScanPlanes, OfAMovedScanAreTheMovedPlanes) {
  const ScannedRoom& room = FurnishedRoom();
  const auto& planes = PlanesOfFurnishedRoom();
  Rigid moved_from_scan;
  moved_from_scan.rotation = Eigen::AngleAxisd(0.7, Vector3d(1, 2, -1).normalized());
  moved_from_scan.translation = {4500, -3200, 120};
  Scan moved = room.scans[0];
  for (Vector3d& point : moved.points) {
    if (point.x() == point.x()) point = moved_from_scan * point;
  }
  moved.scan_from_station = moved_from_scan;
  moved.up = moved_from_scan.rotation * moved.up;
  const std::vector<ScanPlane> found = FindScanPlanes({moved}, ScanPlaneOptions(), -1);
  ASSERT_EQ(found.size(), planes.size());
  for (size_t i = 0; i < 12; ++i) {
    EXPECT_LT(AngleDeg(found[i].normal, moved_from_scan.rotation * planes[i].normal), 1e-4) << i;
    EXPECT_NEAR(found[i].Distance(moved_from_scan * planes[i].point), 0, 1e-6) << i;
    EXPECT_NEAR(found[i].area_m2, planes[i].area_m2, 0.01) << i;
  }
}

void ExpectSamePlanes(const std::vector<ScanPlane>& a, const std::vector<ScanPlane>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].point, b[i].point);
    EXPECT_EQ(a[i].normal, b[i].normal);
    EXPECT_EQ(a[i].area_m2, b[i].area_m2);
    EXPECT_EQ(a[i].rms, b[i].rms);
    EXPECT_EQ(a[i].num_samples, b[i].num_samples);
    EXPECT_EQ(a[i].min_cell, b[i].min_cell);
    EXPECT_TRUE((a[i].covered == b[i].covered).all());
  }
}

TEST(ScanPlanes, AreTheSameForEveryNumberOfThreads) {
  const ScanPlaneOptions options;
  const std::vector<ScanPlane> one = FindScanPlanes(FurnishedRoom().scans, options, 1);
  ExpectSamePlanes(one, FindScanPlanes(FurnishedRoom().scans, options, 4));
  ExpectSamePlanes(one, PlanesOfFurnishedRoom());
}

TEST(ScanPlanes, OfABentScanAreStillOnePerWall) {
  SimulatedRoomOptions options = RoomOptions(1);
  options.bend = 0.01;  // ranges wrong by up to 1 %, smoothly
  options.azimuth_drift_deg = 0.2;
  const ScannedRoom room(options);
  const std::vector<ScanPlane> planes = FindScanPlanes(room.scans, ScanPlaneOptions(), -1);
  const std::vector<ScanPlane> straight =
      FindScanPlanes(ScannedRoom(RoomOptions(1)).scans, ScanPlaneOptions(), -1);
  // A wall stays one plane that is up to 1 cm off it, with a larger residual. Floor and ceiling are
  // seen all around: where they leave one plane by more than 1 cm they become two.
  for (size_t i = 2; i < 6; ++i) {
    const Face face = Shell(options)[i];
    const Found before = Find(straight, face, room.scan_from_room);
    const Vector3d normal = room.scan_from_room.rotation * face.normal;
    const ScanPlane* found = nullptr;
    for (const ScanPlane& plane : planes) {
      const double distance = normal.dot(plane.point - room.scan_from_room * face.point);
      if (AngleDeg(plane.normal, normal) < 1 && std::abs(distance) < 0.03) {
        if (found == nullptr) found = &plane;
      }
    }
    ASSERT_NE(found, nullptr) << face.name;
    EXPECT_GT(found->area_m2, 0.9 * before.plane->area_m2) << face.name;
  }
  for (size_t i = 0; i < 2; ++i) {
    const Vector3d normal = room.scan_from_room.rotation * Shell(options)[i].normal;
    const Vector3d point = room.scan_from_room * Shell(options)[i].point;
    double largest = 0;
    for (const ScanPlane& plane : planes) {
      if (AngleDeg(plane.normal, normal) < 1.5 &&
          std::abs(normal.dot(plane.point - point)) < 0.03) {
        largest = std::max(largest, plane.area_m2);
      }
    }
    const Found before = Find(straight, Shell(options)[i], room.scan_from_room);
    EXPECT_GT(largest, 0.6 * before.plane->area_m2) << Shell(options)[i].name;
  }
  EXPECT_LT(planes.size(), straight.size() + 6);
}

TEST(ScanPlanes, OfSeveralScansAreMerged) {
  SimulatedRoomOptions options = RoomOptions(3);
  options.scan_columns = 800;
  options.scan_rows = 400;
  options.num_stations = 2;
  const ScannedRoom room(options);
  const ScanPlaneOptions plane_options;
  const std::vector<ScanPlane> both = FindScanPlanes(room.scans, plane_options, -1);
  const std::vector<ScanPlane> first = FindScanPlanes({room.scans[0]}, plane_options, -1);
  const std::vector<ScanPlane> second = FindScanPlanes({room.scans[1]}, plane_options, -1);
  for (const Face& face : Shell(options)) {
    const Found joint = Find(both, face, room.scan_from_room);
    ASSERT_EQ(joint.count, 1) << face.name;
    EXPECT_LT(joint.angle_deg, 0.02) << face.name;
    EXPECT_LT(std::abs(joint.offset), 0.0005) << face.name;
    const Found a = Find(first, face, room.scan_from_room);
    const Found b = Find(second, face, room.scan_from_room);
    ASSERT_EQ(a.count, 1) << face.name;
    ASSERT_EQ(b.count, 1) << face.name;
    // What both scans see counts once.
    EXPECT_GT(joint.plane->area_m2, 0.99 * std::max(a.plane->area_m2, b.plane->area_m2));
    EXPECT_LT(joint.plane->area_m2, 0.8 * (a.plane->area_m2 + b.plane->area_m2)) << face.name;
    EXPECT_GT(joint.plane->num_samples, 0.9 * (a.plane->num_samples + b.plane->num_samples));
  }
}

TEST(ScanPlanes, OfAMeshWithoutAGridAreThoseOfItsScan) {
  SimulatedRoomOptions options = RoomOptions(0);
  options.scan_columns = 800;
  options.scan_rows = 400;
  const ScannedRoom room(options);
  Scan mesh = room.scans[0];
  mesh.triangles = BuildScanMesh(mesh, ScanMeshOptions());
  mesh.organised = false;
  mesh.num_columns = static_cast<int>(mesh.points.size());
  mesh.num_rows = 1;
  const std::vector<ScanPlane> planes = FindScanPlanes({mesh}, ScanPlaneOptions(), -1);
  for (const Face& face : Shell(options)) {
    const Found found = Find(planes, face, room.scan_from_room, 0.0029);
    EXPECT_EQ(found.count, 1) << face.name;
    EXPECT_LT(found.angle_deg, 0.1) << face.name;
    EXPECT_LT(std::abs(found.offset), 0.0015) << face.name;
  }
  ExpectSamePlanes(planes, FindScanPlanes({mesh}, ScanPlaneOptions(), 1));
}

TEST(ScanPlanes, OfABoxOfTwelveTrianglesAreItsSides) {
  Scan mesh;
  mesh.organised = false;
  for (int i = 0; i < 8; ++i) {
    mesh.points.emplace_back(i & 1 ? 2 : -2, i & 2 ? 1.5 : -1.5, i & 4 ? 1 : -1);
  }
  mesh.num_columns = 8;
  mesh.num_rows = 1;
  for (const auto& [a, b, c, d] : std::vector<std::array<int, 4>>{
           {0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}}) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  }
  const std::vector<ScanPlane> planes = FindScanPlanes({mesh}, ScanPlaneOptions(), -1);
  ASSERT_EQ(planes.size(), 6u);
  const double areas[] = {12, 12, 8, 8, 6, 6};
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(planes[i].area_m2, areas[i], 0.3);
    EXPECT_NEAR(planes[i].normal.cwiseAbs().maxCoeff(), 1, 1e-9);
    EXPECT_NEAR(planes[i].rms, 0, 1e-9);
    EXPECT_LT(planes[i].normal.dot(planes[i].point), 0);  // towards the scanner at the origin
  }
}

TEST(ScanPlanes, OfAScanWithoutSamplesAreNone) {
  Scan empty;
  empty.num_columns = empty.num_rows = 20;
  empty.points.assign(400, Scan::MissingPoint());
  empty.intensity.assign(400, 0);
  Scan mesh;
  mesh.organised = false;
  Scan tiny = empty;
  tiny.points[7] = {1, 2, 3};
  EXPECT_EQ(FindScanPlanes({empty, mesh, tiny}, ScanPlaneOptions(), -1).size(), 0u);
  EXPECT_EQ(FindScanPlanes({}, ScanPlaneOptions(), -1).size(), 0u);
}

TEST(ScanPlanes, FollowTheirOptions) {
  const auto& scans = FurnishedRoom().scans;
  ScanPlaneOptions large;
  large.min_area_m2 = 3;
  const std::vector<ScanPlane> planes = FindScanPlanes(scans, large, -1);
  EXPECT_EQ(planes.size(), 6u);
  ScanPlaneOptions coarse;
  coarse.min_step = 0.02;  // door leaf, rug and posters now belong to what is behind them
  coarse.max_distance = 0.03;
  const std::vector<ScanPlane> few = FindScanPlanes(scans, coarse, -1);
  EXPECT_EQ(Find(few, Furniture(FurnishedRoom().options)[2], FurnishedRoom().scan_from_room).count,
            0);
  ScanPlaneOptions wrong;
  wrong.min_area_m2 = -1;
  wrong.max_angle_deg = 0;
  wrong.max_noise = std::nan("");
  EXPECT_EQ(wrong.Problems().size(), 3u);
  EXPECT_THAT(wrong.Problems()[0], testing::HasSubstr("--Plane.min_area_m2"));
  EXPECT_TRUE(ScanPlaneOptions().Problems().empty());
}

TEST(ScanPlanes, CoverTheirCellsAndOneBesideThem) {
  ScanPlane plane;
  plane.point = {1, 2, 3};
  plane.normal = Vector3d::UnitZ();
  plane.u = Vector3d::UnitX();
  plane.v = Vector3d::UnitY();
  plane.cell_size = 0.1;
  plane.min_cell = {-2, 5};
  plane.covered.setZero(3, 2);
  plane.covered(2, 1) = 1;  // u in [0, 0.1), v in [0.6, 0.7)
  EXPECT_TRUE(plane.Covers({1.05, 2.65, 3}));
  EXPECT_TRUE(plane.Covers({1.05, 2.65, 7}));
  EXPECT_TRUE(plane.Covers({1.15, 2.75, 3}));
  EXPECT_TRUE(plane.Covers({0.95, 2.55, 3}));
  EXPECT_FALSE(plane.Covers({1.25, 2.65, 3}));
  EXPECT_FALSE(plane.Covers({1.05, 2.45, 3}));
  EXPECT_FALSE(plane.Covers({1e12, -1e12, 3}));
  EXPECT_FALSE(plane.Covers({std::nan(""), 2.65, 3}));
  EXPECT_FALSE(ScanPlane().Covers({0, 0, 0}));
  EXPECT_NEAR(plane.Distance({5, 5, 2.5}), -0.5, 1e-12);
}

}  // namespace
}  // namespace roomtex
