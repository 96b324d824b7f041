// Sparse models in one frame as one.

#include "colmap_ext/model_join.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

// Two photos with these ids and names that both see two points.
SparseModel TwoPhotos(uint32_t first_id, const std::string& name1, const std::string& name2,
                      double focal_length) {
  SparseModel model;
  Camera& camera = model.cameras[1];
  camera.camera_id = 1;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = 100;
  camera.height = 80;
  camera.params = {focal_length, 50, 40};
  for (const uint32_t k : {0u, 1u}) {
    SparseImage& image = model.images[first_id + k];
    image.image_id = first_id + k;
    image.camera_id = 1;
    image.name = k == 0 ? name1 : name2;
    image.cam_from_model.translation.x() = k;
    image.points2d = {{10, 10}, {20, 20}, {30, 30}};
    image.point3d_ids = {7, kInvalidPoint3dId, 8};
    image.frame_id = first_id + k;
  }
  for (const uint64_t id : {7u, 8u}) {
    SparsePoint& point = model.points[id];
    point.x_in_model = {0, 0, static_cast<double>(id)};
    const uint32_t row = id == 7 ? 0 : 2;
    point.track = {{first_id, row}, {first_id + 1, row}};
  }
  return model;
}

void ExpectTracksAnswer(const SparseModel& model) {
  for (const auto& [id, point] : model.points) {
    EXPECT_GE(point.track.size(), 2u);
    for (const TrackElement& element : point.track) {
      EXPECT_EQ(model.images.at(element.image_id).point3d_ids[element.point2d_index], id);
    }
  }
}

TEST(JoinModels, KeepsWhatIsFreeAndGivesTheRestNewIds) {
  const SparseModel one = TwoPhotos(1, "a.jpg", "b.jpg", 80);
  const SparseModel other = TwoPhotos(2, "c.jpg", "d.jpg", 81);  // 2 is taken, and so is camera 1
  const SparseModel joined = JoinModels({&one, &other});
  ASSERT_EQ(joined.images.size(), 4u);
  EXPECT_EQ(joined.points.size(), 4u);
  ASSERT_EQ(joined.cameras.size(), 2u);
  EXPECT_EQ(joined.images.at(1).name, "a.jpg");
  EXPECT_EQ(joined.images.at(2).name, "b.jpg");
  const SparseImage& c = *joined.FindImage("c.jpg");
  EXPECT_EQ(joined.cameras.at(c.camera_id).params[0], 81);
  EXPECT_EQ(joined.cameras.at(joined.images.at(1).camera_id).params[0], 80);
  EXPECT_EQ(c.image_id, joined.images.find(c.image_id)->first);
  EXPECT_NE(c.frame_id, joined.images.at(2).frame_id);
  ExpectTracksAnswer(joined);
  const TempFolder folder;  // and COLMAP's files hold it
  WriteSparseModel(joined, folder / "joined");
  EXPECT_EQ(ReadSparseModel(folder / "joined").images.size(), 4u);
}

TEST(JoinModels, CamerasThatAreTheSameAreOne) {
  const SparseModel one = TwoPhotos(1, "a.jpg", "b.jpg", 80);
  const SparseModel other = TwoPhotos(3, "c.jpg", "d.jpg", 80);
  const SparseModel joined = JoinModels({&one, &other});
  EXPECT_EQ(joined.cameras.size(), 1u);
  EXPECT_EQ(joined.images.rbegin()->first, 4u);
}

TEST(JoinModels, APhotoOfBothIsTheFirstOnes) {
  const SparseModel one = TwoPhotos(1, "a.jpg", "b.jpg", 80);
  SparseModel other = TwoPhotos(2, "b.jpg", "c.jpg", 80);
  other.images.at(2).cam_from_model.translation.x() = 5;
  const SparseModel joined = JoinModels({&one, &other});
  ASSERT_EQ(joined.images.size(), 3u);
  EXPECT_EQ(joined.FindImage("b.jpg")->cam_from_model.translation.x(), 1);
  EXPECT_EQ(joined.points.size(), 2u) << "one photo alone sees no point";
  ExpectTracksAnswer(joined);
}

}  // namespace
}  // namespace roomtex
