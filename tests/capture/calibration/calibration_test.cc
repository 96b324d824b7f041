// The camera from corners of boards: against the truth, against OpenCV, and when it must not be
// trusted. Corners are projected and get Gaussian noise; calibration_photos_test.cc has pictures.

#include "capture/calibration/calibration.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include "capture/calibration/calibration_uncertainty.h"
#include "core/error.h"
#include "core/random_stream.h"
#include "tests/capture/calibration/calibration_boards.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

const CameraModel kLenses[] = {CameraModel::kSimpleRadial, CameraModel::kRadial,
                               CameraModel::kOpenCv, CameraModel::kFullOpenCv};

// Pixels per coordinate, of corners in the pictures of calibration_photos_test.cc.
constexpr double kDetectionNoise = 0.03;

std::vector<BoardPhoto> Observe(const Camera& camera, const BoardSetOptions& options,
                                double noise_px) {
  const Board board = Checkerboard(9, 6);
  return ObserveBoards(camera, board, MakeBoardPoses(camera, board, options), noise_px,
                       options.seed);
}

Calibration CalibrateCorners(const std::vector<BoardPhoto>& photos,
                             const CalibrationOptions& options = {}) {
  return Calibrate(photos, Checkerboard(9, 6), options, "boards");
}

bool AnyHolds(const std::vector<std::string>& sentences, const std::string& text) {
  return std::any_of(sentences.begin(), sentences.end(), [&](const std::string& sentence) {
    return sentence.find(text) != std::string::npos;
  });
}

// All corners seen.
Eigen::Matrix2Xd Covered(const Calibration& calibration) {
  Eigen::Matrix2Xd all(2, 0);
  for (const CalibratedPhoto& photo : calibration.photos) {
    if (!photo.used) continue;
    Eigen::Matrix2Xd more(2, all.cols() + photo.x_in_img.cols());
    more << all, photo.x_in_img;
    all = more;
  }
  return all;
}

double CoveredRms(const Camera& truth, const Calibration& calibration) {
  const Eigen::Matrix2Xd covered = Covered(calibration);
  const Eigen::Matrix2Xd off = MappingDifference(truth, calibration.camera, covered, covered);
  return std::sqrt(off.squaredNorm() / static_cast<double>(off.cols()));
}

// Twenty sets: the model that the lens calls for, parameters within their standard deviations, and
// those are right: the errors divided by them scatter by 1.
TEST(Calibration, FindsTheTrueCameraWithinItsStandardDeviations) {
  double sum = 0;
  int count = 0, beyond_three = 0;
  for (const CameraModel lens : kLenses) {
    const Camera truth = LensThatCallsFor(lens, 1500, 1000);
    for (int i = 0; i < 5; ++i) {
      BoardSetOptions set;
      set.seed = MixBits(static_cast<uint64_t>(lens), static_cast<uint64_t>(i));
      const Calibration found = CalibrateCorners(Observe(truth, set, kDetectionNoise));
      EXPECT_EQ(found.camera.model, truth.model) << found.why_model;
      if (found.camera.model != truth.model) continue;
      EXPECT_TRUE(found.reasons.empty()) << found.reasons[0];
      EXPECT_FALSE(found.bow.used) << found.bow.height << " " << found.bow.focal_percent;
      EXPECT_LT(found.photo_scatter, 2);
      EXPECT_EQ(found.NumUsed(), set.num_photos);
      EXPECT_LT(CoveredRms(truth, found), 0.1);
      for (int k = 0; k < found.lens.num_free; ++k) {
        const double error = (found.camera.params[k] - truth.params[k]) / found.params_sigma[k];
        sum += error * error;
        beyond_three += !(std::abs(error) < 3);
        EXPECT_LT(std::abs(error), 4.5) << "parameter " << k;
        ++count;
      }
    }
  }
  EXPECT_EQ(count, 5 * (4 + 5 + 8 + 9));
  EXPECT_LE(beyond_three, 2);
  EXPECT_GT(std::sqrt(sum / count), 0.8);
  EXPECT_LT(std::sqrt(sum / count), 1.2);
}

// OpenCV's calibrateCamera minimises the same squares: same corners, same camera. Its standard
// deviations are too large, because it takes the points for the number of measurements, where each
// point has two coordinates (calibration.cpp of OpenCV 4.6); apart from that they are the same.
TEST(Calibration, GivesOpenCvsCameraForTheSameCorners) {
  const Camera truth = LensThatCallsFor(CameraModel::kOpenCv, 1500, 1000);
  BoardSetOptions set;
  set.num_photos = 10;
  const std::vector<BoardPhoto> photos = Observe(truth, set, 0.1);
  const Board board = Checkerboard(9, 6);
  std::vector<std::vector<cv::Point3f>> on_board;
  std::vector<std::vector<cv::Point2f>> in_img;
  std::vector<BoardView> views;
  for (const BoardPhoto& photo : photos) {
    views.push_back(MakeBoardView(photo, board));
    on_board.emplace_back();
    in_img.emplace_back();
    for (int i = 0; i < photo.NumCorners(); ++i) {
      const Eigen::Vector2d x = board.CornerOnBoard(photo.corner_ids[i]);
      on_board.back().emplace_back(x.x(), x.y(), 0);
      in_img.back().emplace_back(photo.x_in_img(0, i), photo.x_in_img(1, i));
    }
  }
  cv::Mat K, distortion, sigmas;
  cv::calibrateCamera(on_board, in_img, {truth.width, truth.height}, K, distortion, cv::noArray(),
                      cv::noArray(), sigmas, cv::noArray(), cv::noArray(), cv::CALIB_FIX_K3,
                      {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 300, 1e-14});
  CameraFit fit =
      FitCamera(views, {CameraModel::kOpenCv, 8}, RoughFit(views, truth.width, truth.height), 0);
  Finish(views, &fit);
  const double expected[] = {K.at<double>(0, 0),       K.at<double>(1, 1),
                             K.at<double>(0, 2),       K.at<double>(1, 2),
                             distortion.at<double>(0), distortion.at<double>(1),
                             distortion.at<double>(2), distortion.at<double>(3)};
  const double num_points = 540, num_unknowns = 8 + 6 * 10;
  const double theirs = std::sqrt((num_points - num_unknowns) / (2 * num_points - num_unknowns));
  for (int i = 0; i < 8; ++i) {
    const double sigma = theirs * sigmas.at<double>(i);
    // The positions went through floats.
    EXPECT_NEAR(fit.camera.params[i], expected[i], 0.01 * sigma) << i;
    EXPECT_NEAR(std::sqrt(fit.covariance(i, i)), sigma, 0.01 * sigma) << i;
  }
}

TEST(Calibration, LeavesOutPhotosOfAnotherBoardAndNamesThem) {
  const Camera truth = LensThatCallsFor(CameraModel::kOpenCv, 1500, 1000);
  const std::vector<BoardPhoto> good = Observe(truth, {}, 0.05);
  std::vector<BoardPhoto> photos = good;
  // Another board: its columns 4 % too wide, seen from where photos 3 and 9 were taken.
  Board stretched = Checkerboard(9, 6);
  const std::vector<Rigid> poses = MakeBoardPoses(truth, stretched, {});
  const CameraProjection projection(truth);
  for (const int i : {3, 9}) {
    for (int k = 0; k < photos[i].NumCorners(); ++k) {
      const Eigen::Vector2d x = stretched.CornerOnBoard(photos[i].corner_ids[k]);
      photos[i].x_in_img.col(k) =
          *projection.ImgFromCam(poses[i] * Eigen::Vector3d(1.04 * x.x(), x.y(), 0));
    }
  }
  const Calibration found = CalibrateCorners(photos);
  for (int i = 0; i < 15; ++i) {
    EXPECT_EQ(found.photos[i].used, i != 3 && i != 9) << i;
    EXPECT_EQ(found.photos[i].reason.empty(), found.photos[i].used);
  }
  EXPECT_NE(found.photos[3].reason.find("another board"), std::string::npos)
      << found.photos[3].reason;
  EXPECT_TRUE(AnyHolds(found.warnings, "photo_3 is left out"));
  EXPECT_TRUE(found.reasons.empty());
  // As if they had never been there.
  std::vector<BoardPhoto> rest = good;
  rest.erase(rest.begin() + 9);
  rest.erase(rest.begin() + 3);
  const Calibration without = CalibrateCorners(rest);
  for (int i = 0; i < 8; ++i) {
    EXPECT_NEAR(found.camera.params[i], without.camera.params[i], 0.02 * without.params_sigma[i]);
  }
}

TEST(Calibration, LeavesOutASingleCornerThatIsOff) {
  const Camera truth = LensThatCallsFor(CameraModel::kOpenCv, 1500, 1000);
  std::vector<BoardPhoto> photos = Observe(truth, {}, 0.05);
  photos[4].x_in_img.col(17) += Eigen::Vector2d(5, -3);
  const Calibration found = CalibrateCorners(photos);
  EXPECT_TRUE(found.photos[4].used);
  EXPECT_EQ(found.photos[4].num_bad_corners, 1);
  EXPECT_FALSE(found.photos[4].corner_used[17]);
  EXPECT_LT(CoveredRms(truth, found), 0.1);
}

// A noisy photo counts for less, and does not blow up the standard deviations of the rest.
TEST(Calibration, WeighsPhotosByTheirNoise) {
  const Camera truth = LensThatCallsFor(CameraModel::kOpenCv, 1500, 1000);
  std::vector<BoardPhoto> photos = Observe(truth, {}, 0.05);
  const Calibration before = CalibrateCorners(photos);
  BoardSetOptions noisy;
  noisy.num_photos = 17;
  const std::vector<BoardPhoto> more = Observe(truth, noisy, 0.125);
  photos.insert(photos.end(), more.end() - 2, more.end());
  photos[15].name = "noisy_0";
  const Calibration after = CalibrateCorners(photos);
  EXPECT_EQ(after.NumUsed(), 17);
  EXPECT_NEAR(after.sigma_px, 0.05, 0.004);
  EXPECT_LT(after.params_sigma[0], 1.05 * before.params_sigma[0]);
}

std::vector<BoardPhoto> ObserveBowed(const Camera& camera, const BoardSetOptions& options,
                                     double bow, int power = 2) {
  const Board board = Checkerboard(9, 6);
  return ObserveBoards(camera, board, MakeBoardPoses(camera, board, options), kDetectionNoise,
                       options.seed, bow, power);
}

// A bow is the same in all photos: no scatter tells of it, and taken for flat it lengthens the
// focal length by many of its standard deviations.
TEST(Calibration, TakesTheBowOfABoardIntoAccount) {
  for (const uint64_t seed : {1, 2}) {
    const Camera truth = LensThatCallsFor(CameraModel::kOpenCv, 1500, 1000);
    BoardSetOptions set;
    set.seed = seed;
    for (const double bow : {-0.002, 0.0005, 0.001, 0.003}) {
      const Calibration found = CalibrateCorners(ObserveBowed(truth, set, bow));
      EXPECT_TRUE(found.bow.used) << bow;
      EXPECT_NEAR(found.bow.height, std::abs(bow), 0.05 * std::abs(bow) + 3e-5);
      EXPECT_GT(std::abs(found.bow.focal_percent), 0.2);
      EXPECT_EQ(found.camera.model, truth.model);
      EXPECT_TRUE(found.reasons.empty()) << found.reasons[0];
      EXPECT_TRUE(AnyHolds(found.warnings, "the board is not flat"));
      for (int k = 0; k < found.lens.num_free; ++k) {
        EXPECT_NEAR(found.camera.params[k], truth.params[k], 4 * found.params_sigma[k]) << k;
      }
      // Edges that curl up are described less well, and near enough.
      const Calibration curled = CalibrateCorners(ObserveBowed(truth, set, bow, 4));
      EXPECT_TRUE(curled.bow.used);
      for (int k : {0, 1}) {
        const double focal = curled.camera.params[curled.lens.num_free > 5 ? k : 0];
        EXPECT_NEAR(focal, truth.params[k], 0.003 * truth.params[k]);
      }
    }
  }
}

// Focus touched half way through.
TEST(Calibration, DoesNotTrustTwoFocalLengths) {
  BoardSetOptions set;
  const Camera truth = LensThatCallsFor(CameraModel::kOpenCv, 1500, 1000);
  Camera touched = truth;
  for (const double change : {1.003, 1.01}) {
    for (int k : {0, 1}) touched.params[k] = change * truth.params[k];
    std::vector<BoardPhoto> photos = Observe(truth, set, kDetectionNoise);
    const std::vector<BoardPhoto> others = Observe(touched, set, kDetectionNoise);
    std::copy(others.begin() + 7, others.end(), photos.begin() + 7);
    const Calibration found = CalibrateCorners(photos);
    EXPECT_TRUE(AnyHolds(found.reasons, "photos disagree")) << found.photo_scatter;
    CalibrationOptions tolerant;
    tolerant.max_photo_scatter = 1000;
    const Calibration warned = CalibrateCorners(photos, tolerant);
    EXPECT_FALSE(AnyHolds(warned.reasons, "photos disagree"));
    EXPECT_TRUE(AnyHolds(warned.warnings, "photos disagree"));
  }
}

TEST(Calibration, DoesNotTrustBoardsThatAreAllFrontal) {
  BoardSetOptions set;
  set.max_tilt_deg = 1;
  const Calibration found =
      CalibrateCorners(Observe(LensThatCallsFor(CameraModel::kOpenCv, 1500, 1000), set, 0.05));
  EXPECT_TRUE(AnyHolds(found.reasons, "held alike")) << found.max_angle_between_boards_deg;
}

TEST(Calibration, DoesNotTrustExactlyParallelBoards) {
  BoardSetOptions set;
  set.max_tilt_deg = 0;
  const Calibration found = CalibrateCorners(
      Observe(LensThatCallsFor(CameraModel::kSimpleRadial, 1500, 1000), set, 0.05));
  EXPECT_TRUE(AnyHolds(found.reasons, "held alike"));
  EXPECT_TRUE(AnyHolds(found.reasons, "focal length is not determined"));
}

TEST(Calibration, DoesNotTrustBoardsInTheMiddleOnly) {
  BoardSetOptions set;
  set.reach = 0;
  set.size = 0.25;
  const Calibration found =
      CalibrateCorners(Observe(LensThatCallsFor(CameraModel::kOpenCv, 1500, 1000), set, 0.05));
  EXPECT_TRUE(AnyHolds(found.reasons, "middle of the picture only")) << found.coverage.radius;
  EXPECT_LT(found.coverage.share, 0.3);
  for (const bool reached : found.coverage.corner_reached) EXPECT_FALSE(reached);
}

TEST(Calibration, DoesNotTrustFewPhotosAndRefusesTwo) {
  BoardSetOptions set;
  set.num_photos = 4;
  std::vector<BoardPhoto> photos =
      Observe(LensThatCallsFor(CameraModel::kSimpleRadial, 1500, 1000), set, 0.05);
  EXPECT_TRUE(AnyHolds(CalibrateCorners(photos).reasons, "only 4 photos"));
  for (const int i : {0, 2}) {
    photos[i].reason = "no checkerboard of 9x6 inner corners was found";
    photos[i].corner_ids.clear();
    photos[i].x_in_img.resize(2, 0);
  }
  EXPECT_INPUT_ERROR(CalibrateCorners(photos),
                     "found in only 2 of 4 photos; photo_0: no checkerboard");
}

// A square of another size, a board turned round or seen in a mirror, photos in another order: the
// same camera.
TEST(Calibration, DoesNotDependOnScaleOrOrder) {
  const Camera truth = LensThatCallsFor(CameraModel::kOpenCv, 1500, 1000);
  const std::vector<BoardPhoto> photos = Observe(truth, {}, 0.05);
  const Calibration expected = CalibrateCorners(photos);
  const auto expect_same = [&](const Calibration& found) {
    for (int i = 0; i < 8; ++i) {
      EXPECT_NEAR(found.camera.params[i], expected.camera.params[i],
                  0.002 * expected.params_sigma[i]);
      EXPECT_NEAR(found.params_sigma[i], expected.params_sigma[i], 0.01 * expected.params_sigma[i]);
    }
  };
  Board larger = Checkerboard(9, 6);
  larger.square = 1.7;
  expect_same(Calibrate(photos, larger, {}, "boards"));
  std::vector<BoardPhoto> turned = photos, mirrored = photos;
  for (size_t i = 0; i < photos.size(); ++i) {
    for (int& id : turned[i].corner_ids) id = 53 - id;
    for (int& id : mirrored[i].corner_ids) id = id / 9 * 9 + 8 - id % 9;
  }
  expect_same(CalibrateCorners(turned));
  expect_same(CalibrateCorners(mirrored));
  std::vector<BoardPhoto> reversed(photos.rbegin(), photos.rend());
  expect_same(CalibrateCorners(reversed));
}

TEST(Calibration, TakesTheModelThatIsAskedFor) {
  const Camera truth = LensThatCallsFor(CameraModel::kRadial, 1500, 1000);
  const std::vector<BoardPhoto> photos = Observe(truth, {}, 0.05);
  for (const std::string& name : CalibrationOptions::CameraModels()) {
    CalibrationOptions options;
    options.camera_model = name;
    const Calibration found = CalibrateCorners(photos, options);
    EXPECT_EQ(CameraModelName(found.camera.model), name == "auto" ? "RADIAL" : name);
    EXPECT_EQ(found.models.size(), name == "auto" ? 5u : name == "FULL_OPENCV" ? 2u : 1u);
    if (name != "SIMPLE_RADIAL") {
      EXPECT_LT(CoveredRms(truth, found), 0.15);
    }
  }
}

// MappingSigma against cameras drawn from the covariance.
TEST(CalibrationUncertainty, IsTheScatterOfCamerasDrawnFromTheCovariance) {
  const Camera truth = LensThatCallsFor(CameraModel::kOpenCv, 1500, 1000);
  std::vector<BoardView> views;
  for (const BoardPhoto& photo : Observe(truth, {}, 0.05)) {
    views.push_back(MakeBoardView(photo, Checkerboard(9, 6)));
  }
  CameraFit fit = FitCamera(views, {CameraModel::kOpenCv, 8}, RoughFit(views, 1500, 1000), 0);
  Finish(views, &fit);
  Eigen::Matrix2Xd places(2, 3);
  places << 0, 760, 1300, 0, 480, 900;
  const std::vector<double> sigmas = MappingSigma(fit.camera, fit.covariance, places);
  const Eigen::MatrixXd root = fit.covariance.llt().matrixL();
  RandomStream random(7);
  Eigen::Vector3d sums = Eigen::Vector3d::Zero();
  const int num_draws = 400;
  for (int draw = 0; draw < num_draws; ++draw) {
    Eigen::VectorXd normal(8);
    for (int i = 0; i < 8; ++i) normal[i] = random.Gaussian();
    Camera other = fit.camera;
    const Eigen::VectorXd step = root * normal;
    for (int i = 0; i < 8; ++i) other.params[i] += step[i];
    sums += MappingDifference(fit.camera, other, places).colwise().squaredNorm() / num_draws;
  }
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(std::sqrt(sums[i]) / sigmas[i], 1, 0.12) << i;
}

TEST(CalibrationUncertainty, DoesNotCountATurnOfTheCamera) {
  const Camera camera = LensThatCallsFor(CameraModel::kOpenCv, 1500, 1000);
  const Eigen::Matrix2Xd grid = PictureGrid(1500, 1000);
  EXPECT_THAT(MappingDifference(camera, camera, grid),
              IsNearMatrix(Eigen::Matrix2Xd::Zero(2, grid.cols()).eval(), 1e-9));
  // A long lens whose principal point is off by five pixels: a turn but for the third order.
  Camera narrow = camera;
  narrow.model = CameraModel::kSimplePinhole;
  narrow.params = {60000, 750, 500};
  Camera shifted = narrow;
  shifted.params = {60000, 755, 500};
  EXPECT_THAT(MappingDifference(narrow, shifted, grid),
              IsNearMatrix(Eigen::Matrix2Xd::Zero(2, grid.cols()).eval(), 0.01));
}

TEST(CalibrationFit, KeepsTheLensInARicherModel) {
  for (const CameraModel lens :
       {CameraModel::kSimpleRadial, CameraModel::kRadial, CameraModel::kOpenCv}) {
    const Camera camera = LensThatCallsFor(lens, 1500, 1000);
    const Camera richer = InRicherModel(camera, CameraModel::kFullOpenCv);
    ASSERT_TRUE(richer.Problems().empty());
    const Eigen::Vector3d x_in_cam(0.31, -0.22, 0.9);
    EXPECT_THAT(*CameraProjection(richer).ImgFromCam(x_in_cam),
                IsNearMatrix(*CameraProjection(camera).ImgFromCam(x_in_cam), 1e-9));
  }
}

TEST(BoardOptions, NameWhatIsWrong) {
  const auto problems = [](const std::string& size, double square,
                           const std::string& type = "checkerboard", double marker = 0) {
    BoardOptions options;
    options.size = size;
    options.square = square;
    options.type = type;
    options.marker = marker;
    const std::vector<std::string> found = options.Problems();
    return found.empty() ? std::string() : found[0];
  };
  EXPECT_EQ(problems("9x6", 0.025), "");
  EXPECT_NE(problems("9", 0.025).find("--board is \"9\", expected COLUMNSxROWS"),
            std::string::npos);
  EXPECT_NE(problems("9x-6", 0.025).find("COLUMNSxROWS"), std::string::npos);
  EXPECT_NE(problems("99999x6", 0.025).find("COLUMNSxROWS"), std::string::npos);
  EXPECT_NE(problems("2x6", 0.025).find("3 to 100"), std::string::npos);
  EXPECT_NE(problems("9x6", 0).find("--square must be above 0"), std::string::npos);
  EXPECT_NE(problems("9x6", -1).find("--square must be above 0"), std::string::npos);
  EXPECT_NE(problems("9x6", 0.025, "charuco").find("--marker must be positive"), std::string::npos);
  EXPECT_NE(problems("9x6", 0.025, "charuco", 0.03).find("less than --square"), std::string::npos);
  EXPECT_NE(
      problems("20x20", 0.025, "charuco", 0.02).find("has 200 markers, but DICT_4X4_50 only 50"),
      std::string::npos);
}

}  // namespace
}  // namespace roomtex
