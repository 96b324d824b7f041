#include "align/trust/disagreement.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "align/surface/scan_patches.h"
#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

// The points of the sparse model moved by a wave through the room, metres: every second metre or so
// to the other side.
SparseModel Waved(const SimulatedCase& one, double amplitude) {
  const Similarity scan_from_sparse = one.room->ScanFromSparse();
  const Similarity sparse_from_scan = scan_from_sparse.Inverse();
  SparseModel waved = one.model;
  for (auto& [id, point] : waved.points) {
    Eigen::Vector3d x = scan_from_sparse * point.x_in_model;
    const Eigen::Vector3d phase = 2 * x;
    x += amplitude * Eigen::Vector3d(std::sin(phase.y() + phase.z()),
                                     std::sin(phase.z() - phase.x()),
                                     std::sin(phase.x() + phase.y()));
    point.x_in_model = sparse_from_scan * x;
  }
  return waved;
}

ShapeDisagreement Between(const SimulatedCase& one, const SparseModel& model) {
  const ScanPatches surface(one.scans, ScanPatchOptions());
  return FindDisagreement(model, FindSurfacePoints(model, 3, 0.7), surface,
                          one.room->ScanFromSparse(), ScanBend());
}

TEST(Disagreement, IsSmallWhereModelAndScanAreRight) {
  const ShapeDisagreement found = Between(MakeCase(), MakeCase().model);
  EXPECT_GT(found.num_cells, 50);
  EXPECT_LT(found.rms, 0.004);
  EXPECT_EQ(found.photos.size(), MakeCase().model.images.size());
  for (const auto& [id, photo] : found.photos) EXPECT_LT(photo.shift, 0.005) << id;
}

// Points as far off as their own noise lets them be say nothing of the shape.
TEST(Disagreement, IsNotNoise) {
  constexpr double kNoise = 0.01;
  const SimulatedCase& one = MakeCase();
  const ScanPatches surface(one.scans, ScanPatchOptions());
  const Similarity scan_from_sparse = one.room->ScanFromSparse();
  const Similarity sparse_from_scan = scan_from_sparse.Inverse();
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::vector<SurfacePoint> points;
  for (SurfacePoint point : FindSurfacePoints(one.model, 3, 0.7)) {
    const auto on = surface.FindNearest(scan_from_sparse * point.x_in_sparse, 0.02);
    if (!on) continue;
    const ScanPatch& patch = surface.patches()[on->patch];
    point.x_in_sparse = sparse_from_scan * (patch.point + kNoise * normal(random) * patch.normal);
    point.covariance = std::pow(sparse_from_scan.scale * kNoise, 2) * Eigen::Matrix3d::Identity();
    points.push_back(point);
  }
  const auto found = FindDisagreement(one.model, points, surface, scan_from_sparse, ScanBend());
  EXPECT_GT(found.num_cells, 20);
  // With what is below 0 cut off cell by cell 0.38 of the noise would stay.
  EXPECT_LT(found.rms, 0.1 * kNoise);
}

// A wave of this amplitude has a root mean square length of sqrt(3 / 2) times it.
TEST(Disagreement, IsTheSizeOfAWaveThroughTheRoom) {
  for (const double amplitude : {0.02, 0.04}) {
    const ShapeDisagreement found = Between(MakeCase(), Waved(MakeCase(), amplitude));
    const double truth = std::sqrt(1.5) * amplitude;
    EXPECT_GT(found.rms, 0.6 * truth);
    EXPECT_LT(found.rms, 1.3 * truth);
    for (const auto& [id, photo] : found.photos) {
      EXPECT_GT(photo.shift, 0.4 * truth) << id;
      EXPECT_LT(photo.shift, 1.6 * truth) << id;
      // Seen from 0.5 to 6 metres.
      EXPECT_GT(photo.rotation, photo.shift / 6) << id;
      EXPECT_LT(photo.rotation, photo.shift / 0.5) << id;
    }
  }
}

TEST(Disagreement, OfAModelThatIsNowhereNearIsNone) {
  SparseModel far = MakeCase().model;
  TransformModel({1, Eigen::Quaterniond::Identity(), {1000, 0, 0}}, &far);
  const ShapeDisagreement found = Between(MakeCase(), far);
  EXPECT_EQ(found.num_cells, 0);
  EXPECT_EQ(found.rms, 0);
  EXPECT_TRUE(found.photos.empty());
}

}  // namespace
}  // namespace roomtex
