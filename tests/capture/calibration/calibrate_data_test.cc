// OpenCV's own sample photos of a board (Debian's package opencv-doc), 9x6 inner corners.

#include <cmath>
#include <filesystem>

#include <gtest/gtest.h>
#include <opencv2/core/persistence.hpp>

#include "capture/calibration/calibration.h"
#include "capture/calibration/calibration_uncertainty.h"
#include "tests/capture/calibration/calibration_boards.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

const char kSamplePhotos[] = "/usr/share/doc/opencv-doc/examples/data";

TEST(SampleBoards, GiveThePublishedCamera) {
  if (!std::filesystem::exists(std::string(kSamplePhotos) + "/left01.jpg")) {
    GTEST_SKIP() << "Debian's package opencv-doc is not installed (" << kSamplePhotos << ")";
  }
  std::vector<std::string> names;
  for (int i = 1; i <= 14; ++i) {
    if (i == 10) continue;  // there is none
    names.push_back((i < 10 ? "left0" : "left") + std::to_string(i) + ".jpg");
  }
  Progress progress(true);
  const Board board = Checkerboard(9, 6);
  const Calibration found =
      Calibrate(FindBoards(kSamplePhotos, names, board, -1, &progress), board, {}, kSamplePhotos);
  EXPECT_EQ(found.camera.model, CameraModel::kOpenCv) << found.why_model;
  EXPECT_EQ(found.NumUsed(), 13);
  EXPECT_TRUE(found.reasons.empty());
  EXPECT_LT(found.rms_px, 0.25);

  // The calibration that lies beside the photos: k1, k2, p1, p2, k3. Its principal point counts
  // from the middle of the first pixel, and its second photo misses by 1.2 px, which bends it: its
  // own error is more than ours.
  cv::Mat K, distortion, per_view;
  cv::FileStorage file(std::string(kSamplePhotos) + "/left_intrinsics.yml", cv::FileStorage::READ);
  file["camera_matrix"] >> K;
  file["distortion_coefficients"] >> distortion;
  file["per_view_reprojection_errors"] >> per_view;
  ASSERT_EQ(K.total(), 9u);
  ASSERT_EQ(distortion.total(), 5u);
  Camera published;
  published.model = CameraModel::kFullOpenCv;
  published.width = 640;
  published.height = 480;
  const double* const d = distortion.ptr<double>();
  published.params = {K.at<double>(0, 0),
                      K.at<double>(1, 1),
                      K.at<double>(0, 2) + 0.5,
                      K.at<double>(1, 2) + 0.5,
                      d[0],
                      d[1],
                      d[2],
                      d[3],
                      d[4],
                      0,
                      0,
                      0};
  EXPECT_NEAR(found.camera.params[0], published.params[0], 4);
  EXPECT_NEAR(found.camera.params[1], published.params[1], 4);
  EXPECT_NEAR(found.camera.params[2], published.params[2], 3);
  EXPECT_NEAR(found.camera.params[3], published.params[3], 3);
  // Where boards are, the two cameras see alike to about the error that the file states.
  Eigen::Matrix2Xd corners(2, 0);
  for (const CalibratedPhoto& photo : found.photos) {
    Eigen::Matrix2Xd more(2, corners.cols() + photo.x_in_img.cols());
    more << corners, photo.x_in_img;
    corners = more;
  }
  const Eigen::Matrix2Xd off = MappingDifference(found.camera, published, corners, corners);
  EXPECT_LT(std::sqrt(off.squaredNorm() / static_cast<double>(off.cols())), 1.2);
  // Photo by photo we are at least as near as the file is.
  for (int i = 0; i < 13; ++i) {
    EXPECT_LT(found.photos[i].rms_px, per_view.at<float>(i) + 0.08) << names[i];
  }
}

}  // namespace
}  // namespace roomtex
