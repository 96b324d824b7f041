// roomtex-calibrate as users call it.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "capture/calibration/board_detection.h"
#include "capture/calibration/calibration_database.h"
#include "capture/calibration/calibration_output.h"
#include "colmap_ext/database.h"
#include "colmap_ext/sparse_model.h"
#include "core/camera_text.h"
#include "core/error.h"
#include "tests/capture/calibration/calibration_boards.h"
#include "tests/colmap_ext/database_maker.h"
#include "tests/support/matchers.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

constexpr int kWidth = 640, kHeight = 426;

// One set of photos for all tests.
class CalibrateCommand : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    boards_ = new TempFolder;
    BoardSetOptions set;
    set.num_photos = 10;
    const Board board = Checkerboard(9, 6);
    WriteBoardPhotos(boards_->path(), Truth(), board, MakeBoardPoses(Truth(), board, set), {});
    // Few photos for what needs no good answer.
    few_ = new TempFolder;
    for (int i = 0; i < 3; ++i) {
      const std::string name = "/board_00" + std::to_string(i) + ".png";
      std::filesystem::copy_file(boards_->path() + name, few_->path() + name);
    }
  }
  static void TearDownTestSuite() {
    delete boards_;
    delete few_;
  }
  static Camera Truth() { return LensThatCallsFor(CameraModel::kOpenCv, kWidth, kHeight); }

  CommandResult Run(const std::string& options) const {
    return RunCommandLine("roomtex-calibrate --board 9x6 --image_path " + boards_->path() +
                          " --output_path " + (folder_ / "camera.txt") + " " + options);
  }
  nlohmann::json Report() const {
    return nlohmann::json::parse(ReadBytes(folder_ / "report.json"));
  }

  static TempFolder *boards_, *few_;
  const TempFolder folder_;
};
TempFolder* CalibrateCommand::boards_ = nullptr;
TempFolder* CalibrateCommand::few_ = nullptr;

// A cameras.txt as part of a model, read by our reader.
Camera ReadBack(const std::string& cameras_txt) {
  const TempFolder model;
  WriteBytes(model / "cameras.txt", ReadBytes(cameras_txt));
  WriteBytes(model / "images.txt", "");
  WriteBytes(model / "points3D.txt", "");
  return ReadSparseModel(model.path()).cameras.at(1);
}

TEST_F(CalibrateCommand, WritesTheCameraTheOptionsThePictureAndTheReport) {
  const CommandResult result =
      Run("--square 0.025 --num_threads 1 --coverage_path " + (folder_ / "coverage.png") +
          " --report_path " + (folder_ / "report.json"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Camera camera = ReadBack(folder_ / "camera.txt");
  EXPECT_EQ(camera.model, CameraModel::kOpenCv);
  EXPECT_EQ(camera.width, kWidth);
  EXPECT_EQ(camera.height, kHeight);
  const nlohmann::json report = Report();
  EXPECT_EQ(report["camera_model"], "OPENCV");
  EXPECT_EQ(report["params"].get<std::vector<double>>(), camera.params);
  const auto sigmas = report["params_sigma"].get<std::vector<double>>();
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(camera.params[i], Truth().params[i], 4 * sigmas[i]) << i;
  EXPECT_EQ(result.out, FeatureExtractorOptions(camera, kLensDigits) + "\n");
  EXPECT_NE(result.err.find("focal length "), std::string::npos) << result.err;
  EXPECT_NE(result.err.find(" +- "), std::string::npos) << result.err;
  EXPECT_EQ(result.out.rfind("--ImageReader.single_camera 1 --ImageReader.camera_model OPENCV "
                             "--ImageReader.camera_params ",
                             0),
            0u);
  EXPECT_TRUE(report["trusted"].get<bool>());
  EXPECT_LT(report["rms_px"].get<double>(), 0.1);
  EXPECT_GE(report["held_out_rms_px"].get<double>(), report["rms_px"].get<double>());
  EXPECT_LT(report["focal_sigma_percent"].get<double>(), 0.2);
  EXPECT_LT(report["corner_sigma_px"].get<double>(), 2);
  EXPECT_GT(report["coverage"]["share"].get<double>(), 0.4);
  ASSERT_EQ(report["images"].size(), 10u);
  for (const auto& image : report["images"]) {
    EXPECT_TRUE(image["used"].get<bool>());
    EXPECT_EQ(image["reason"], "");
    EXPECT_EQ(image["num_corners"], 54);
    EXPECT_LT(image["rms_px"].get<double>(), 0.15);
    EXPECT_FALSE(image["name"].get<std::string>().empty());
  }
  ASSERT_EQ(report["models"].size(), 5u);
  EXPECT_EQ(report["models"][0]["camera_model"], "SIMPLE_RADIAL");
  EXPECT_FALSE(cv::imread(folder_ / "coverage.png").empty());

  // Two threads, another square: the same bytes.
  const std::string bytes = ReadBytes(folder_ / "camera.txt");
  const CommandResult again = Run("--num_threads 2 --quiet");
  ASSERT_EQ(again.exit_code, 0);
  EXPECT_EQ(again.err, "");
  EXPECT_EQ(again.out, result.out);
  EXPECT_EQ(ReadBytes(folder_ / "camera.txt"), bytes);
}

TEST_F(CalibrateCommand, EndsWithFourWhenPhotosDoNotDetermineTheCamera) {
  const CommandResult result = RunCommandLine(
      "roomtex-calibrate --board 9x6 --camera_model SIMPLE_RADIAL --image_path " + few_->path() +
      " --output_path " + (folder_ / "camera.txt") + " --report_path " + (folder_ / "report.json"));
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_NE(result.err.find("only 3 photos of the board took part"), std::string::npos)
      << result.err;
  EXPECT_FALSE(Report()["trusted"].get<bool>());
  EXPECT_EQ(ReadBack(folder_ / "camera.txt").model, CameraModel::kSimpleRadial);
}

// One millimetre over 20 cm, as paper on cardboard has it: 2 % of the focal length if taken for
// flat.
TEST_F(CalibrateCommand, TakesABowedBoardIntoAccount) {
  BoardSetOptions set;
  set.num_photos = 12;
  const Board board = Checkerboard(9, 6);
  BoardPhotoOptions photo;
  photo.bow = 0.001;
  const TempFolder photos;
  WriteBoardPhotos(photos.path(), Truth(), board, MakeBoardPoses(Truth(), board, set), photo);
  const CommandResult result = RunCommandLine(
      "roomtex-calibrate --board 9x6 --image_path " + photos.path() + " --output_path " +
      (folder_ / "camera.txt") + " --report_path " + (folder_ / "report.json"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.err.find("the board is not flat"), std::string::npos) << result.err;
  const nlohmann::json report = Report();
  EXPECT_NEAR(report["board_bow_mm"].get<double>(), 1, 0.1);
  EXPECT_TRUE(report["board_bow_used"].get<bool>());
  EXPECT_GT(std::abs(report["board_bow_focal_percent"].get<double>()), 0.5);
  EXPECT_EQ(report["camera_model"], "OPENCV");
  const auto params = report["params"].get<std::vector<double>>();
  const auto sigmas = report["params_sigma"].get<std::vector<double>>();
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(params[i], Truth().params[i], 4 * sigmas[i]) << i;
  EXPECT_LT(sigmas[0], 0.002 * params[0]);
}

TEST_F(CalibrateCommand, EndsWithFourWhereTheFocusWasTouched) {
  BoardSetOptions set;
  set.num_photos = 14;
  const Board board = Checkerboard(9, 6);
  const std::vector<Rigid> poses = MakeBoardPoses(Truth(), board, set);
  Camera touched = Truth();
  for (const int i : {0, 1}) touched.params[i] *= 1.01;
  const TempFolder photos;
  WriteBoardPhotos(photos.path(), Truth(), board, {poses.begin(), poses.begin() + 7}, {});
  WriteBoardPhotos(photos / "later", touched, board, {poses.begin() + 7, poses.end()}, {});
  const CommandResult result = RunCommandLine(
      "roomtex-calibrate --board 9x6 --image_path " + photos.path() + " --output_path " +
      (folder_ / "camera.txt") + " --report_path " + (folder_ / "report.json"));
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_NE(Report()["reason"].get<std::string>().find("touched focus"), std::string::npos)
      << Report()["reason"] << Report()["photo_scatter"];
}

TEST_F(CalibrateCommand, SaysWhatIsWrongInSentences) {
  const std::string start = "roomtex-calibrate --output_path " + (folder_ / "camera.txt") + " ";
  const auto expect = [&](const std::string& options, int exit_code, const std::string& text) {
    const CommandResult result = RunCommandLine(start + options);
    EXPECT_EQ(result.exit_code, exit_code) << options << "\n" << result.err;
    EXPECT_NE(result.err.find(text), std::string::npos) << options << "\n" << result.err;
    EXPECT_EQ(result.out, "") << options;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "camera.txt"));
  };
  const std::string images = "--image_path " + few_->path() + " ";
  expect(images, 2, "--board");
  expect(images + "--board 9", 2, "expected COLUMNSxROWS of inner corners");
  expect(images + "--board 9x6 --square 0", 2, "must be above 0");
  expect(images + "--board 9x6 --square nan", 2, "--square");
  expect(images + "--board 9x6 --square 25", 2, "25 mm are 0.025");
  expect("--board 9x6", 2, "--image_path is required");
  expect("--input " + few_->path(), 2, "Its files are --image_path");
  expect("--image " + few_->path(), 2, "Did you mean --image_path?");
  expect(images + "--board 9x6 --camera_model PINHOLE", 2, "--camera_model is \"PINHOLE\"");
  expect(images + "--board 9x6 --board_type charuco", 2, "--marker must be positive");
  expect(images + "--board 9x6 --coverage_path x.xyz", 2, "ends with .png");
  expect(images + "--board 9x6 --apply_output x.db", 2, "--apply_output needs --apply");
  expect(images + "--board 9x6 --apply missing.db", 3, "missing.db");
  expect("--board 9x6 --image_path " + (folder_ / "nowhere"), 3, "nowhere");
  expect("--board 9x6 --image_path " + folder_.path(), 3, "holds no photos");
  expect(images + "--board 10x7", 3, "Give --board 9x6");
}

// The black rectangles of a PDF of ours, a pixel for a quarter of a millimetre.
cv::Mat1b Raster(const std::string& pdf) {
  double width = 0, height = 0;
  const size_t box = pdf.find("/MediaBox [0 0 ");
  EXPECT_EQ(std::sscanf(pdf.c_str() + box, "/MediaBox [0 0 %lf %lf]", &width, &height), 2);
  const double scale = 25.4 / 72 * 4;
  cv::Mat1b picture(static_cast<int>(height * scale), static_cast<int>(width * scale),
                    uint8_t{255});
  std::istringstream lines(pdf);
  std::string line;
  while (std::getline(lines, line)) {
    double x = 0, y = 0, w = 0, h = 0;
    if (line.size() < 3 || line.substr(line.size() - 3) != " re") continue;
    std::sscanf(line.c_str(), "%lf %lf %lf %lf re", &x, &y, &w, &h);
    const auto pixel = [&](double points) { return static_cast<int>(std::lround(points * scale)); };
    const cv::Rect rect(cv::Point(pixel(x), pixel(height - y - h)),
                        cv::Point(pixel(x + w), pixel(height - y)));
    picture(rect).setTo(0);
  }
  return picture;
}

TEST_F(CalibrateCommand, WritesBoardsToPrintThatItFindsAgain) {
  const std::string pdf = folder_ / "board.pdf";
  for (const char* options : {"--board 9x6 --square 0.025",
                              "--board 8x6 --square 0.03 --board_type charuco --marker 0.022"}) {
    const CommandResult result =
        RunCommandLine(std::string("roomtex-calibrate --board_path ") + pdf + " " + options);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.out, pdf + "\n");
    const bool charuco = std::string(options).find("charuco") != std::string::npos;
    const TempFolder photos;
    // As a camera sees it: a little turned, a little soft.
    const cv::Mat1b flat = Raster(ReadBytes(pdf));
    constexpr double kScale = 0.9;
    cv::Mat1b photo;
    cv::warpAffine(flat, photo,
                   cv::getRotationMatrix2D({flat.cols / 2.0F, flat.rows / 2.0F}, 4, kScale),
                   flat.size(), cv::INTER_LINEAR, cv::BORDER_CONSTANT, {255});
    cv::GaussianBlur(photo, photo, {}, 1);
    cv::imwrite(photos / "board.png", photo);
    BoardOptions board;
    board.size = charuco ? "8x6" : "9x6";
    board.square = charuco ? 0.03 : 0.025;
    if (charuco) {
      board.type = "charuco";
      board.marker = 0.022;
    }
    Progress progress(true);
    const std::vector<BoardPhoto> found =
        FindBoards(photos.path(), {"board.png"}, MakeBoard(board), 1, &progress);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].reason, "");
    ASSERT_EQ(found[0].x_in_img.cols(), charuco ? 35 : 54);
    // In true size: 4 pixels a millimetre.
    const double square_px = (found[0].x_in_img.col(1) - found[0].x_in_img.col(0)).norm();
    EXPECT_NEAR(square_px, kScale * 4000 * board.square, 0.5);
  }
}

class ApplyToDatabaseTest : public CalibrateCommand {
 protected:
  static Camera Guess(uint32_t id, int width, int height) {
    Camera camera;
    camera.camera_id = id;
    camera.model = CameraModel::kSimpleRadial;
    camera.width = width;
    camera.height = height;
    camera.params = {1.2 * width, width / 2.0, height / 2.0, 0};
    return camera;
  }
  void MakeDatabase(const std::vector<Camera>& cameras,
                    DatabaseMaker::Schema schema = DatabaseMaker::Schema::k38) const {
    DatabaseMaker maker(folder_ / "database.db", schema);
    if (schema == DatabaseMaker::Schema::k41) maker.UseWal();
    for (const Camera& camera : cameras) {
      maker.AddCamera(camera);
      maker.AddImage(camera.camera_id, std::to_string(camera.camera_id) + ".jpg", camera.camera_id);
      maker.AddKeypoints(camera.camera_id, {{10, 20}, {30, 40}}, 6);
    }
    maker.Run("CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY, data BLOB)");
    maker.Run("INSERT INTO descriptors VALUES (1, zeroblob(100000))");
    if (cameras.size() > 1) maker.AddPair(1, 2, {0, 1, 1, 0});
  }
};

TEST_F(ApplyToDatabaseTest, PutsTheCameraIntoACopy) {
  MakeDatabase({Guess(1, kWidth, kHeight), Guess(2, kWidth, kHeight),
                Guess(3, 2 * kWidth, 2 * kHeight), Guess(4, kHeight, kWidth)});
  const std::string before = ReadBytes(folder_ / "database.db");
  const CommandResult result =
      Run("--apply " + (folder_ / "database.db") + " --report_path " + (folder_ / "report.json"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(ReadBytes(folder_ / "database.db"), before);
  const Camera camera = ReadBack(folder_ / "camera.txt");
  const Database copy(folder_ / "database_calibrated.db");
  const auto cameras = copy.ReadCameras();
  ASSERT_EQ(cameras.size(), 4u);
  for (const uint32_t id : {1u, 2u}) {
    EXPECT_EQ(cameras.at(id).model, camera.model);
    EXPECT_EQ(cameras.at(id).params, camera.params);
    EXPECT_TRUE(cameras.at(id).has_prior_focal_length);
  }
  EXPECT_EQ(cameras.at(3).width, 2 * kWidth);
  EXPECT_DOUBLE_EQ(cameras.at(3).params[0], 2 * camera.params[0]);
  EXPECT_DOUBLE_EQ(cameras.at(3).params[5], camera.params[5]);
  EXPECT_TRUE(cameras.at(3).has_prior_focal_length);
  EXPECT_EQ(cameras.at(4).params, Guess(4, kHeight, kWidth).params);
  EXPECT_FALSE(cameras.at(4).has_prior_focal_length);
  EXPECT_NE(result.err.find("camera 3 (1280x852) gets the calibration scaled"), std::string::npos);
  EXPECT_NE(result.err.find("camera 4 (426x640) keeps"), std::string::npos);
  EXPECT_EQ(Report()["applied"]["scaled"], nlohmann::json({3}));
  EXPECT_EQ(copy.ReadKeypoints(2).size(), 2u);
  EXPECT_EQ(copy.ReadPairs(1).size(), 1u);
  SQLite::Database raw(folder_ / "database_calibrated.db");
  EXPECT_EQ(raw.execAndGet("SELECT LENGTH(data) FROM descriptors").getInt(), 100000);
}

TEST_F(ApplyToDatabaseTest, CopiesWhatStandsInTheWalToo) {
  const std::string path = folder_ / "database.db";
  DatabaseMaker maker(path, DatabaseMaker::Schema::k41);
  maker.UseWal();
  maker.AddCamera(Guess(1, kWidth, kHeight));
  ASSERT_GT(std::filesystem::file_size(path + "-wal"), 0u);
  const std::string before = ReadBytes(path), wal = ReadBytes(path + "-wal");
  const AppliedCameras applied = ApplyToDatabase(Truth(), path, folder_ / "copy.db");
  EXPECT_EQ(applied.same_size, std::vector<uint32_t>{1});
  EXPECT_FALSE(applied.has_pairs);
  EXPECT_EQ(ReadBytes(path), before);
  EXPECT_EQ(ReadBytes(path + "-wal"), wal);
  EXPECT_EQ(Database(folder_ / "copy.db").ReadCameras().at(1).params, Truth().params);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "copy.db-wal"));
}

// SQLite would play a log that a killed program left into the new file.
TEST_F(ApplyToDatabaseTest, RefusesACopyWithALogBesideIt) {
  MakeDatabase({Guess(1, kWidth, kHeight)});
  const std::string apply = "--apply " + (folder_ / "database.db");
  WriteBytes(folder_ / "database_calibrated.db-wal", std::string(64, 'x'));
  CommandResult result = Run(apply);
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_NE(result.err.find("database_calibrated.db-wal"), std::string::npos) << result.err;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "database_calibrated.db"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "camera.txt"));
  // An empty one says nothing.
  WriteBytes(folder_ / "database_calibrated.db-wal", "");
  result = Run(apply);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "database_calibrated.db-wal"));
  EXPECT_EQ(Database(folder_ / "database_calibrated.db").ReadCameras().at(1).params,
            ReadBack(folder_ / "camera.txt").params);
}

TEST_F(ApplyToDatabaseTest, KeepsWhatWasMadeInAnEarlierCopy) {
  MakeDatabase({Guess(1, kWidth, kHeight), Guess(2, kWidth, kHeight)});
  const std::string copy = folder_ / "database_calibrated.db";
  const std::string apply = "--apply " + (folder_ / "database.db");
  EXPECT_EQ(Run(apply).exit_code, 0);
  EXPECT_EQ(Run(apply).exit_code, 0) << "nothing was made in it";
  SQLite::Database(copy, SQLite::OPEN_READWRITE)
      .exec(
          "CREATE TEMP TABLE more AS SELECT * FROM two_view_geometries;"
          "UPDATE more SET pair_id = pair_id + 1;"
          "INSERT INTO two_view_geometries SELECT * FROM more;");
  const std::string before = ReadBytes(copy);
  const CommandResult result = Run(apply);
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_NE(result.err.find("--apply_output"), std::string::npos) << result.err;
  EXPECT_EQ(ReadBytes(copy), before);
  EXPECT_EQ(Run(apply + " --apply_output " + copy).exit_code, 0);
  EXPECT_EQ(Database(copy).CountPairs(), 1u);
}

TEST_F(ApplyToDatabaseTest, RefusesPhotosOfAnotherShape) {
  MakeDatabase({Guess(1, 640, 480)});
  EXPECT_INPUT_ERROR(ApplyToDatabase(Truth(), folder_ / "database.db", folder_ / "copy.db"),
                     "its photos are 640x480, those of the board 640x426");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "copy.db"));
  std::filesystem::remove(folder_ / "database.db");
  MakeDatabase({Guess(1, kHeight, kWidth)});
  EXPECT_INPUT_ERROR(ApplyToDatabase(Truth(), folder_ / "database.db", folder_ / "copy.db"),
                     "turned by a program");
}

TEST_F(ApplyToDatabaseTest, NeverOverwritesTheDatabase) {
  MakeDatabase({Guess(1, kWidth, kHeight)});
  std::filesystem::create_symlink(folder_ / "database.db", folder_ / "link.db");
  const std::string before = ReadBytes(folder_ / "database.db");
  for (const std::string name : {"database.db", "link.db"}) {
    const CommandResult result =
        Run("--apply " + (folder_ / "database.db") + " --apply_output " + (folder_ / name));
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_NE(result.err.find("inputs are never changed"), std::string::npos);
  }
  EXPECT_EQ(ReadBytes(folder_ / "database.db"), before);
}

TEST(ScaledCamera, SeesTheSamePlaceOfALargerPicture) {
  const Camera camera = LensThatCallsFor(CameraModel::kFullOpenCv, 1500, 1000);
  const Camera larger = ScaledCamera(camera, 4500, 3000);
  const Eigen::Vector3d x_in_cam(0.3, -0.2, 1.1);
  EXPECT_THAT(*CameraProjection(larger).ImgFromCam(x_in_cam),
              IsNearMatrix((3 * *CameraProjection(camera).ImgFromCam(x_in_cam)).eval(), 1e-9));
}

// What the installed COLMAP makes of the options and of the database.
TEST_F(CalibrateCommand, GivesOptionsAndADatabaseThatColmapTakes) {
  ASSERT_EQ(std::system("colmap help >/dev/null 2>&1"), 0) << "run scripts/setup.sh";
  const CommandResult options = Run("");
  ASSERT_EQ(options.exit_code, 0) << options.err;
  const auto colmap = [&](const std::string& arguments) {
    return std::system(
        ("QT_QPA_PLATFORM=offscreen colmap " + arguments + " >" + (folder_ / "log") + " 2>&1")
            .c_str());
  };
  // COLMAP 4 renamed the group of this option.
  const bool is_38 =
      std::system("colmap feature_extractor -h 2>&1 | grep -q SiftExtraction.use_gpu") == 0;
  const std::string no_gpu =
      is_38 ? " --SiftExtraction.use_gpu 0" : " --FeatureExtraction.use_gpu 0";
  std::string line = options.out;
  line.pop_back();
  ASSERT_EQ(colmap("feature_extractor --database_path " + (folder_ / "database.db") +
                   " --image_path " + few_->path() + " " + line + no_gpu),
            0)
      << ReadBytes(folder_ / "log");
  const Camera camera = ReadBack(folder_ / "camera.txt");
  const auto extracted = Database(folder_ / "database.db").ReadCameras();
  ASSERT_EQ(extracted.size(), 1u);
  EXPECT_EQ(extracted.begin()->second.model, camera.model);
  EXPECT_EQ(extracted.begin()->second.params, camera.params);
  EXPECT_TRUE(extracted.begin()->second.has_prior_focal_length);

  // A database made without them, calibrated afterwards: COLMAP goes on with the copy.
  ASSERT_EQ(colmap("feature_extractor --database_path " + (folder_ / "plain.db") +
                   " --image_path " + few_->path() + no_gpu),
            0);
  ApplyToDatabase(camera, folder_ / "plain.db", folder_ / "calibrated.db");
  ASSERT_EQ(colmap("exhaustive_matcher --database_path " + (folder_ / "calibrated.db") +
                   (is_38 ? " --SiftMatching.use_gpu 0" : " --FeatureMatching.use_gpu 0")),
            0)
      << ReadBytes(folder_ / "log");
  for (const auto& [id, one] : Database(folder_ / "calibrated.db").ReadCameras()) {
    EXPECT_EQ(one.params, camera.params);
    EXPECT_TRUE(one.has_prior_focal_length);
  }
}

}  // namespace
}  // namespace roomtex
