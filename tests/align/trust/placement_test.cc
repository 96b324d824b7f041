#include <cmath>

#include <gtest/gtest.h>

#include "align/trust/trust.h"
#include "core/frames.h"
#include "core/ray_caster.h"

namespace roomtex {
namespace {

struct Box {
  Eigen::Vector3d low, high;
};

void AddBox(const Box& box, std::vector<Eigen::Vector3d>* points,
            std::vector<Triangle>* triangles) {
  const int first = static_cast<int>(points->size());
  for (int i = 0; i < 8; ++i) {
    points->emplace_back(i & 1 ? box.high.x() : box.low.x(),
                         i >> 1 & 1 ? box.high.y() : box.low.y(),
                         i >> 2 ? box.high.z() : box.low.z());
  }
  for (const Triangle& t : {Triangle{0, 1, 3},
                            {0, 3, 2},
                            {4, 5, 7},
                            {4, 7, 6},
                            {0, 1, 5},
                            {0, 5, 4},
                            {2, 3, 7},
                            {2, 7, 6},
                            {0, 2, 6},
                            {0, 6, 4},
                            {1, 3, 7},
                            {1, 7, 5}}) {
    triangles->push_back({first + t[0], first + t[1], first + t[2]});
  }
}

// A room of 6 x 6 m that a wall along x = 3 divides up to y = 4, scanned from its left half.
Scan ScanOfDividedRoom() {
  std::vector<Eigen::Vector3d> points;
  std::vector<Triangle> triangles;
  AddBox({{0, 0, 0}, {6, 6, 2.5}}, &points, &triangles);
  AddBox({{2.95, 0, 0}, {3.05, 4, 2.5}}, &points, &triangles);
  const RayCaster caster(points, triangles);
  Scan scan;
  scan.num_columns = 2400;
  scan.num_rows = 800;
  scan.up = Eigen::Vector3d::UnitZ();
  scan.scan_from_station.translation = {1, 2, 1.5};
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      const double azimuth = 2 * kPi * column / scan.num_columns;
      const double elevation = 1.2 - 2.4 * row / scan.num_rows;
      const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                      std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      const auto hit = caster.Cast(scan.Station(), direction);
      scan.points.push_back(hit ? hit->point : Scan::MissingPoint());
    }
  }
  scan.intensity.assign(scan.points.size(), 0.5f);
  return scan;
}

// Photos from around this place, of 60 points on the far wall, to the right of the passage.
double CameraShareAt(const Eigen::Vector3d& place) {
  static const std::vector<Scan> kScans = {ScanOfDividedRoom()};
  static const ScanPatches kSurface(kScans, ScanPatchOptions());
  static const FreeSpace kFreeSpace(kScans, 200000);
  SparseModel model;
  for (uint64_t id = 1; id <= 60; ++id) {
    model.points[id].x_in_model = {3.4 + 0.02 * static_cast<double>(id), 6,
                                   0.4 + 0.25 * static_cast<double>(id % 8)};
  }
  for (uint32_t id = 1; id <= 4; ++id) {
    SparseImage& image = model.images[id];
    image.image_id = id;
    image.cam_from_model.translation = -(place + Eigen::Vector3d(0.1 * id, 0, 0));
    for (const auto& [point, x] : model.points) {
      image.points2d.emplace_back(0, 0);
      image.point3d_ids.push_back(point);
    }
  }
  return CheckPlacement(model, {}, Similarity(), kSurface, kFreeSpace, TrustOptions())
      .CameraShare();
}

TEST(Placement, PhotosAroundACornerStandInTheRoom) {
  EXPECT_EQ(CameraShareAt({1, 3, 1.5}), 1);      // where the scanner looked
  EXPECT_EQ(CameraShareAt({4.4, 1.5, 1.5}), 1);  // behind the wall that divides the room
}

TEST(Placement, PhotosBehindTheWallsDoNot) {
  EXPECT_EQ(CameraShareAt({4, 7.5, 1.5}), 0);  // what they show turns its back to them
  EXPECT_EQ(CameraShareAt({-1, 3, 1.5}), 0);   // a wall is between
  EXPECT_EQ(CameraShareAt({2, 3, -1.5}), 0);   // the floor is
}

}  // namespace
}  // namespace roomtex
