// Database::CopyForMapper: what COLMAP is given instead of the user's file.

#include <gtest/gtest.h>

#include "tests/colmap_ext/simulated_database.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

SimulatedViews SmallSet() {
  SimulatedViewsOptions options;
  options.num_views = 3;
  options.num_points = 60;
  options.distortion = options.two_cameras = true;
  return SimulateViews(options);
}

// Everything the mapper reads is the same in both.
void ExpectSameContent(const Database& a, const Database& b) {
  const auto cameras_a = a.ReadCameras(), cameras_b = b.ReadCameras();
  ASSERT_EQ(cameras_a.size(), cameras_b.size());
  for (const auto& [camera_id, camera] : cameras_a) {
    EXPECT_EQ(camera.params, cameras_b.at(camera_id).params);
    EXPECT_EQ(camera.model, cameras_b.at(camera_id).model);
    EXPECT_EQ(camera.has_prior_focal_length, cameras_b.at(camera_id).has_prior_focal_length);
  }
  const auto images_a = a.ReadImages(), images_b = b.ReadImages();
  ASSERT_EQ(images_a.size(), images_b.size());
  for (const auto& [image_id, image] : images_a) {
    EXPECT_EQ(image.name, images_b.at(image_id).name);
    EXPECT_EQ(image.camera_id, images_b.at(image_id).camera_id);
    EXPECT_EQ(a.ReadKeypoints(image_id), b.ReadKeypoints(image_id));
  }
  const auto pairs_a = a.ReadPairs(0), pairs_b = b.ReadPairs(0);
  ASSERT_EQ(pairs_a.size(), pairs_b.size());
  for (size_t i = 0; i < pairs_a.size(); ++i) {
    EXPECT_EQ(pairs_a[i].matches, pairs_b[i].matches);
    EXPECT_EQ(pairs_a[i].config, pairs_b[i].config);
  }
}

TEST(DatabaseCopy, HoldsWhatTheMapperReadsAndNotTheDescriptors) {
  const TempFolder folder;
  WriteSimulatedDatabase(SmallSet(), folder.path());
  {
    SQLite::Database database(folder / "database.db", SQLite::OPEN_READWRITE);
    database.exec("CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY, data BLOB)");
    database.exec("INSERT INTO descriptors VALUES (1, zeroblob(1000000))");
    database.exec("CREATE UNIQUE INDEX index_name ON images(name)");
    database.exec("PRAGMA user_version = 3800");
  }
  const std::string before = ReadBytes(folder / "database.db");
  const Database original(folder / "database.db");
  original.CopyForMapper(folder / "copy.db", Database::Schema::kAsIs);
  ExpectSameContent(original, Database(folder / "copy.db"));
  SQLite::Database copy(folder / "copy.db");
  EXPECT_EQ(copy.execAndGet("SELECT COUNT(*) FROM descriptors").getInt(), 0);
  EXPECT_EQ(copy.execAndGet("PRAGMA user_version").getInt(), 3800);
  EXPECT_EQ(
      copy.execAndGet("SELECT COUNT(*) FROM sqlite_master WHERE name = 'index_name'").getInt(), 1);
  EXPECT_LT(ReadBytes(folder / "copy.db").size(), 400000u);
  EXPECT_EQ(ReadBytes(folder / "database.db"), before);
}

TEST(DatabaseCopy, TurnsTheTablesOf4xIntoThoseOf39) {
  const TempFolder folder;
  const SimulatedViews views = SmallSet();
  {
    DatabaseMaker maker(folder / "database.db", DatabaseMaker::Schema::k41);
    maker.AddCamera(views.cameras.at(1));
    maker.AddCamera(views.cameras.at(2));
    for (const auto& [image_id, image] : views.images) {
      maker.AddImage(image_id, image.name, image.camera_id);
      maker.AddKeypoints(image_id, views.keypoints.at(image_id), 6);
    }
    maker.AddPair(1, 2, {0, 1, 2, 3});
    maker.UseWal();
    maker.AddPair(1, 3, {4, 5}, 6);  // stands in the WAL only
    const Database original(folder / "database.db");
    original.CopyForMapper(folder / "copy.db", Database::Schema::kColmap39);
    ExpectSameContent(original, Database(folder / "copy.db"));
  }
  SQLite::Database copy(folder / "copy.db");
  EXPECT_EQ(copy.execAndGet("SELECT COUNT(prior_qw) FROM images").getInt(), 0);
  EXPECT_EQ(copy.execAndGet("SELECT COUNT(*) FROM sqlite_master WHERE name = 'frames'").getInt(),
            0);
}

}  // namespace
}  // namespace roomtex
