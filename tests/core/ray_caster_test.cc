#include "core/ray_caster.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "core/parallel.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

// Surface of the box between two corners, outside faces counter-clockwise.
struct Mesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<Triangle> triangles;
};
Mesh MakeBox(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.points.emplace_back(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(),
                             i & 4 ? high.z() : low.z());
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

// Distance from inside the box to its surface (slab method).
double DistanceToBox(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                     const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  double distance = 1e9;
  for (int k = 0; k < 3; ++k) {
    if (direction[k] > 0) distance = std::min(distance, (high[k] - origin[k]) / direction[k]);
    if (direction[k] < 0) distance = std::min(distance, (low[k] - origin[k]) / direction[k]);
  }
  return distance;
}

class BoxAt : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Offset, BoxAt, testing::Values(0.0, 100.0, 5e6));

TEST_P(BoxAt, EveryRayFromInsideHitsAtTheAnalyticDistance) {
  const Eigen::Vector3d offset(GetParam(), -GetParam(), 0.5 * GetParam());
  const Eigen::Vector3d low = Eigen::Vector3d(-2, -1.5, -3) + offset;
  const Eigen::Vector3d high = Eigen::Vector3d(2.5, 1.5, 4) + offset;
  const Mesh box = MakeBox(low, high);
  const RayCaster caster(box.points, box.triangles);
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d direction =
        Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
    const Eigen::Vector3d origin = offset + Eigen::Vector3d(0.3, -0.2, 0.7);
    const auto hit = caster.Cast(origin, direction);
    ASSERT_TRUE(hit) << "a ray slipped through the box";
    EXPECT_NEAR(hit->distance, DistanceToBox(low, high, origin, direction), 1e-5);
    EXPECT_THAT(hit->point, IsNearMatrix(origin + hit->distance * direction, 1e-9));
    // The hit lies in the triangle that is named.
    const Triangle& t = box.triangles.at(hit->triangle);
    const Eigen::Vector3d n = (box.points[t[1]] - box.points[t[0]])
                                  .cross(box.points[t[2]] - box.points[t[0]])
                                  .normalized();
    EXPECT_NEAR(n.dot(hit->point - box.points[t[0]]), 0, 1e-5);
  }
}

TEST(RayCaster, KeepsToItsLimits) {
  const Mesh box = MakeBox({-1, -1, -1}, {1, 1, 1});
  const RayCaster caster(box.points, box.triangles);
  const Eigen::Vector3d origin(0.1, 0.2, -5), forward(0, 0, 1);
  EXPECT_NEAR(caster.Cast(origin, forward)->distance, 4, 1e-6);
  EXPECT_NEAR(caster.Cast(origin, forward, 4.5)->distance, 6, 1e-6);  // the far side, from inside
  EXPECT_FALSE(caster.Cast(origin, forward, 0, 3.9));
  EXPECT_FALSE(caster.Cast(origin, forward, 6.5));
  EXPECT_FALSE(caster.Cast(origin, -forward));
  EXPECT_FALSE(caster.Cast({5, 5, -5}, forward));
}

TEST(RayCaster, SeesOcclusionBetweenTwoPoints) {
  const Mesh box = MakeBox({-1, -1, -1}, {1, 1, 1});
  const RayCaster caster(box.points, box.triangles);
  EXPECT_TRUE(caster.IsOccluded({0, 0, -5}, {0, 0, 5}, 0.01));
  EXPECT_FALSE(caster.IsOccluded({3, 0, -5}, {3, 0, 5}, 0.01));
  // A point on the surface does not hide itself, from either end.
  EXPECT_FALSE(caster.IsOccluded({0.1, 0, -5}, {0.1, 0, -1}, 0.01));
  EXPECT_FALSE(caster.IsOccluded({0.1, 0, -1}, {0.1, 0, -5}, 0.01));
  EXPECT_TRUE(caster.IsOccluded({0.1, 0, -5}, {0.1, 0, 1}, 0.01));
  EXPECT_FALSE(caster.IsOccluded({0, 0, -1.001}, {0, 0, -0.999}, 0.01));  // nearer than the margins
}

TEST(RayCaster, IgnoresMissingSamplesAndEmptyMeshes) {
  Mesh box = MakeBox({-1, -1, -1}, {1, 1, 1});
  box.points.push_back(Eigen::Vector3d::Constant(std::nan("")));
  const RayCaster with_missing(box.points, box.triangles);
  EXPECT_NEAR(with_missing.Cast({0.1, 0.2, 0}, {1, 0, 0})->distance, 0.9, 1e-6);
  EXPECT_FALSE(RayCaster({}, {}).Cast({0, 0, 0}, {1, 0, 0}));
  EXPECT_FALSE(RayCaster({}, {}).IsOccluded({0, 0, 0}, {1, 0, 0}, 0));
}

TEST(RayCaster, GivesTheSameOnManyThreads) {
  const Mesh box = MakeBox({-1, -1, -1}, {1, 1, 1});
  RayCaster made(box.points, box.triangles);
  const RayCaster caster = std::move(made);
  const auto cast = [&](int i) {
    const Eigen::Vector3d direction(std::cos(0.1 * i), std::sin(0.1 * i), std::cos(0.37 * i));
    return caster.Cast({0.1, 0.2, 0.3}, direction.normalized())->distance;
  };
  std::vector<double> alone(5000), together(5000);
  ParallelFor(1, 0, 5000, [&](int i) { alone[i] = cast(i); });
  ParallelFor(4, 0, 5000, [&](int i) { together[i] = cast(i); });
  EXPECT_EQ(alone, together);
}

TEST(RayCaster, TellsTheDistanceToTheNearestPlaceOnATriangle) {
  const RayCaster caster({{1000, 0, 0}, {1002, 0, 0}, {1000, 2, 0}}, {{0, 1, 2}});
  const auto distance = [&](double x, double y, double z) {
    return caster.DistanceTo({1000 + x, y, z}, 5).value_or(-1);
  };
  EXPECT_NEAR(distance(0.5, 0.5, 0.3), 0.3, 1e-6);       // over the face
  EXPECT_NEAR(distance(1, -0.3, 0.4), 0.5, 1e-6);        // beside an edge
  EXPECT_NEAR(distance(2, 2, 0), std::sqrt(2.0), 1e-6);  // the long one
  EXPECT_NEAR(distance(-2, -2, 1), 3, 1e-6);             // off a corner
  EXPECT_FALSE(caster.DistanceTo({1000.5, 0.5, 6}, 5));
}

}  // namespace
}  // namespace roomtex
