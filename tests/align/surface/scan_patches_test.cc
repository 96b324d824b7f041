#include "align/surface/scan_patches.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

TEST(ScanPatches, LieOnTheSurfaceWithinTheNoise) {
  const SimulatedCase& one = MakeCase();
  const ScanPatches surface(one.scans, ScanPatchOptions());
  EXPECT_GT(surface.patches().size(), 5000u);
  // Range noise of 2 mm, seen at a slant and averaged over few samples: less, but the same order.
  EXPECT_GT(surface.TypicalThickness(), 0.0005);
  EXPECT_LT(surface.TypicalThickness(), 0.002);
  for (const ScanPatch& patch : surface.patches()) {
    EXPECT_NEAR(patch.normal.norm(), 1, 1e-9);
  }
}

TEST(ScanPatches, FindTheNearestAsASearchThroughAllDoes) {
  const SimulatedCase& one = MakeCase();
  const ScanPatches surface(one.scans, ScanPatchOptions());
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-3, 3);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d x(uniform(random), uniform(random), uniform(random));
    const auto power = [&x](const ScanPatch& patch) {
      return (patch.point - x).squaredNorm() - patch.size * patch.size / 4;
    };
    double best = 1e9;
    for (const ScanPatch& patch : surface.patches()) {
      if ((patch.point - x).norm() < std::hypot(0.5, patch.size))
        best = std::min(best, power(patch));
    }
    const auto nearest = surface.FindNearest(x, 0.5);
    ASSERT_EQ(nearest.has_value(), best < 1e9);
    if (!nearest) continue;
    const ScanPatch& patch = surface.patches()[nearest->patch];
    EXPECT_NEAR(power(patch), best, 1e-12);
    EXPECT_NEAR(nearest->distance, patch.normal.dot(x - patch.point), 1e-12);
  }
}

TEST(ScanPatches, PointTheirNormalsTowardsTheScanner) {
  const SimulatedCase& one = MakeCase();
  const ScanPatches surface(one.scans, ScanPatchOptions());
  ASSERT_GT(surface.patches().size(), 100u);
  for (const ScanPatch& patch : surface.patches()) {
    // Some samples of a cube may be seen at a grazing angle, so allow for a little.
    const Eigen::Vector3d to_scanner = (one.scans[0].Station() - patch.point).normalized();
    EXPECT_GT(patch.normal.dot(to_scanner), -0.2);
  }
}

TEST(ScanPatches, CoverTheTrianglesOfAMeshWithoutAGrid) {
  Scan mesh;
  mesh.organised = false;
  mesh.points = {{0, 0, 1}, {2, 0, 1}, {2, 2, 1}, {0, 2, 1}};
  mesh.num_columns = 4;
  mesh.num_rows = 1;
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  const ScanPatches surface({mesh}, ScanPatchOptions());
  const auto nearest = surface.FindNearest({1.3, 0.4, 1.1}, 0.3);
  ASSERT_TRUE(nearest.has_value());
  EXPECT_NEAR(std::abs(nearest->distance), 0.1, 1e-9);
}

// In the middle of cubes of 24 cm and more.
constexpr double kPlaneZ = 1.1;

// Samples of the plane at kPlaneZ, `step` apart, off by the noise; seen from z = 3.
Scan Plane(double step, double noise) {
  Scan scan;
  scan.organised = false;
  scan.scan_from_station.translation = {1.5, 1.5, 3};
  std::mt19937 random(8);
  std::normal_distribution<double> normal(0, noise);
  for (double x = 0; x < 3; x += step) {
    for (double y = 0; y < 3; y += step) scan.points.emplace_back(x, y, kPlaneZ + normal(random));
  }
  return scan;
}

TEST(ScanPatches, AreLargerWhereAScanIsCoarseOrNoisy) {
  ScanPatchOptions of_one_size;
  of_one_size.max_cell_size = of_one_size.cell_size;
  // Few samples; enough of them, but a cube of 6 cm is as thick as wide.
  for (const Scan& scan : {Plane(0.1, 0.004), Plane(0.02, 0.02)}) {
    EXPECT_LT(ScanPatches({scan}, of_one_size).patches().size(), 100u);  // of 2500 cubes
    const ScanPatches surface({scan}, ScanPatchOptions());
    for (double x = 0.1; x < 2.9; x += 0.07) {
      const auto nearest = surface.FindNearest({x, 1.4, kPlaneZ + 0.2}, 0.2);
      ASSERT_TRUE(nearest.has_value()) << x;
      EXPECT_NEAR(nearest->distance, 0.2, 0.02) << x;
      EXPECT_GT(surface.patches()[nearest->patch].size, 0.1) << x;
    }
  }
}

TEST(ScanPatches, WhatIsLeftBesideAFineSurfaceMakesNone) {
  Scan scan = Plane(0.01, 0.001);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> across(0, 3), off(0.05, 0.3);
  for (int i = 0; i < 3000; ++i) {
    scan.points.emplace_back(across(random), across(random), kPlaneZ + off(random));
  }
  const ScanPatches surface({scan}, ScanPatchOptions());
  EXPECT_GT(surface.patches().size(), 2000u);
  for (const ScanPatch& patch : surface.patches()) {
    EXPECT_NEAR(patch.point.z(), kPlaneZ, 0.005);
  }
}

TEST(ScanPatches, OfAnEmptyScanFindNothing) {
  Scan empty;
  empty.num_columns = empty.num_rows = 2;
  empty.points.assign(4, Scan::MissingPoint());
  empty.intensity.assign(4, 0);
  const ScanPatches surface({empty}, ScanPatchOptions());
  EXPECT_FALSE(surface.FindNearest({0, 0, 0}, 10).has_value());
  EXPECT_EQ(surface.TypicalThickness(), 0);
}

}  // namespace
}  // namespace roomtex
