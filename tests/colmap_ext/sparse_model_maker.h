#pragma once
// A small sparse model with known truth: every keypoint with a point is its exact projection.

#include <random>
#include <string>

#include <gtest/gtest.h>

#include "colmap_ext/sparse_model.h"

namespace roomtex {

struct SparseModelMakerOptions {
  int num_images = 4;
  int num_points = 25;
  int num_free_keypoints = 5;  // per image, without a point
};

// Ids are neither consecutive nor in the order of the names; one name has spaces; the last image
// has no keypoints at all; coordinates are numbers that no short decimal fraction hits.
inline SparseModel MakeSparseModel(const SparseModelMakerOptions& options = {}) {
  SparseModel model;
  Camera camera;
  camera.camera_id = 3;
  camera.model = CameraModel::kSimpleRadial;
  camera.width = 640;
  camera.height = 480;
  camera.params = {512.3456789, 320.25, 240.125, -0.0301};
  model.cameras[3] = camera;
  camera.camera_id = 12;
  camera.model = CameraModel::kOpenCv;
  camera.params = {600.1, 601.2, 319.5, 241, -0.05, 0.011, 1e-4, -2.5e-5};
  model.cameras[12] = camera;

  std::mt19937 random(1);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * (random() / 4294967296.0);
  };
  for (int i = 0; i < options.num_images; ++i) {
    SparseImage image;
    image.image_id = 50 - 7 * i;
    image.camera_id = i % 2 == 0 ? 3 : 12;
    image.name = i == 1 ? "second folder/photo 1.jpg" : "photo" + std::to_string(i) + ".jpg";
    image.cam_from_model.rotation =
        Eigen::Quaterniond(1, uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.1, 0.1))
            .normalized();
    image.cam_from_model.translation = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    if (i + 1 < options.num_images) {
      for (int k = 0; k < options.num_free_keypoints; ++k) {
        image.points2d.emplace_back(uniform(0, 640), uniform(0, 480));
        image.point3d_ids.push_back(kInvalidPoint3dId);
      }
    }
    model.images[image.image_id] = image;
  }
  for (int p = 0; p < options.num_points; ++p) {
    const uint64_t id = 1000 + 3 * p + (p == 0 ? (1ull << 40) : 0);
    SparsePoint& point = model.points[id];
    point.x_in_model = {uniform(-2, 2), uniform(-2, 2), uniform(6, 9)};
    point.color = {static_cast<uint8_t>(p), static_cast<uint8_t>(255 - p), 128};
    point.error = uniform(0, 2);
    for (int i = 0; i + 1 < options.num_images; ++i) {
      SparseImage& image = model.images.at(50 - 7 * i);
      const auto x_in_img = CameraProjection(model.cameras.at(image.camera_id))
                                .ImgFromCam(image.cam_from_model * point.x_in_model);
      point.track.push_back({image.image_id, static_cast<uint32_t>(image.points2d.size())});
      image.points2d.push_back(x_in_img.value());
      image.point3d_ids.push_back(id);
    }
  }
  return model;
}

// Bit by bit.
inline void ExpectSameModel(const SparseModel& a, const SparseModel& b) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  ASSERT_EQ(a.images.size(), b.images.size());
  ASSERT_EQ(a.points.size(), b.points.size());
  for (const auto& [id, camera] : a.cameras) {
    const Camera& other = b.cameras.at(id);
    EXPECT_EQ(camera.camera_id, other.camera_id);
    EXPECT_EQ(camera.model, other.model);
    EXPECT_EQ(camera.width, other.width);
    EXPECT_EQ(camera.height, other.height);
    EXPECT_EQ(camera.params, other.params);
  }
  for (const auto& [id, image] : a.images) {
    const SparseImage& other = b.images.at(id);
    EXPECT_EQ(image.image_id, other.image_id);
    EXPECT_EQ(image.camera_id, other.camera_id);
    EXPECT_EQ(image.name, other.name);
    EXPECT_EQ(image.cam_from_model.rotation.coeffs(), other.cam_from_model.rotation.coeffs());
    EXPECT_EQ(image.cam_from_model.translation, other.cam_from_model.translation);
    EXPECT_EQ(image.points2d, other.points2d);
    EXPECT_EQ(image.point3d_ids, other.point3d_ids);
  }
  for (const auto& [id, point] : a.points) {
    const SparsePoint& other = b.points.at(id);
    EXPECT_EQ(point.x_in_model, other.x_in_model);
    EXPECT_EQ(point.color, other.color);
    EXPECT_EQ(point.error, other.error);
    ASSERT_EQ(point.track.size(), other.track.size());
    for (size_t i = 0; i < point.track.size(); ++i) {
      EXPECT_EQ(point.track[i].image_id, other.track[i].image_id);
      EXPECT_EQ(point.track[i].point2d_index, other.track[i].point2d_index);
    }
  }
}

}  // namespace roomtex
