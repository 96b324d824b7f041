#include "align/clicks/scale.h"

#include <gtest/gtest.h>

#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

std::vector<std::vector<Triangle>> MeshesOf(const std::vector<Scan>& scans) {
  std::vector<std::vector<Triangle>> meshes;
  for (const Scan& scan : scans) meshes.push_back(BuildScanMesh(scan, ScanMeshOptions()));
  return meshes;
}

TEST(Scale, IsTheTrueOneUnderTheTruePose) {
  const SimulatedCase& one = MakeCase();
  const auto meshes = MeshesOf(one.scans);
  for (int photo = 0; photo < one.room->NumPhotos(); photo += 5) {
    const SparseImage* image = one.model.FindImage(one.room->PhotoName(photo));
    const ScaleEstimate estimate = EstimateScale(one.model, *image, one.room->CamFromScan(photo),
                                                 one.scans, meshes, ScaleOptions());
    EXPECT_NEAR(estimate.scale / one.room->ScanFromSparse().scale, 1, 1e-3) << photo;
    EXPECT_GT(estimate.num_features, 50) << photo;
    EXPECT_LT(estimate.relative_mad, 0.005) << photo;
  }
}

TEST(Scale, IgnoresOutlierFeatures) {
  SimulatedCase one = MakeCase();
  const int photo = one.room->BestPhotoForPicks();
  const SparseImage* image = one.model.FindImage(one.room->PhotoName(photo));
  int count = 0;
  for (const uint64_t id : image->point3d_ids) {
    if (id == kInvalidPoint3dId || count++ % 4 != 0) continue;
    one.model.points.at(id).x_in_model *= 1.6;  // a quarter of them
  }
  const ScaleEstimate estimate = EstimateScale(one.model, *image, one.room->CamFromScan(photo),
                                               one.scans, MeshesOf(one.scans), ScaleOptions());
  EXPECT_NEAR(estimate.scale / one.room->ScanFromSparse().scale, 1, 3e-3);
}

TEST(Scale, FollowsTheScaleOfTheSparseModel) {
  SimulatedCase one = MakeCase();
  const int photo = one.room->BestPhotoForPicks();
  const auto meshes = MeshesOf(one.scans);
  const auto estimate = [&] {
    return EstimateScale(one.model, *one.model.FindImage(one.room->PhotoName(photo)),
                         one.room->CamFromScan(photo), one.scans, meshes, ScaleOptions());
  };
  const ScaleEstimate before = estimate();
  TransformModel({0.01, Eigen::Quaterniond::UnitRandom(), {1, 2, 3}}, &one.model);
  const ScaleEstimate after = estimate();
  EXPECT_NEAR(after.scale * 0.01 / before.scale, 1, 1e-9);
  EXPECT_EQ(after.num_features, before.num_features);
}

TEST(Scale, HasNoFeaturesWhenTheCameraLooksAwayFromTheScan) {
  const SimulatedCase& one = MakeCase();
  const int photo = one.room->BestPhotoForPicks();
  Rigid pose = one.room->CamFromScan(photo);
  pose.translation += Eigen::Vector3d(0, 0, -100);  // everything behind the camera
  const ScaleEstimate estimate =
      EstimateScale(one.model, *one.model.FindImage(one.room->PhotoName(photo)), pose, one.scans,
                    MeshesOf(one.scans), ScaleOptions());
  EXPECT_EQ(estimate.num_features, 0);
}

}  // namespace
}  // namespace roomtex
