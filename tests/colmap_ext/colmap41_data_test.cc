// Genuine files of COLMAP 4.1.1, beside the checkout: ../shared/data/colmap41.

#include <filesystem>

#include <gmock/gmock.h>

#include "colmap_ext/database.h"
#include "colmap_ext/sparse_model.h"
#include "tests/colmap_ext/sparse_model_maker.h"
#include "tests/support/folders.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

class Colmap41 : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(folder_)) GTEST_SKIP() << "no data: " << folder_ << " does not exist";
  }
  const std::string folder_ = DataFolder("colmap41");
};

TEST_F(Colmap41, BinaryAndTextModelsAreTheSame) {
  const SparseModel binary = ReadSparseModel(folder_ + "/sparse");
  EXPECT_EQ(binary.images.size(), 10u);
  EXPECT_EQ(binary.points.size(), 861u);  // as its text file says
  ExpectSameModel(binary, ReadSparseModel(folder_ + "/sparse_txt"));
}

TEST_F(Colmap41, ModelFitsItsOwnErrors) {
  SparseModel model = ReadSparseModel(folder_ + "/sparse");
  const SparseModel as_written = model;
  const ReprojectionErrors errors = UpdateReprojectionErrors(&model);
  EXPECT_EQ(errors.num_observations, 2783u);  // 278.3 per image, as its text file says
  EXPECT_LT(errors.mean_px, 1.0);
  for (const auto& [id, point] : as_written.points) {
    // COLMAP writes the error of the model before its last bundle adjustment or filter.
    EXPECT_NEAR(model.points.at(id).error, point.error, 0.05) << id;
  }
}

TEST_F(Colmap41, DatabaseAndModelAgree) {
  const Database database(folder_ + "/database.db");
  const SparseModel model = ReadSparseModel(folder_ + "/sparse");
  const auto cameras = database.ReadCameras();
  ASSERT_EQ(cameras.size(), 1u);
  EXPECT_TRUE(cameras.at(1).has_prior_focal_length);
  EXPECT_EQ(cameras.at(1).params, model.cameras.at(1).params);  // was kept fixed
  const auto images = database.ReadImages();
  ASSERT_EQ(images.size(), 10u);
  const auto counts = database.CountKeypoints();
  for (const auto& [id, image] : model.images) {
    EXPECT_EQ(images.at(id).name, image.name);
    EXPECT_EQ(images.at(id).camera_id, image.camera_id);
    EXPECT_EQ(database.ReadKeypoints(id), image.points2d);
    EXPECT_EQ(counts.at(id), image.points2d.size());
  }
}

TEST_F(Colmap41, TracksComeFromTheVerifiedMatches) {
  const Database database(folder_ + "/database.db");
  const SparseModel model = ReadSparseModel(folder_ + "/sparse");
  size_t num_matches = 0, num_same_point = 0, num_contradicting = 0;
  for (const DatabasePair& pair : database.ReadPairs(15)) {
    const auto& ids1 = model.images.at(pair.image_id1).point3d_ids;
    const auto& ids2 = model.images.at(pair.image_id2).point3d_ids;
    for (const Eigen::Vector2i& match : pair.matches) {
      const uint64_t id1 = ids1.at(match[0]), id2 = ids2.at(match[1]);
      ++num_matches;
      if (id1 == kInvalidPoint3dId || id2 == kInvalidPoint3dId) continue;
      (id1 == id2 ? num_same_point : num_contradicting) += 1;
    }
  }
  EXPECT_GT(num_matches, 1000u);
  EXPECT_GT(num_same_point, 10 * num_contradicting);
}

TEST_F(Colmap41, FilesStayAsTheyAre) {
  const std::string path = folder_ + "/database.db";
  const std::string before = ReadBytes(path);
  Database(path).ReadPairs(0);
  EXPECT_TRUE(ReadBytes(path) == before);
  EXPECT_FALSE(fs::exists(path + "-shm"));
  EXPECT_FALSE(fs::exists(path + "-wal"));
}

}  // namespace
}  // namespace roomtex
