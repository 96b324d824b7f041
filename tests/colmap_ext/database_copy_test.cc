// Database::CopyForMapper: what COLMAP is given instead of the user's file.

#include <gtest/gtest.h>

#include "core/error.h"
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

// Lenses that photos share or that were found reach COLMAP 4.x, too: its rigs and frames name the
// cameras once more.
TEST(DatabaseCopy, GivesPhotosOfA4xDatabaseOtherCameras) {
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
    maker.Run("INSERT INTO pose_priors VALUES (1, NULL, 2, 1, 0)");
  }
  const Database original(folder / "database.db");
  original.CopyForMapper(folder / "copy.db", Database::Schema::kAsIs);
  std::map<uint32_t, Camera> cameras = {{7, views.cameras.at(1)}};
  cameras[7].camera_id = 7;
  cameras[7].params[0] = 1234;
  std::map<uint32_t, DatabaseImage> images = original.ReadImages();
  for (auto& [id, image] : images) image.camera_id = 7;
  ASSERT_TRUE(Database::SetCameras(folder / "copy.db", cameras, images));
  {
    const Database changed(folder / "copy.db");
    ASSERT_EQ(changed.ReadCameras().size(), 1u);
    EXPECT_EQ(changed.ReadCameras().at(7).params, cameras[7].params);
    for (const auto& [id, image] : changed.ReadImages()) EXPECT_EQ(image.camera_id, 7u);
  }
  SQLite::Database copy(folder / "copy.db");
  const auto count = [&](const std::string& of) {
    return copy.execAndGet("SELECT COUNT(*) FROM " + of).getInt();
  };
  EXPECT_EQ(count("rigs"), 1);
  EXPECT_EQ(count("rigs WHERE rig_id = 7 AND ref_sensor_id = 7 AND ref_sensor_type = 0"), 1);
  EXPECT_EQ(count("frames WHERE rig_id = 7"), static_cast<int>(images.size()));
  EXPECT_EQ(count("frame_data WHERE frame_id = data_id AND sensor_id = 7 AND sensor_type = 0"),
            static_cast<int>(images.size()));
  EXPECT_EQ(count("pose_priors WHERE corr_sensor_id = 7"), 1);
}

TEST(DatabaseCopy, LeavesTheCamerasOfRigsAlone) {
  const TempFolder folder;
  const SimulatedViews views = SmallSet();
  {
    DatabaseMaker maker(folder / "database.db", DatabaseMaker::Schema::k41);
    maker.AddCamera(views.cameras.at(1));
    maker.AddCamera(views.cameras.at(2));
    for (const auto& [id, image] : views.images) maker.AddImage(id, image.name, image.camera_id);
    maker.Run("INSERT INTO rig_sensors VALUES (1, 2, 0, NULL)");
  }
  const Database original(folder / "database.db");
  original.CopyForMapper(folder / "copy.db", Database::Schema::kAsIs);
  const std::string before = ReadBytes(folder / "copy.db");
  EXPECT_FALSE(Database::SetCameras(folder / "copy.db", {}, original.ReadImages()));
  EXPECT_EQ(ReadBytes(folder / "copy.db"), before);
}

// What a database may carry beside data. Every road by which we use it is gone: nothing of this is
// run, the copies hold tables and rows alone, and the file itself stays as it was.
class CraftedDatabase : public testing::TestWithParam<const char*> {};

TEST_P(CraftedDatabase, IsDataAndNoProgram) {
  const TempFolder folder;
  const std::string path = folder / "database.db", elsewhere = folder / "elsewhere.db";
  WriteSimulatedDatabase(SmallSet(), folder.path());
  {
    SQLite::Database(elsewhere, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)
        .exec("CREATE TABLE precious (x)");
  }
  {
    SQLite::Database database(path, SQLite::OPEN_READWRITE);
    std::string sql = GetParam();
    const size_t place = sql.find("ELSEWHERE");
    if (place != std::string::npos) sql.replace(place, 9, elsewhere);
    database.exec(sql);
  }
  const std::string before = ReadBytes(path), precious = ReadBytes(elsewhere);
  try {
    const Database database(path);
    database.CopyForMapper(folder / "copy.db", Database::Schema::kAsIs);
    database.CopyForMapper(folder / "copy39.db", Database::Schema::kColmap39);
    database.CopyWithCameras(folder / "calibrated.db", database.ReadCameras());
    database.CopyWithMatches(folder / "merged.db", {&database});
    for (const char* copy : {"copy.db", "copy39.db", "calibrated.db", "merged.db"}) {
      SQLite::Database made(folder / copy);
      EXPECT_EQ(made.execAndGet("SELECT COUNT(*) FROM sqlite_master WHERE type NOT IN ('table', "
                                "'index') OR name LIKE '%evil%'")
                    .getInt(),
                0);
    }
    ExpectSameContent(database, Database(folder / "calibrated.db"));
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("COLMAP"), std::string::npos) << error.what();
  }
  EXPECT_EQ(ReadBytes(path), before);
  EXPECT_EQ(ReadBytes(elsewhere), precious);
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, CraftedDatabase,
    testing::Values(
        // SQL behind the end of a schema entry.
        "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = sql || '; ATTACH "
        "''ELSEWHERE'' "
        "AS e; DROP TABLE e.precious' WHERE name = 'keypoints'",
        "CREATE TRIGGER evil AFTER UPDATE ON cameras BEGIN DELETE FROM images; END",
        "CREATE TRIGGER evil AFTER INSERT ON cameras BEGIN DELETE FROM images; END",
        "CREATE INDEX evil_index ON images(hex(zeroblob(100000)))", "CREATE TABLE evil (x)",
        // A view that never ends in the place of a table.
        "DROP TABLE two_view_geometries; CREATE VIEW two_view_geometries AS WITH RECURSIVE "
        "n(pair_id) AS (SELECT 1 UNION ALL SELECT pair_id + 1 FROM n) SELECT pair_id, 0 AS rows, 0 "
        "AS cols, NULL AS data, 0 AS config FROM n",
        // A column that is computed.
        "ALTER TABLE images ADD COLUMN evil TEXT GENERATED ALWAYS AS (hex(zeroblob(50000000)))",
        "ALTER TABLE cameras ADD COLUMN \"a\"\"b; DROP TABLE images\" INTEGER"));

}  // namespace
}  // namespace roomtex
