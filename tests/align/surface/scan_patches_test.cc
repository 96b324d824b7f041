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
    double best = 0.5;
    for (const ScanPatch& patch : surface.patches())
      best = std::min(best, (patch.point - x).norm());
    const auto nearest = surface.FindNearest(x, 0.5);
    ASSERT_EQ(nearest.has_value(), best < 0.5);
    if (!nearest) continue;
    const ScanPatch& patch = surface.patches()[nearest->patch];
    EXPECT_NEAR((patch.point - x).norm(), best, 1e-12);
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
