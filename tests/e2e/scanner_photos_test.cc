// The scanner's own photos beside the user's, as a user types it: photos out of an E57, COLMAP on
// all, roomtex-mapper with their poses, roomtex-align without a pick. Label `e2e`.

#include <filesystem>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "colmap_ext/sparse_model.h"
#include "core/frames.h"
#include "tests/e2e/furnished_capture.h"
#include "tests/support/matchers.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

class ScannerPhotos : public testing::Test {
 protected:
  static constexpr int kNumPhotos = FurnishedCapture::kNumPhotos, kNumOfScanner = 4;

  static std::string Path(const std::string& name) { return *folder_ / name; }

  // Of 14 simulated photos four, spread over the room, become the scanner's: they go with their
  // true poses into the E57, without distortion, and nobody else has them.
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    const FurnishedCapture& made = FurnishedCapture::Get();
    fs::create_directory_symlink(made.capture, Path("capture"));
    truth_ = ReadSparseModel(Path("capture/truth"));
    SparseModel of_scanner = truth_;
    fs::create_directories(Path("photos/mine"));
    int k = 0;
    for (const auto& [id, image] : truth_.images) {
      if (k++ % 4 == 1) continue;
      of_scanner.images.erase(id);
      fs::copy_file(Path("capture/photos/" + image.name), Path("photos/mine/" + image.name));
    }
    ASSERT_EQ(of_scanner.images.size(), kNumOfScanner);
    fs::copy_file(made.database, Path("database.db"));
    KeepMine(of_scanner);
    for (auto& [id, image] : of_scanner.images) image.points2d.clear(), image.point3d_ids.clear();
    of_scanner.points.clear();
    WriteSparseModel(of_scanner, Path("of_scanner"));
    const CommandResult written = RunCommandLine(
        "roomtex-texture --quiet --Texture.scale 1 --output_e57 1 --E57.images 1 --input_path " +
        Path("of_scanner") + " --image_path " + Path("capture/photos") + " --scan_path " +
        Path("capture/scan.rtpi") + " --output_path " + Path("site"));
    ASSERT_EQ(written.exit_code, 0) << written.err;
    const CommandResult extracted =
        RunCommandLine("roomtex-import --quiet --input_path " + Path("site/model.e57") +
                       " --images_path " + Path("photos/scanner"));
    ASSERT_EQ(extracted.exit_code, 0) << extracted.err;
    std::string theirs;
    for (const auto& entry : fs::directory_iterator(Path("photos/scanner"))) {
      if (entry.is_regular_file()) theirs += "scanner/" + entry.path().filename().string() + "\n";
    }
    WriteBytes(Path("theirs.txt"), theirs);
    // COLMAP leaves out the pairs that are matched already.
    ExtractAndMatch(Path("database.db"), Path("photos"),
                    std::string(FurnishedCapture::kFeatures) + "--image_list_path " +
                        Path("theirs.txt") + " --ImageReader.single_camera 1");
  }
  // Takes the scanner's photos out of the database; the others lie in a folder mine/ from now on.
  static void KeepMine(const SparseModel& of_scanner) {
    SQLite::Database database(Path("database.db"), SQLite::OPEN_READWRITE);
    for (const auto& [id, image] : of_scanner.images) {
      SQLite::Statement found(database, "SELECT image_id FROM images WHERE name = ?");
      found.bind(1, image.name);
      ASSERT_TRUE(found.executeStep()) << image.name;
      const std::string image_id = std::to_string(found.getColumn(0).getInt64());
      found.reset();
      for (const char* table : {"images", "keypoints", "descriptors"}) {
        database.exec("DELETE FROM " + std::string(table) + " WHERE image_id = " + image_id);
      }
      for (const char* table : {"matches", "two_view_geometries"}) {
        // COLMAP's number of a pair: the smaller image_id times 2147483647 plus the larger one.
        database.exec("DELETE FROM " + std::string(table) + " WHERE pair_id % 2147483647 = " +
                      image_id + " OR pair_id / 2147483647 = " + image_id);
      }
    }
    database.exec("UPDATE images SET name = 'mine/' || name");
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  // Median distance of the user's photos from where they were taken, metres. An E57 has z up.
  static double MedianError(const SparseModel& model, const std::string& below = "mine/") {
    std::vector<double> errors;
    for (const auto& [id, image] : truth_.images) {
      const SparseImage* const found = model.FindImage(below + image.name);
      if (found == nullptr) continue;
      const Eigen::Vector3d c = image.cam_from_model.TargetOriginInSource();
      const Eigen::Vector3d in_e57(c.x(), -c.z(), c.y());
      errors.push_back((found->cam_from_model.TargetOriginInSource() - in_e57).norm());
    }
    EXPECT_EQ(errors.size(), kNumPhotos - kNumOfScanner);
    std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
    return errors[errors.size() / 2];
  }

  static TempFolder* folder_;
  static SparseModel truth_;
};

TempFolder* ScannerPhotos::folder_ = nullptr;
SparseModel ScannerPhotos::truth_;

TEST_F(ScannerPhotos, PutModelAndAlignmentIntoTheScanWithoutAPick) {
  const CommandResult mapped =
      RunCommandLine("roomtex-mapper --quiet --database_path " + Path("database.db") +
                     " --image_path " + Path("photos") + " --known_path " +
                     Path("photos/scanner/sparse") + " --output_path " + Path("sparse"));
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  const SparseModel model = ReadSparseModel(Path("sparse/0"));
  EXPECT_EQ(model.images.size(), kNumPhotos);
  // Already in the scan's frame and metric: 960 pixels across 5 m are 3 mm each.
  EXPECT_LT(MedianError(model), 0.005);
  const SparseModel told = ReadSparseModel(Path("photos/scanner/sparse"));
  for (const auto& [id, image] : told.images) {
    const SparseImage* const found = model.FindImage("scanner/" + image.name);
    ASSERT_NE(found, nullptr) << image.name;
    EXPECT_THAT(found->cam_from_model, IsNearRigid(image.cam_from_model, 1e-9, 1e-9));
  }

  // No picks, no search, and no photos to confirm it.
  const CommandResult aligned =
      RunCommandLine("roomtex-align --quiet --input_path " + Path("sparse/0") + " --scan_path " +
                     Path("site/model.e57") + " --output_path " + Path("aligned"));
  ASSERT_EQ(aligned.exit_code, 0) << aligned.err;
  const double off_mm = 1000 * MedianError(ReadSparseModel(Path("aligned")));
  EXPECT_LT(off_mm, 5);
  const json report = json::parse(ReadBytes(Path("aligned/alignment.json")));
  EXPECT_EQ(report["search"]["method"], "known_poses");
  EXPECT_GE(report["picks"]["num_used"],
            12);  // the scanner's photos hold what the surface does not
  // What is said covers what it is off by, and is not more than three pixels (3 mm each).
  EXPECT_GE(report["expected_error"]["at_cameras_mm"], off_mm);
  EXPECT_LE(report["expected_error"]["at_cameras_mm"], 10);
  EXPECT_NEAR(report["scan_from_sparse"]["scale"].get<double>(), 1, 0.005);
}

TEST_F(ScannerPhotos, RoomtexAutoColoursByThemAlone) {
  const CommandResult result =
      RunCommandLine("roomtex-auto --quiet --quality low --scan_path " + Path("site/model.e57") +
                     " --output_path " + Path("alone"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("coloured by the scanner's own photos"));
  EXPECT_FALSE(fs::exists(Path("alone/database.db")));
  const json report = json::parse(ReadBytes(Path("alone/log/texture.json")));
  EXPECT_GT(report["coverage"], 0.3);  // four photos
  EXPECT_TRUE(fs::exists(Path("alone/pictures/open_1.png")));
  EXPECT_THAT(ReadBytes(Path("alone/report.html")), HasSubstr("nothing here has checked"));
}

// As scanners take them: a panorama from one place. Its faces, which COLMAP maps beside the user's
// photos, leave the scale open; the scan, seen in them, tells it. roomtex-auto takes them out of
// the E57 and hands them on.
TEST_F(ScannerPhotos, OfOneStandpointPutTheModelIntoTheScanByThemselves) {
  const CommandResult simulated = RunCommandLine(
      "roomtex-simulate --quiet --output_path " + Path("panorama") +
      " --num_photos 1 --camera_model EQUIRECTANGULAR --photo_width 2400 --photo_height 1200 "
      "--scan_columns 1000 --scan_rows 380");
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  ASSERT_EQ(ReadBytes(Path("panorama/scan.rtpi")), ReadBytes(Path("capture/scan.rtpi")));
  const CommandResult written = RunCommandLine(
      "roomtex-texture --quiet --Texture.scale 1 --output_e57 1 --E57.images 1 --input_path " +
      Path("panorama/truth") + " --image_path " + Path("panorama/photos") + " --scan_path " +
      Path("panorama/scan.rtpi") + " --output_path " + Path("one_place"));
  ASSERT_EQ(written.exit_code, 0) << written.err;
  const CommandResult result = RunCommandLine(
      "roomtex-auto --quiet --scan_path " + Path("one_place/model.e57") + " --image_path " +
      Path("photos/mine") + " --cameras_path " + Path("capture/cameras.txt") +
      " --quality low --SiftExtraction.max_num_features 2048 --until align --output_path " +
      Path("auto_one_place"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json known = json::parse(ReadBytes(Path("auto_one_place/log/mapper.json")))["known"];
  EXPECT_FALSE(known["placed"]);
  EXPECT_GT(known["told"].size(), 1u);
  const json report = json::parse(ReadBytes(Path("auto_one_place/log/align.json")));
  EXPECT_EQ(report["search"]["method"], "known_poses");
  EXPECT_TRUE(report["trusted"]);
  // Also where rays of faces meet in their own camera: such points stop no adjustment.
  EXPECT_TRUE(report["plane_bundle"]["used"]);
  EXPECT_LT(MedianError(ReadSparseModel(Path("auto_one_place/aligned")), ""), 0.005);
  EXPECT_THAT(ReadBytes(Path("auto_one_place/report.html")),
              HasSubstr("--known_path " + Path("auto_one_place/with_scanner/scanner/sparse")));
}

// roomtex-auto has the scanner's photos in a folder of their own; picks of roomtex-import name them
// as they are in the E57.
TEST_F(ScannerPhotos, PicksInThemAreFoundInTheFolderOfRoomtexAuto) {
  const CommandResult imported =
      RunCommandLine("roomtex-import --quiet --input_path " + Path("one_place/model.e57") +
                     " --images_path " + Path("own") + " --E57.cut_panoramas 1 --E57.picks 1");
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  ASSERT_THAT(ReadBytes(Path("own/picks.csv")), Not(HasSubstr("scanner/")));
  const CommandResult aligned =
      RunCommandLine("roomtex-align --quiet --input_path " + Path("auto_one_place/sparse/0") +
                     " --scan_path " + Path("one_place/model.e57") + " --picks_path " +
                     Path("own/picks.csv") + " --output_path " + Path("by_picks"));
  ASSERT_EQ(aligned.exit_code, 0) << aligned.err;
  EXPECT_LT(MedianError(ReadSparseModel(Path("by_picks")), ""), 0.005);
}

TEST_F(ScannerPhotos, WithoutTheirPosesPicksAreAskedFor) {
  const CommandResult aligned =
      RunCommandLine("roomtex-align --quiet --input_path " + Path("capture/truth") +
                     " --scan_path " + Path("site/model.e57") + " --output_path " + Path("none"));
  EXPECT_EQ(aligned.exit_code, 2);
  EXPECT_THAT(aligned.err, HasSubstr("--picks_path is missing"));
}

}  // namespace
}  // namespace roomtex
