#include "colmap_ext/database.h"

#include <filesystem>
#include <limits>
#include <map>

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "tests/colmap_ext/database_maker.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using Schema = DatabaseMaker::Schema;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

Camera TestCamera(uint32_t camera_id, bool prior) {
  Camera camera;
  camera.camera_id = camera_id;
  camera.model = CameraModel::kOpenCv;
  camera.width = 640;
  camera.height = 480;
  camera.params = {500.25, 501.5, 320, 240, -0.1, 0.02, 1e-3, -2e-3};
  camera.has_prior_focal_length = prior;
  return camera;
}

// Two cameras, four images (ids not in the order of the names), keypoints with 2, 4 and 6 columns
// and none, one pair with three matches, one with one, one without.
void FillDatabase(DatabaseMaker* maker) {
  maker->AddCamera(TestCamera(1, true));
  maker->AddCamera(TestCamera(7, false));
  maker->AddImage(1, "b.jpg", 1);
  maker->AddImage(2, "folder/a b.jpg", 1);
  maker->AddImage(9, "c.jpg", 7);
  maker->AddImage(10, "without keypoints.jpg", 7);
  maker->AddKeypoints(1, {{0.5, 1.25}, {2.5, 3}, {4, 5}}, 6);
  maker->AddKeypoints(2, {{10, 11}, {12, 13}, {14, 15}, {16, 17}}, 4);
  maker->AddKeypoints(9, {{20, 21}}, 2);
  maker->AddPair(1, 2, {0, 3, 1, 1, 2, 0}, 6);
  maker->AddPair(9, 1, {2, 0}, 2);
  maker->AddPair(2, 9, {}, 1);
}

class DatabaseOfBothSchemas : public testing::TestWithParam<Schema> {
 protected:
  TempFolder folder_;
  const std::string path_ = folder_ / "database.db";
};
INSTANTIATE_TEST_SUITE_P(Colmap, DatabaseOfBothSchemas, testing::Values(Schema::k38, Schema::k41),
                         [](const auto& schema) {
                           return schema.param == Schema::k38 ? "Version38" : "Version41";
                         });

void ExpectFilled(const Database& database) {
  const std::map<uint32_t, Camera> cameras = database.ReadCameras();
  ASSERT_THAT(cameras, SizeIs(2));
  EXPECT_EQ(cameras.at(1).params, TestCamera(1, true).params);
  EXPECT_EQ(cameras.at(1).model, CameraModel::kOpenCv);
  EXPECT_EQ(cameras.at(1).width, 640);
  EXPECT_EQ(cameras.at(1).height, 480);
  EXPECT_TRUE(cameras.at(1).has_prior_focal_length);
  EXPECT_FALSE(cameras.at(7).has_prior_focal_length);

  const std::map<uint32_t, DatabaseImage> images = database.ReadImages();
  ASSERT_THAT(images, SizeIs(4));
  EXPECT_EQ(images.at(2).name, "folder/a b.jpg");
  EXPECT_EQ(images.at(9).camera_id, 7u);

  EXPECT_THAT(database.CountKeypoints(),
              ElementsAre(std::pair(1u, 3u), std::pair(2u, 4u), std::pair(9u, 1u)));
  EXPECT_THAT(
      database.ReadKeypoints(1),
      ElementsAre(Eigen::Vector2d(0.5, 1.25), Eigen::Vector2d(2.5, 3), Eigen::Vector2d(4, 5)));
  EXPECT_THAT(database.ReadKeypoints(2),
              ElementsAre(Eigen::Vector2d(10, 11), Eigen::Vector2d(12, 13), Eigen::Vector2d(14, 15),
                          Eigen::Vector2d(16, 17)));
  EXPECT_THAT(database.ReadKeypoints(9), ElementsAre(Eigen::Vector2d(20, 21)));
  EXPECT_THAT(database.ReadKeypoints(10), IsEmpty());

  const std::vector<DatabasePair> pairs = database.ReadPairs(1);
  ASSERT_THAT(pairs, SizeIs(2));
  EXPECT_EQ(pairs[0].image_id1, 1u);
  EXPECT_EQ(pairs[0].image_id2, 2u);
  EXPECT_EQ(pairs[0].config, 6);
  EXPECT_THAT(pairs[0].matches,
              ElementsAre(Eigen::Vector2i(0, 3), Eigen::Vector2i(1, 1), Eigen::Vector2i(2, 0)));
  EXPECT_EQ(pairs[1].image_id1, 1u);
  EXPECT_EQ(pairs[1].image_id2, 9u);
  EXPECT_THAT(database.ReadPairs(2), SizeIs(1));
  EXPECT_THAT(database.ReadPairs(0), SizeIs(3));
}

TEST_P(DatabaseOfBothSchemas, GivesEverythingThatWasWritten) {
  {
    DatabaseMaker maker(path_, GetParam());
    FillDatabase(&maker);
  }
  ExpectFilled(Database(path_));
}

// Names of all files in a folder with their bytes.
std::map<std::string, std::string> Snapshot(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    files[entry.path().filename().string()] = ReadBytes(entry.path().string());
  }
  return files;
}

TEST_P(DatabaseOfBothSchemas, LeavesTheFolderAsItWas) {
  for (const bool wal : {false, true}) {
    const TempFolder folder;
    {
      DatabaseMaker maker(folder / "database.db", GetParam());
      if (wal) maker.UseWal();
      FillDatabase(&maker);
    }
    const auto before = Snapshot(folder.path());
    ASSERT_THAT(before, SizeIs(1));
    ExpectFilled(Database(folder / "database.db"));
    EXPECT_EQ(Snapshot(folder.path()), before) << "WAL " << wal;
  }
}

TEST_P(DatabaseOfBothSchemas, SeesRowsThatOnlyTheWalHolds) {
  DatabaseMaker maker(path_, GetParam());
  maker.UseWal();
  FillDatabase(&maker);
  ASSERT_GT(fs::file_size(path_ + "-wal"), 0u);
  const std::string bytes = ReadBytes(path_), wal_bytes = ReadBytes(path_ + "-wal");
  ExpectFilled(Database(path_));
  EXPECT_EQ(ReadBytes(path_), bytes);
  EXPECT_EQ(ReadBytes(path_ + "-wal"), wal_bytes);
}

TEST_P(DatabaseOfBothSchemas, SeesTheWalOfAKilledWriterWithoutItsSharedMemoryFile) {
  DatabaseMaker maker(path_, GetParam());
  maker.UseWal();
  FillDatabase(&maker);
  const TempFolder killed;
  fs::copy_file(path_, killed / "database.db");
  fs::copy_file(path_ + "-wal", killed / "database.db-wal");
  const auto before = Snapshot(killed.path());
  ExpectFilled(Database(killed / "database.db"));
  EXPECT_EQ(Snapshot(killed.path()), before);
}

// Runs the body as a user without rights, in a process of its own (root may write everywhere).
template <typename Body>
bool SucceedsWithoutRights(const Body& body) {
  const pid_t child = fork();
  if (child == 0) {
    if (geteuid() == 0 && (setgid(65534) != 0 || setuid(65534) != 0)) _exit(3);
    bool success = false;
    try {
      success = body();
    } catch (const std::exception& error) {
      fprintf(stderr, "%s\n", error.what());
    }
    _exit(success ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

TEST_P(DatabaseOfBothSchemas, IsReadInAFolderThatMayNotBeWritten) {
  enum Case { kRollback, kWal, kWalWithRows, kWalWithRowsAndSharedMemory };
  for (const Case c : {kRollback, kWal, kWalWithRows, kWalWithRowsAndSharedMemory}) {
    const TempFolder written, locked;
    {
      DatabaseMaker maker(written / "database.db", GetParam());
      if (c != kRollback) maker.UseWal();
      FillDatabase(&maker);
      if (c >= kWalWithRows) {
        fs::copy(written.path(), locked.path());  // while the rows are in the WAL
        if (c == kWalWithRows) fs::remove(locked / "database.db-shm");
      }
    }
    if (c < kWalWithRows) fs::copy(written.path(), locked.path());
    for (const auto& entry : fs::directory_iterator(locked.path())) {
      fs::permissions(entry.path(), fs::perms(0444));
    }
    fs::permissions(locked.path(), fs::perms(0555));
    const auto before = Snapshot(locked.path());
    EXPECT_TRUE(SucceedsWithoutRights([&] {
      const Database database(locked / "database.db");
      return database.ReadImages().size() == 4 && database.ReadPairs(1).size() == 2 &&
             database.ReadCameras().size() == 2;
    })) << "case "
        << c;
    EXPECT_EQ(Snapshot(locked.path()), before) << "case " << c;
    fs::permissions(locked.path(), fs::perms(0755));
  }
}

TEST_P(DatabaseOfBothSchemas, ReadsPathsWithSpecialCharacters) {
  const std::string path = folder_ / "50% of #1? really & \"quoted\".db";
  {
    DatabaseMaker maker(path, GetParam());
    FillDatabase(&maker);
  }
  ExpectFilled(Database(path));
}

TEST(PairId, IsColmapsFormulaAndItsInverse) {
  EXPECT_EQ(PairIdFromImages(1, 2), 2147483649u);
  EXPECT_EQ(PairIdFromImages(2, 1), 2147483649u);
  for (const auto& [a, b] : {std::pair(1u, 2u), std::pair(0u, 7u), std::pair(3u, 2147483646u)}) {
    EXPECT_EQ(ImagesFromPairId(PairIdFromImages(a, b)), std::pair(a, b));
    EXPECT_EQ(ImagesFromPairId(PairIdFromImages(b, a)), std::pair(a, b));
  }
}

class BadDatabase : public testing::Test {
 protected:
  // A good database, then `sql` run on it.
  void Make(const std::string& sql) {
    DatabaseMaker maker(path_, Schema::k38);
    FillDatabase(&maker);
    if (!sql.empty()) maker.Run(sql);
  }
  TempFolder folder_;
  const std::string path_ = folder_ / "database.db";
};

TEST_F(BadDatabase, IsRefusedWhenMissingAFolderEmptyOrNoDatabase) {
  EXPECT_INPUT_ERROR(Database(folder_ / "missing.db"), "does not exist");
  EXPECT_INPUT_ERROR(Database(folder_.path()), "is a folder");
  WriteBytes(path_, "");
  EXPECT_INPUT_ERROR(Database{path_}, "is empty");
  WriteBytes(path_, "SQLite format 3");
  EXPECT_INPUT_ERROR(Database{path_}, "is not an SQLite database");
  WriteBytes(path_, std::string(5000, 'x'));
  EXPECT_INPUT_ERROR(Database{path_}, "is not an SQLite database");
}

TEST_F(BadDatabase, IsRefusedWhenNotColmaps) {
  SQLite::Database(path_, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)
      .exec("CREATE TABLE songs (title TEXT)");
  EXPECT_INPUT_ERROR(Database{path_}, "not COLMAP's: it has no table cameras");
}

TEST_F(BadDatabase, IsRefusedWhenAColumnIsMissing) {
  Make("ALTER TABLE keypoints RENAME COLUMN cols TO columns");
  EXPECT_INPUT_ERROR(Database{path_}, "table keypoints: is not COLMAP's: it has no column cols");
}

void ReadEverything(const std::string& path) {
  const Database database(path);
  database.ReadCameras();
  for (const auto& [id, image] : database.ReadImages()) database.ReadKeypoints(id);
  database.CountKeypoints();
  database.ReadPairs(0);
}

TEST_F(BadDatabase, TruncatedAnywhereIsRefused) {
  Make("");
  const std::string bytes = ReadBytes(path_);
  const std::string cut = folder_ / "cut.db";
  for (size_t size = 0; size < bytes.size(); size += size < 200 ? 1 : 97) {
    WriteBytes(cut, bytes.substr(0, size));
    try {
      ReadEverything(cut);
      ADD_FAILURE() << size << " of " << bytes.size() << " bytes were taken for a whole database";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(cut), std::string::npos);
    }
  }
}

TEST_F(BadDatabase, DamagedAnywhereNeverCrashes) {
  Make("");
  const std::string bytes = ReadBytes(path_);
  const std::string damaged_path = folder_ / "damaged.db";
  uint32_t random = 12345;
  int num_refused = 0;
  for (int i = 0; i < 600; ++i) {
    std::string damaged = bytes;
    for (int k = 0; k < 3; ++k) {
      random = random * 1664525u + 1013904223u;
      // Half of the damage goes into the first pages, where the schema stands.
      const size_t limit = k == 0 ? 600 : bytes.size();
      damaged[random % limit] = static_cast<char>(random >> 24);
    }
    WriteBytes(damaged_path, damaged);
    try {
      ReadEverything(damaged_path);
    } catch (const InputError& error) {
      ++num_refused;
    }
  }
  EXPECT_GT(num_refused, 50);  // the rest fell on bytes that nothing uses
}

TEST_F(BadDatabase, CameraRowsAreChecked) {
  const std::pair<const char*, const char*> cases[] = {
      {"UPDATE cameras SET params = x'00' WHERE camera_id = 7",
       "params holds 1 bytes, expected 64"},
      {"UPDATE cameras SET params = NULL WHERE camera_id = 7", "params holds 0 bytes, expected 64"},
      {"UPDATE cameras SET model = 2 WHERE camera_id = 7", "params holds 64 bytes, expected 32"},
      {"UPDATE cameras SET model = 18 WHERE camera_id = 7", "model is \"18\""},
      {"UPDATE cameras SET model = 'PINHOLE' WHERE camera_id = 7", "model is \"PINHOLE\""},
      {"UPDATE cameras SET width = -1 WHERE camera_id = 7", "width is \"-1\""},
      {"UPDATE cameras SET height = 0 WHERE camera_id = 7", "height is \"0\""},
      {"UPDATE cameras SET height = 99999999999 WHERE camera_id = 7", "height is \"99999999999\""},
      {"UPDATE cameras SET params = zeroblob(64) WHERE camera_id = 7", "focal length"},
  };
  for (const auto& [sql, finding] : cases) {
    fs::remove(path_);
    Make(sql);
    EXPECT_INPUT_ERROR(Database(path_).ReadCameras(), "table cameras, camera_id 7");
    EXPECT_INPUT_ERROR(Database(path_).ReadCameras(), finding);
  }
}

TEST_F(BadDatabase, ImageWithoutItsCameraIsRefused) {
  Make("DELETE FROM cameras WHERE camera_id = 7");
  EXPECT_INPUT_ERROR(Database(path_).ReadImages(), "table images, image_id 9: names camera 7");
}

TEST_F(BadDatabase, KeypointRowsAreChecked) {
  const std::pair<const char*, const char*> cases[] = {
      {"UPDATE keypoints SET rows = 2000000000 WHERE image_id = 2",
       "data holds 64 bytes, expected 32000000000 for 2000000000 x 4"},
      {"UPDATE keypoints SET rows = -3 WHERE image_id = 2", "rows is \"-3\""},
      {"UPDATE keypoints SET cols = 3 WHERE image_id = 2", "3 columns, expected 2, 4 or 6"},
      {"UPDATE keypoints SET cols = 6 WHERE image_id = 2", "data holds 64 bytes, expected 96"},
      {"UPDATE keypoints SET data = NULL WHERE image_id = 2", "data holds 0 bytes, expected 64"},
      {"UPDATE keypoints SET data = 'text' WHERE image_id = 2", "data holds 4 bytes"},
      {"UPDATE keypoints SET rows = 1, cols = 2, data = x'0000c07f00000000' WHERE image_id = 2",
       "keypoint 0 is not a finite position"},
  };
  for (const auto& [sql, finding] : cases) {
    fs::remove(path_);
    Make(sql);
    EXPECT_INPUT_ERROR(Database(path_).ReadKeypoints(2), "image_id 2");
    EXPECT_INPUT_ERROR(Database(path_).ReadKeypoints(2), finding);
    EXPECT_THAT(Database(path_).ReadKeypoints(1), SizeIs(3));
  }
}

TEST_F(BadDatabase, KeypointRowWithoutBlobIsAnImageWithoutKeypoints) {
  Make("INSERT INTO keypoints (image_id, rows, cols, data) VALUES (10, 0, 6, NULL)");
  EXPECT_THAT(Database(path_).ReadKeypoints(10), IsEmpty());
  EXPECT_EQ(Database(path_).CountKeypoints().at(10), 0u);
}

TEST_F(BadDatabase, MatchesAreChecked) {
  const std::string pair = std::to_string(PairIdFromImages(1, 2));
  const std::pair<std::string, const char*> cases[] = {
      {"UPDATE keypoints SET rows = 3 WHERE image_id = 2",
       "match 0 joins keypoints 0 and 3 of images 1 and 2, which have 3 and 3"},
      {"DELETE FROM keypoints WHERE image_id = 1", "which have 0 and 4"},
      {"UPDATE two_view_geometries SET cols = 3 WHERE pair_id = " + pair, "have 3 columns"},
      {"UPDATE two_view_geometries SET rows = 4 WHERE pair_id = " + pair,
       "data holds 24 bytes, expected 32"},
      {"UPDATE two_view_geometries SET data = NULL WHERE pair_id = " + pair,
       "data holds 0 bytes, expected 24"},
      {"UPDATE two_view_geometries SET config = 'planar' WHERE pair_id = " + pair, "config"},
      {"UPDATE two_view_geometries SET pair_id = 5 WHERE pair_id = 0; UPDATE two_view_geometries "
       "SET pair_id = -1 WHERE pair_id = " +
           pair,
       "pair_id is \"-1\""},
      {"UPDATE two_view_geometries SET pair_id = " + std::to_string(2147483647ull * 2 + 1) +
           " WHERE pair_id = " + pair,
       "not the id of a pair"},
  };
  for (const auto& [sql, finding] : cases) {
    fs::remove(path_);
    Make(sql);
    EXPECT_INPUT_ERROR(Database(path_).ReadPairs(1), "table two_view_geometries");
    EXPECT_INPUT_ERROR(Database(path_).ReadPairs(1), finding);
  }
}

TEST_F(BadDatabase, PairsOfDeletedImagesAreLeftOut) {
  Make("DELETE FROM images WHERE image_id = 9");
  EXPECT_THAT(Database(path_).ReadPairs(0), SizeIs(1));
}

TEST_F(BadDatabase, LockedByAWriterSaysSo) {
  Make("");
  SQLite::Database writer(path_, SQLite::OPEN_READWRITE);
  writer.exec("BEGIN EXCLUSIVE");
  EXPECT_INPUT_ERROR(ReadEverything(path_), "is being written by another program");
}

}  // namespace
}  // namespace roomtex
