#include "colmap_ext/calibration_check.h"

#include <gtest/gtest.h>

#include "tests/colmap_ext/sparse_model_maker.h"

namespace roomtex {
namespace {

Camera MakeCamera(CameraModel model, const std::vector<double>& params) {
  Camera camera;
  camera.camera_id = 1;
  camera.model = model;
  camera.width = 640;
  camera.height = 480;
  camera.params = params;
  return camera;
}

TEST(CalibrationCheck, RicherCamerasProjectTheSame) {
  const std::vector<Camera> cameras = {
      MakeCamera(CameraModel::kSimplePinhole, {500, 320, 240}),
      MakeCamera(CameraModel::kPinhole, {500, 510, 320, 240}),
      MakeCamera(CameraModel::kSimpleRadial, {500, 320, 240, -0.1}),
      MakeCamera(CameraModel::kRadial, {500, 320, 240, -0.1, 0.02}),
      MakeCamera(CameraModel::kOpenCvFisheye, {500, 500, 320, 240, 0.01, 0, 0, 0}),
  };
  for (const Camera& camera : cameras) {
    SparseModel model;
    model.cameras[1] = camera;
    const Camera rich = WithRicherCameras(model).cameras.at(1);
    EXPECT_GE(rich.params.size(), 8u);
    EXPECT_TRUE(rich.Problems().empty());
    for (const Eigen::Vector3d& x_in_cam : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0.4, -0.3, 1),
                                            Eigen::Vector3d(-0.5, 0.2, 1.1)}) {
      const auto before = CameraProjection(camera).ImgFromCam(x_in_cam);
      const auto after = CameraProjection(rich).ImgFromCam(x_in_cam);
      ASSERT_TRUE(before && after);
      EXPECT_LT((*before - *after).norm(), 1e-9) << CameraModelName(camera.model);
    }
  }
}

// Ten points of images 1-3 and five of image 4 alone with image 1.
SparseModel ModelOfTwoKinds() {
  SparseModel model;
  model.cameras[1] = MakeCamera(CameraModel::kPinhole, {500, 500, 320, 240});
  for (uint32_t image_id = 1; image_id <= 4; ++image_id) {
    SparseImage& image = model.images[image_id];
    image.image_id = image_id;
    image.camera_id = 1;
    image.points2d.assign(15, Eigen::Vector2d(10, 10));
    image.point3d_ids.assign(15, kInvalidPoint3dId);
  }
  const auto add = [&](uint64_t point_id, uint32_t row, const std::vector<uint32_t>& images) {
    for (const uint32_t image_id : images) {
      model.points[point_id].track.push_back({image_id, row});
      model.images[image_id].point3d_ids[row] = point_id;
    }
  };
  for (uint32_t i = 0; i < 10; ++i) add(100 + i, i, {1, 2, 3});
  for (uint32_t i = 10; i < 15; ++i) add(100 + i, i, {1, 4});
  return model;
}

TEST(CalibrationCheck, ThinnedModelKeepsEnoughOfEveryImage) {
  const SparseModel thinned = ThinnedModel(ModelOfTwoKinds(), 4);
  std::map<uint32_t, int> count;
  for (const auto& [point_id, point] : thinned.points) {
    for (const TrackElement& element : point.track) {
      ++count[element.image_id];
      EXPECT_EQ(thinned.images.at(element.image_id).point3d_ids[element.point2d_index], point_id);
    }
  }
  for (const uint32_t image_id : {2u, 3u, 4u}) EXPECT_EQ(count[image_id], 4);
  int num_left = 0;
  for (const uint64_t id : thinned.images.at(2).point3d_ids) num_left += id != kInvalidPoint3dId;
  EXPECT_EQ(num_left, 4);
  EXPECT_EQ(ThinnedModel(ModelOfTwoKinds(), 100).points.size(), 15u);
}

// Points that all images see, as in one room: what is kept grows with the images, not with their
// square.
TEST(CalibrationCheck, ThinnedPointsAreOfNoMoreThanADozenImages) {
  for (const uint32_t num_images : {12u, 24u, 96u}) {
    SparseModel model;
    model.cameras[1] = MakeCamera(CameraModel::kPinhole, {500, 500, 320, 240});
    constexpr uint32_t kPoints = 400;
    for (uint32_t image_id = 1; image_id <= num_images; ++image_id) {
      SparseImage& image = model.images[image_id];
      image.image_id = image_id;
      image.camera_id = 1;
      image.points2d.assign(kPoints, Eigen::Vector2d(10, 10));
      for (uint32_t row = 0; row < kPoints; ++row) {
        image.point3d_ids.push_back(row + 1);
        model.points[row + 1].track.push_back({image_id, row});
      }
    }
    constexpr int kPerImage = 40;
    const SparseModel thinned = ThinnedModel(model, kPerImage);
    std::map<uint32_t, int> count;
    size_t num_observations = 0;
    for (const auto& [point_id, point] : thinned.points) {
      EXPECT_EQ(point.track.size(), 12u);
      num_observations += point.track.size();
      for (const TrackElement& element : point.track) ++count[element.image_id];
    }
    EXPECT_EQ(count.size(), num_images);
    for (const auto& [image_id, number] : count) EXPECT_GE(number, kPerImage);
    EXPECT_LE(num_observations, 1.05 * kPerImage * num_images + 12);
  }
}

TEST(CalibrationCheck, AsksForMoreOfFewObservations) {
  CalibrationCheck check;
  check.rms_fixed_px = 0.5;
  check.rms_free_px = 0.44;
  check.redundancy = 5000;
  EXPECT_FALSE(check.Fits());
  check.redundancy = 100;
  EXPECT_TRUE(check.Fits());
  check.rms_free_px = 0.5;
  check.redundancy = 5000;
  EXPECT_TRUE(check.Fits());
}

}  // namespace
}  // namespace roomtex
