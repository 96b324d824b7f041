#include "core/surfels.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>

#include "core/ray_caster.h"

namespace roomtex {
namespace {

constexpr double kNoise = 0.002;
const Eigen::Vector3d kRoom(5, 4, 2.5);  // from the origin

// Points all over the sides of a room, with noise across them.
struct Sides {
  Scan cloud;
  std::vector<int> axis;  // of the normal, per point
  std::vector<double> height;

  explicit Sides(int count, const Eigen::Vector3d& shift = Eigen::Vector3d::Zero()) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> share(0, 1);
    std::normal_distribution<double> noise(0, kNoise);
    cloud.organised = false;
    cloud.up = Eigen::Vector3d::UnitZ();
    for (int i = 0; i < count; ++i) {
      Eigen::Vector3d x(share(random), share(random), share(random));
      x = x.cwiseProduct(kRoom);
      axis.push_back(i % 3);
      height.push_back(i % 2 == 0 ? 0 : kRoom[i % 3]);
      x[i % 3] = height.back() + noise(random);
      cloud.points.push_back(x + shift);
      cloud.intensity.push_back(static_cast<float>(i % 3));
    }
    cloud.num_columns = count;
    cloud.num_rows = 1;
  }
  bool IsNearEdge(size_t i, const Eigen::Vector3d& x, double distance) const {
    for (int k = 0; k < 3; ++k) {
      if (k != axis[i] && std::min(x[k], kRoom[k] - x[k]) < distance) return true;
    }
    return false;
  }
};

TEST(Surfels, NormalsAndPlacesAreThoseOfTheSurface) {
  const Eigen::Vector3d utm(412345, 5654321, 120);
  for (const Eigen::Vector3d& shift : {Eigen::Vector3d(0, 0, 0), utm}) {
    const Sides sides(150000, shift);
    const CloudSurface surface = FindCloudSurface(sides.cloud, 2);
    // 150 000 points on 85 square metres.
    EXPECT_NEAR(surface.spacing, std::sqrt(85.0 / 150000), 0.004);
    EXPECT_NEAR(surface.noise, kNoise, 0.3 * kNoise);
    double squares = 0;
    int num_inside = 0, num_turned = 0;
    for (size_t i = 0; i < sides.cloud.points.size(); ++i) {
      const Eigen::Vector3d x = surface.points[i] - shift;
      if (sides.IsNearEdge(i, x, 0.1)) continue;
      ++num_inside;
      squares += std::pow(x[sides.axis[i]] - sides.height[i], 2);
      num_turned += std::abs(surface.normals[i][sides.axis[i]]) < std::cos(0.06);
    }
    EXPECT_LT(std::sqrt(squares / num_inside), 0.4 * kNoise);
    EXPECT_LT(num_turned, 0.02 * num_inside);
  }
}

TEST(Surfels, NormalsOfTheFileSayTheFront) {
  // As merged stations: nothing is known of where they were taken from.
  const auto share_inwards = [](const Sides& sides, const CloudSurface& surface) {
    int num_inwards = 0, num_asked = 0;
    for (const Triangle& t : surface.patches.triangles) {
      const Eigen::Vector3d& a = surface.patches.points[t[0]];
      const Eigen::Vector3d normal =
          (surface.patches.points[t[1]] - a).cross(surface.patches.points[t[2]] - a);
      num_inwards += normal.dot(0.5 * kRoom - a) > 0;
      ++num_asked;
    }
    for (size_t i = 0; i < sides.cloud.points.size(); ++i) {
      if (surface.normals[i].isZero()) continue;
      num_inwards += surface.normals[i].cast<double>().dot(0.5 * kRoom - sides.cloud.points[i]) > 0;
      ++num_asked;
    }
    return static_cast<double>(num_inwards) / num_asked;
  };
  std::mt19937 random(3);
  for (const double turn : {1.0, -1.0, 0.0}) {  // a room; a thing; either way
    Sides sides(30000);
    sides.cloud.scan_from_station.translation = {40, 0, 0};
    for (size_t i = 0; i < sides.cloud.points.size(); ++i) {
      Eigen::Vector3f normal = Eigen::Vector3f::Zero();
      const float inwards = sides.height[i] == 0 ? 1 : -1;
      normal[sides.axis[i]] = inwards * (turn != 0 ? turn : random() % 2 == 0 ? 1 : -1);
      sides.cloud.normals.push_back(normal);
    }
    const CloudSurface surface = FindCloudSurface(sides.cloud, 1);
    EXPECT_EQ(surface.angular_spacing, 0);
    EXPECT_EQ(surface.front_is_known, turn != 0);
    if (turn == 0) continue;
    EXPECT_NEAR(share_inwards(sides, surface), turn > 0 ? 1 : 0, 0.01);
  }
}

TEST(Surfels, PatchesCloseTheSurfaceAndReachHardlyBeyond) {
  const Sides sides(100000);
  const CloudSurface surface = FindCloudSurface(sides.cloud, 2);
  const RayCaster caster(surface.patches.points, surface.patches.triangles);
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0, 1);
  int num_holes = 0, num_off = 0;
  constexpr int kRays = 5000;
  for (int i = 0; i < kRays; ++i) {
    const Eigen::Vector3d direction =
        Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
    const auto hit = caster.Cast(0.5 * kRoom, direction);
    if (!hit) {
      ++num_holes;
      continue;
    }
    const Eigen::Vector3d inside = hit->point.cwiseMin(kRoom - hit->point);
    num_off += std::abs(inside.minCoeff()) > 3 * kNoise;
  }
  EXPECT_LT(num_holes, kRays / 20);  // 4 %: points at random leave gaps
  EXPECT_LT(num_off, kRays / 50);
  EXPECT_EQ(surface.patches.kind(), Scan::Kind::kMesh);
  EXPECT_LT(surface.patches.points.size(), 2 * sides.cloud.points.size());
}

TEST(Surfels, SaysWhetherTheCloudWasTakenFromItsStation) {
  Sides sides(100000);
  sides.cloud.scan_from_station.translation = {2, 1, 1};
  const CloudSurface inside = FindCloudSurface(sides.cloud, 1);
  EXPECT_GT(inside.angular_spacing, 0);
  for (size_t i = 0; i < inside.points.size(); ++i) {
    const Eigen::Vector3d sight = sides.cloud.Station() - sides.cloud.points[i];
    EXPECT_GE(inside.normals[i].cast<double>().dot(sight), -1e-3);
  }
  const Scan grid =
      GridAroundStation(sides.cloud, sides.cloud.Station(), 0, sides.cloud.points.size(), 40);
  EXPECT_EQ(grid.num_columns, 80);
  EXPECT_LT(grid.NumMissing(), 320);  // of 3200, next to the poles
  // From outside one side hides the other, and from afar all lie in one direction.
  for (const Eigen::Vector3d& station : {Eigen::Vector3d(8, 1, 1), Eigen::Vector3d(5e5, 5e6, 0)}) {
    sides.cloud.scan_from_station.translation = station;
    const CloudSurface outside = FindCloudSurface(sides.cloud, 1);
    EXPECT_EQ(outside.angular_spacing, 0);
    // Its frame stays where it is: an aligned model remembers that. It is seen from its middle.
    EXPECT_EQ(outside.patches.scan_from_station.translation, station);
    EXPECT_LT((outside.patches.Station() - kRoom / 2).norm(), 0.1);
  }
}

TEST(Surfels, TheSameForEveryNumberOfThreads) {
  const Sides sides(200000);
  const CloudSurface one = FindCloudSurface(sides.cloud, 1),
                     three = FindCloudSurface(sides.cloud, 3);
  EXPECT_EQ(one.points, three.points);
  EXPECT_EQ(one.normals, three.normals);
  EXPECT_EQ(one.patches.points, three.patches.points);
  EXPECT_EQ(one.patches.triangles, three.patches.triangles);
}

TEST(Surfels, PointsWithoutASurfaceAreStray) {
  Scan cloud;
  cloud.organised = false;
  EXPECT_TRUE(FindCloudSurface(cloud, 1).patches.triangles.empty());
  for (int i = 0; i < 2000; ++i) {  // a line, and one place many times
    cloud.points.push_back(i < 1000 ? Eigen::Vector3d(0.01 * i, 0, 0) : Eigen::Vector3d(1, 2, 3));
    cloud.intensity.push_back(1);
  }
  cloud.points.push_back(Scan::MissingPoint());
  cloud.intensity.push_back(0);
  cloud.num_columns = static_cast<int>(cloud.points.size());
  cloud.num_rows = 1;
  const CloudSurface surface = FindCloudSurface(cloud, 1);
  for (const Eigen::Vector3f& normal : surface.normals) {
    EXPECT_TRUE(normal.isZero() || std::abs(normal.norm() - 1) < 1e-5);
  }
  for (const Eigen::Vector3d& corner : surface.patches.points) EXPECT_TRUE(corner.allFinite());
}

}  // namespace
}  // namespace roomtex
