#include "colmap_ext/duplicate_photos.h"

#include <gtest/gtest.h>

#include "core/frames.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

using Duplicates = std::map<uint32_t, uint32_t>;

// Photos 1 and 3 of one place, taken twice; 2 from beside. Points of all of them, and some that
// only the two have.
SparseModel Model(double between_copies_px) {
  SparseModel model;
  Camera camera;
  camera.camera_id = 1;
  camera.model = CameraModel::kPinhole;
  camera.width = 800;
  camera.height = 600;
  camera.params = {700, 700, 400, 300};
  model.cameras[1] = camera;
  const CameraProjection projection(camera);
  const char* const names[] = {"", "b.jpg", "c.jpg", "a.jpg"};
  for (uint32_t id = 1; id <= 3; ++id) {
    SparseImage& image = model.images[id];
    image.image_id = id;
    image.camera_id = 1;
    image.name = names[id];
    if (id == 2) image.cam_from_model.translation.x() = 1;
  }
  RandomStream random(5);
  for (uint64_t id = 1; id <= 120; ++id) {
    SparsePoint& point = model.points[id];
    point.x_in_model << random.Uniform(-0.8, 0.3), random.Uniform(-0.8, 0.8), random.Uniform(3, 5);
    for (auto& [image_id, image] : model.images) {
      if (image_id == 2 && id > 100) continue;
      const double shift = image_id == 3 ? between_copies_px : 0;
      const Eigen::Vector2d x = *projection.ImgFromCam(image.cam_from_model * point.x_in_model);
      point.track.push_back({image_id, static_cast<uint32_t>(image.points2d.size())});
      image.points2d.push_back(x + Eigen::Vector2d(shift, 0));
      image.point3d_ids.push_back(id);
    }
  }
  return model;
}

TEST(DuplicatePhotos, AreThoseOfOnePlaceAndDirection) {
  EXPECT_EQ(FindDuplicates(Model(0.3), {}), (Duplicates{{1, 3}}));  // a.jpg comes first
  EXPECT_EQ(FindDuplicates(Model(4), {}), Duplicates());
}

TEST(DuplicatePhotos, ThatAreNamedStay) {
  EXPECT_EQ(FindDuplicates(Model(0), {"b.jpg"}), (Duplicates{{3, 1}}));
  EXPECT_EQ(FindDuplicates(Model(0), {"a.jpg", "b.jpg"}), Duplicates());
}

TEST(DuplicatePhotos, WithFarFewerPointsAreNone) {
  SparseModel model = Model(0);
  // Photo 1 shows a part of what 3 shows, as one of another room with the same wallpaper may.
  SparseImage& image = model.images.at(1);
  for (auto& [id, point] : model.points) {
    if (id <= 40) continue;
    image.point3d_ids[point.track.front().point2d_index] = kInvalidPoint3dId;
    point.track.erase(point.track.begin());
  }
  EXPECT_EQ(FindDuplicates(model, {}), Duplicates());
}

TEST(DuplicatePhotos, OfARigAreNone) {
  SparseModel model = Model(0);
  for (auto& [id, image] : model.images) image.frame_id = id;
  EXPECT_EQ(FindDuplicates(model, {}), Duplicates());
}

TEST(DuplicatePhotos, GoWithThePointsThatRestOnThemAndComeBackWithTheirPhoto) {
  const SparseModel input = Model(0.3);
  const Duplicates duplicates = FindDuplicates(input, {});
  std::set<uint32_t> image_ids;
  for (const auto& [id, of] : duplicates) image_ids.insert(id);
  SparseModel model = WithoutPhotos(input, image_ids);
  EXPECT_EQ(model.images.size(), 2u);
  EXPECT_EQ(model.points.size(), 100u);
  for (const auto& [id, point] : model.points) EXPECT_EQ(point.track.size(), 2u);
  for (const uint64_t id : model.images.at(3).point3d_ids)
    EXPECT_TRUE(id <= 100 || id == kInvalidPoint3dId);

  const Similarity aligned{
      2, Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY())), {1, 2, 3}};
  TransformModel(aligned, &model);
  PutDuplicatesBack(input, duplicates, aligned.scale, &model);
  SparseModel truth = input;
  TransformModel(aligned, &truth);
  for (const auto& [id, image] : truth.images) {
    const Rigid& found = model.images.at(id).cam_from_model;
    EXPECT_LT(RotationAngle(found.rotation, image.cam_from_model.rotation), 1e-9) << id;
    EXPECT_LT((found.translation - image.cam_from_model.translation).norm(), 1e-9) << id;
  }
  for (const auto& [id, point] : model.points) EXPECT_EQ(point.track.size(), 3u);
  for (const uint64_t id : model.images.at(1).point3d_ids)
    EXPECT_TRUE(id <= 100 || id == kInvalidPoint3dId);
}

}  // namespace
}  // namespace roomtex
