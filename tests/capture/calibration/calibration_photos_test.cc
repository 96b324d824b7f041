// From pictures of boards to the camera: detection, and what it says of pictures that do not fit.

#include <cmath>
#include <filesystem>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "capture/calibration/board_charuco.h"
#include "capture/calibration/calibration.h"
#include "capture/calibration/calibration_picture.h"
#include "capture/calibration/calibration_uncertainty.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/photo_files.h"
#include "tests/capture/calibration/calibration_boards.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

constexpr int kWidth = 640, kHeight = 426;

std::vector<BoardPhoto> Find(const std::string& folder, const Board& board, int num_threads = -1) {
  Progress progress(true);
  return FindBoards(folder, ListPhotoFiles(folder, ""), board, num_threads, &progress);
}

// Root mean square over the corners seen, of what the two cameras make of them; the turn taken out.
double RmsWhereCovered(const Camera& truth, const Calibration& calibration) {
  double sum = 0;
  int count = 0;
  Eigen::Matrix2Xd all(2, 0);
  for (const CalibratedPhoto& photo : calibration.photos) {
    if (!photo.used) continue;
    Eigen::Matrix2Xd more(2, all.cols() + photo.x_in_img.cols());
    more << all, photo.x_in_img;
    all = more;
  }
  const Eigen::Matrix2Xd off = MappingDifference(truth, calibration.camera, all, all);
  for (int i = 0; i < off.cols(); ++i, ++count) sum += off.col(i).squaredNorm();
  return std::sqrt(sum / count);
}

// Distance of every corner found to the true one; boards look alike from both ends.
double DetectionRms(const BoardPhoto& found, const BoardPhoto& truth) {
  double sum = 0;
  for (int i = 0; i < found.NumCorners(); ++i) {
    sum += (truth.x_in_img.colwise() - found.x_in_img.col(i)).colwise().squaredNorm().minCoeff();
  }
  return std::sqrt(sum / found.NumCorners() / 2);
}

class PhotosOfLens : public ::testing::TestWithParam<CameraModel> {};

TEST_P(PhotosOfLens, GiveItsModelAndItsMapping) {
  const Camera truth = LensThatCallsFor(GetParam(), kWidth, kHeight);
  const Board board = Checkerboard(9, 6);
  BoardSetOptions set;
  set.num_photos = 14;
  set.seed = 100 + static_cast<uint64_t>(GetParam());
  const std::vector<Rigid> poses = MakeBoardPoses(truth, board, set);
  const TempFolder folder;
  WriteBoardPhotos(folder / "boards", truth, board, poses, {});
  const std::vector<BoardPhoto> photos = Find(folder / "boards", board);
  const std::vector<BoardPhoto> expected = ObserveBoards(truth, board, poses, 0, 1);
  for (int i = 0; i < set.num_photos; ++i) {
    ASSERT_EQ(photos[i].reason, "") << i;
    EXPECT_LT(DetectionRms(photos[i], expected[i]), 0.06) << i;
  }
  const Calibration found = Calibrate(photos, board, {}, folder / "boards");
  EXPECT_EQ(found.camera.model, truth.model) << found.why_model;
  EXPECT_TRUE(found.reasons.empty());
  EXPECT_EQ(found.NumUsed(), set.num_photos);
  EXPECT_LT(RmsWhereCovered(truth, found), 0.1);
  for (int i = 0; i < found.lens.num_free; ++i) {
    EXPECT_NEAR(found.camera.params[i], truth.params[i], 4 * found.params_sigma[i]) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Calibration, PhotosOfLens,
                         ::testing::Values(CameraModel::kSimpleRadial, CameraModel::kRadial,
                                           CameraModel::kOpenCv, CameraModel::kFullOpenCv),
                         [](const auto& lens) { return CameraModelName(lens.param); });

// A corner in the middle of the pixel in column 200, row 150 has the position (200.5, 150.5).
TEST(BoardDetection, CountsTheCentreOfTheFirstPixelAsOneHalf) {
  Camera camera;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = 400;
  camera.height = 300;
  camera.params = {500, 200.5, 150.5};
  const Board board = Checkerboard(3, 3);
  Rigid pose;
  pose.translation = {-board.square, -board.square, 0.3};  // the middle corner straight ahead
  BoardPhotoOptions options;
  options.noise = 0;
  const cv::Mat photo = BoardRenderer(camera).Render(board, pose, options);
  Eigen::Matrix2Xd x_in_img(2, 1);
  x_in_img << 201.3, 149.9;
  RefineCorners(photo, {40}, 0.35, &x_in_img);
  EXPECT_THAT(x_in_img, IsNearMatrix(Eigen::Vector2d(200.5, 150.5), 0.05));
}

// Found in a reduced copy, refined at full size: as exact in pixels as in a small photo.
TEST(BoardDetection, IsExactInLargePhotos) {
  const Camera truth = LensThatCallsFor(CameraModel::kOpenCv, 3600, 2400);
  const Board board = Checkerboard(9, 6);
  BoardSetOptions set;
  set.num_photos = 1;
  set.seed = 5;
  const std::vector<Rigid> poses = MakeBoardPoses(truth, board, set);
  const TempFolder folder;
  BoardPhotoOptions options;
  options.blur_px = 1.5;
  WriteBoardPhotos(folder / "boards", truth, board, poses, options);
  const std::vector<BoardPhoto> photos = Find(folder / "boards", board);
  ASSERT_EQ(photos[0].reason, "");
  EXPECT_EQ(photos[0].NumCorners(), 54);
  EXPECT_LT(DetectionRms(photos[0], ObserveBoards(truth, board, poses, 0, 1)[0]), 0.06);
}

// One set of photos of a 9x6 board for what follows.
class BoardFolder : public ::testing::Test {
 protected:
  static constexpr int kCount = 8;
  void SetUp() override {
    BoardSetOptions set;
    set.num_photos = kCount;
    poses_ = MakeBoardPoses(truth_, board_, set);
    names_ = WriteBoardPhotos(path(), truth_, board_, poses_, {});
  }
  std::string path() const { return folder_ / "boards"; }
  std::string File(int i) const { return path() + "/" + names_[i]; }

  const TempFolder folder_;
  const Camera truth_ = LensThatCallsFor(CameraModel::kOpenCv, kWidth, kHeight);
  const Board board_ = Checkerboard(9, 6);
  std::vector<Rigid> poses_;
  std::vector<std::string> names_;
};

TEST_F(BoardFolder, DoesNotDependOnTheNumberOfThreads) {
  const std::vector<BoardPhoto> one = Find(path(), board_, 1), three = Find(path(), board_, 3);
  ASSERT_EQ(one.size(), three.size());
  for (size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].name, three[i].name);
    EXPECT_EQ(one[i].x_in_img, three[i].x_in_img);
  }
}

TEST_F(BoardFolder, NamesTheBoardThatIsThereInstead) {
  for (int i = 2; i < kCount; ++i) std::filesystem::remove(File(i));
  EXPECT_INPUT_ERROR(
      Find(path(), Checkerboard(10, 7)),
      "2 of 2 photos show one of 9x6. Give --board 9x6: the inner corners are counted");
  EXPECT_INPUT_ERROR(Find(path(), Checkerboard(8, 6)), "show one of 9x6. Give --board 9x6.");
}

TEST_F(BoardFolder, TakesRowsForColumnsToo) {
  const Calibration a = Calibrate(Find(path(), board_), board_, {}, path());
  const Board turned = Checkerboard(6, 9);
  const Calibration b = Calibrate(Find(path(), turned), turned, {}, path());
  ASSERT_EQ(a.camera.model, b.camera.model);
  for (size_t i = 0; i < a.camera.params.size(); ++i) {
    EXPECT_NEAR(a.camera.params[i], b.camera.params[i], 0.05 * a.params_sigma[i]);
  }
}

TEST_F(BoardFolder, LeavesOutAndNamesWhatCannotBeUsed) {
  // Another board, in the place of photo 2; far out of focus in 4; no board in 5; a file
  // that ends early in 6.
  BoardPhotoOptions other;
  other.stretch = 1.05;
  cv::imwrite(File(2), BoardRenderer(truth_).Render(board_, poses_[2], other));
  cv::Mat blurred = cv::imread(File(4));
  cv::GaussianBlur(blurred, blurred, {}, 11);
  cv::imwrite(File(4), blurred);
  cv::imwrite(File(5), cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar(90, 120, 100)));
  WriteBytes(File(6), ReadBytes(File(6)).substr(0, 2000));
  // Enough good ones to tell.
  BoardSetOptions more;
  more.num_photos = 8;
  more.seed = 77;
  WriteBoardPhotos(path() + "/more", truth_, board_, MakeBoardPoses(truth_, board_, more), {});
  const Calibration found = Calibrate(Find(path(), board_), board_, {}, path());
  for (const CalibratedPhoto& photo : found.photos) {
    const bool bad = photo.name == names_[2] || photo.name == names_[4] ||
                     photo.name == names_[5] || photo.name == names_[6];
    EXPECT_EQ(photo.used, !bad) << photo.name << " " << photo.reason;
  }
  EXPECT_NE(found.photos[2].reason.find("another board"), std::string::npos)
      << found.photos[2].reason;
  EXPECT_NE(found.photos[5].reason.find("no checkerboard of 9x6"), std::string::npos)
      << found.photos[5].reason;
  EXPECT_NE(found.photos[6].reason.find("cannot be read"), std::string::npos)
      << found.photos[6].reason;
  EXPECT_LT(RmsWhereCovered(truth_, found), 0.1);

  const cv::Mat picture = DrawCalibration(found);
  EXPECT_EQ(picture.type(), CV_8UC3);
  EXPECT_GT(picture.cols, 1200);
}

TEST_F(BoardFolder, RefusesPhotosOfDifferentSizes) {
  cv::Mat turned;
  cv::rotate(cv::imread(File(3)), turned, cv::ROTATE_90_CLOCKWISE);
  cv::imwrite(File(3), turned);
  EXPECT_INPUT_ERROR(Find(path(), board_), "7 of 640x426 (board_000.png)");
  EXPECT_INPUT_ERROR(Find(path(), board_), "as the camera stored");
}

TEST(BoardPhotos, AreMissed) {
  const TempFolder folder;
  EXPECT_INPUT_ERROR(ListPhotoFiles(folder / "nowhere", ""), "nowhere");
  EXPECT_INPUT_ERROR(ListPhotoFiles(folder.path(), ""), "holds no photos");
  WriteBytes(folder / "a.jpg", "no picture at all");
  EXPECT_INPUT_ERROR(Find(folder.path(), Checkerboard(9, 6)), "none of its 1 photos can be read");
  cv::imwrite(folder / "a.jpg", cv::Mat(200, 300, CV_8U, cv::Scalar(128)));
  EXPECT_INPUT_ERROR(Find(folder.path(), Checkerboard(9, 6)), "found in none of the 1 photos");
}

Board Charuco(const std::string& size, double marker = 0.0175,
              const std::string& dictionary = "DICT_5X5_50") {
  BoardOptions options;
  options.type = "charuco";
  options.size = size;
  options.marker = marker;
  options.dictionary = dictionary;
  return MakeBoard(options);
}

// Boards that hang out of the picture, of both layouts, columns given for rows.
TEST(Charuco, CalibratesFromPartsOfTheBoard) {
  const Camera truth = LensThatCallsFor(CameraModel::kOpenCv, 800, 534);
  const Board board = Charuco("10x7");
  for (const bool black : {true, false}) {
    BoardSetOptions set;
    set.num_photos = 12;
    set.whole = false;
    set.size = 0.8;
    set.seed = 3;
    const std::vector<Rigid> poses = MakeBoardPoses(truth, board, set);
    BoardPhotoOptions options;
    options.upper_left_is_black = black;
    const TempFolder folder;
    WriteBoardPhotos(folder / "boards", truth, board, poses, options);
    const Board named = black ? board : Charuco("7x10");
    const std::vector<BoardPhoto> photos = Find(folder / "boards", named);
    const std::vector<BoardPhoto> expected = ObserveBoards(truth, board, poses, 0, 1);
    int num_whole = 0;
    for (size_t i = 0; i < photos.size(); ++i) {
      ASSERT_EQ(photos[i].reason, "") << i;
      EXPECT_LT(DetectionRms(photos[i], expected[i]), 0.08) << i;
      num_whole += photos[i].NumCorners() == board.NumCorners();
    }
    EXPECT_LT(num_whole, 4);
    const Calibration found = Calibrate(photos, named, {}, "boards");
    EXPECT_EQ(found.camera.model, CameraModel::kOpenCv) << found.why_model;
    EXPECT_TRUE(found.reasons.empty());
    // Half as many corners as of whole boards.
    EXPECT_LT(RmsWhereCovered(truth, found), 0.15);
  }
}

TEST(Charuco, SaysWhichMarkersAreThere) {
  const Camera truth = LensThatCallsFor(CameraModel::kOpenCv, 800, 534);
  BoardSetOptions set;
  set.num_photos = 1;
  const Board board = Charuco("10x7");
  const TempFolder folder;
  WriteBoardPhotos(folder / "boards", truth, board, MakeBoardPoses(truth, board, set), {});
  EXPECT_INPUT_ERROR(Find(folder / "boards", Charuco("10x7", 0.0175, "DICT_4X4_50")),
                     "give --dictionary DICT_5X5_50");
  EXPECT_INPUT_ERROR(Find(folder / "boards", Charuco("8x6")), "as on one of 10 columns");
}

TEST(Charuco, PutsTheMarkersIntoTheWhiteSquares) {
  const Board board = Charuco("4x5", 0.015);
  // Upper left black: the first marker is in the second square, whose lower left is inner corner 0.
  const auto first = MarkerOnBoard(board, {true, false}, 0);
  ASSERT_EQ(first.size(), 4u);
  EXPECT_THAT(first[0], IsNearMatrix(Eigen::Vector2d(0.005, -0.020), 1e-12));
  EXPECT_THAT(first[2], IsNearMatrix(Eigen::Vector2d(0.020, -0.005), 1e-12));
  const auto other = MarkerOnBoard(board, {false, false}, 0);
  EXPECT_THAT(other[0], IsNearMatrix(Eigen::Vector2d(-0.020, -0.020), 1e-12));
  EXPECT_EQ(MarkerOnBoard(board, {true, false}, 9).size(), 4u);
  EXPECT_TRUE(MarkerOnBoard(board, {true, false}, 10).empty());
}

}  // namespace
}  // namespace roomtex
