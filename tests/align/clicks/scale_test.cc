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

// A mesh that was simplified: a wall of two triangles, 20 m wide, of which a photo shows the
// middle.
TEST(Scale, IsFoundOnAWallOfTwoTriangles) {
  Scan wall;
  wall.organised = false;
  wall.points = {{-10, -10, 3}, {10, -10, 3}, {10, 10, 3}, {-10, 10, 3}};
  wall.triangles = {{0, 1, 2}, {0, 2, 3}};
  SparseModel model;
  Camera& camera = model.cameras[1];
  camera.camera_id = 1;
  camera.model = CameraModel::kPinhole;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500, 500, 320, 240};
  SparseImage& image = model.images[1];
  image.image_id = image.camera_id = 1;
  image.name = "a.jpg";
  for (uint64_t id = 1; id <= 80; ++id) {
    const Eigen::Vector2d x_in_img(10.0 + 7.5 * static_cast<double>(id),
                                   20.0 + 37.0 * static_cast<double>(id % 12));
    model.points[id].x_in_model =
        1.5 * Eigen::Vector3d((x_in_img.x() - 320) / 500, (x_in_img.y() - 240) / 500, 1);
    image.points2d.push_back(x_in_img);
    image.point3d_ids.push_back(id);
  }
  const ScaleEstimate estimate =
      EstimateScale(model, image, Rigid(), {wall}, {wall.triangles}, ScaleOptions());
  EXPECT_EQ(estimate.num_features, 80);
  EXPECT_NEAR(estimate.scale, 2,
              1e-7);  // rays are cast in floats; processors differ in their last bit
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
