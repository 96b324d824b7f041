// The photos of the simulated room against its truth.

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "capture/simulation/simulated_room.h"
#include "core/camera_model.h"
#include "core/frames.h"
#include "core/photo.h"
#include "core/ray_caster.h"
#include "core/scan_mesh.h"
#include "core/statistics.h"
#include "tests/capture/simulation/small_room.h"

namespace roomtex {
namespace {

struct ColorErrors {
  size_t count = 0;
  double median = 0;  // absolute, all channels, sRGB 0..1, the exposure taken out
  double bias = 0;    // median of the signed differences
};

// Scan points that the photo sees (by a mesh of the scan) against the pixel that they fall on.
ColorErrors CompareWithTruth(const SimulatedRoom& room, int photo, const cv::Mat& image,
                             int station) {
  const Scan scan = room.MakeScan(station);
  const std::vector<Eigen::Vector3f> truth = room.TrueColors(station);
  const RayCaster caster(scan.points, BuildScanMesh(scan, {}));
  const CameraProjection camera(room.camera());
  const Rigid cam_from_scan = room.CamFromScan(photo);
  const Eigen::Vector3d centre = cam_from_scan.TargetOriginInSource();
  const double gain = std::exp2(room.ExposureEv(photo));
  std::vector<double> absolute, differences;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    const auto at = camera.ImgFromCam(cam_from_scan * scan.points[i]);
    if (!at || !camera.InImage(*at)) continue;
    if (caster.IsOccluded(centre, scan.points[i], 0.02)) continue;
    const int x = std::min(static_cast<int>(at->x()), image.cols - 1);
    const int y = std::min(static_cast<int>(at->y()), image.rows - 1);
    for (int k = 0; k < 3; ++k) {
      const double want = SrgbFromLinear(std::min(1.0, gain * truth[i][k]));
      differences.push_back(image.at<cv::Vec3b>(y, x)[2 - k] / 255.0 - want);
      absolute.push_back(std::abs(differences.back()));
    }
  }
  return {differences.size(), Median(absolute, std::nan("")), Median(differences, std::nan(""))};
}

int CountSiftFeatures(const SimulatedRoom& room, int photo) {
  cv::Mat grey;
  cv::cvtColor(room.RenderPhoto(photo), grey, cv::COLOR_BGR2GRAY);
  std::vector<cv::KeyPoint> keypoints;
  cv::SIFT::create()->detect(grey, keypoints);
  return static_cast<int>(keypoints.size());
}

TEST(SimulatedPhotos, ShowTheTrueColorsOfTheScanPoints) {
  for (const bool shading : {false, true}) {
    SimulatedRoomOptions options = SmallRoom();
    options.photo_width = 960;
    options.photo_height = 640;
    options.range_noise = 0;
    options.num_stations = 2;
    options.shading = shading;
    const SimulatedRoom room(options);
    for (const int photo : {0, 7}) {
      const cv::Mat image = room.RenderPhoto(photo);
      for (const int station : {0, 1}) {
        const ColorErrors errors = CompareWithTruth(room, photo, image, station);
        EXPECT_GT(errors.count, 10000u);
        EXPECT_LT(errors.median, 0.035) << "photo " << photo << " station " << station;
        EXPECT_NEAR(errors.bias, 0, 0.01) << "photo " << photo << " station " << station;
      }
    }
  }
}

TEST(SimulatedPhotos, AgreeWithTheTruthForEveryCameraModel) {
  for (int model = 0; model < kNumCameraModels; ++model) {
    SimulatedRoomOptions options = SmallRoom();
    options.camera_model = CameraModelName(static_cast<CameraModel>(model));
    options.num_photos = 2;
    if (options.camera_model == "EQUIRECTANGULAR") options.photo_height = options.photo_width / 2;
    options.furnished = false;
    options.scan_columns = 360;
    options.scan_rows = 180;
    options.range_noise = 0;
    const SimulatedRoom room(options);
    EXPECT_TRUE(room.camera().Problems().empty()) << options.camera_model;
    // Every pixel up to the corners is reached by a ray, and the ray projects back to it.
    const CameraProjection camera(room.camera());
    for (const double x : {0.0, 240.0, 480.0}) {
      for (const double share : {0.0, 0.5, 1.0}) {
        const double y = share * options.photo_height;
        const auto ray = camera.RayFromImg({x, y});
        ASSERT_TRUE(ray.has_value()) << options.camera_model << " " << x << " " << y;
        const auto error = camera.ImgError(*ray, {x, y});
        ASSERT_TRUE(error.has_value()) << options.camera_model;
        EXPECT_LT(error->norm(), 1e-6) << options.camera_model;
      }
    }
    const ColorErrors errors = CompareWithTruth(room, 1, room.RenderPhoto(1), 0);
    EXPECT_GT(errors.count, 5000u) << options.camera_model;
    EXPECT_LT(errors.median, 0.05) << options.camera_model;
  }
}

TEST(SimulatedPhotos, MoveWithTheLensDistortion) {
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 1;
  options.furnished = false;
  options.photo_noise = 0;
  const cv::Mat distorted = SimulatedRoom(options).RenderPhoto(0);
  options.distortion = false;
  const SimulatedRoom pinhole(options);
  for (size_t i = 4; i < 8; ++i) EXPECT_EQ(pinhole.camera().params[i], 0);
  EXPECT_GT(cv::norm(distorted, pinhole.RenderPhoto(0), cv::NORM_L1) / distorted.total(), 5);
}

TEST(SimulatedPhotos, VarnishMirrorsOnTheFloorAloneAndInThePhotosAlone) {
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 2;
  options.furnished = false;
  options.scan_columns = 240;
  options.scan_rows = 120;
  const SimulatedRoom matt(options);
  options.gloss = 0.2;
  const SimulatedRoom glossy(options);
  EXPECT_EQ(matt.TrueColors(), glossy.TrueColors());
  const cv::Mat before = matt.RenderPhoto(0), after = glossy.RenderPhoto(0);
  const Rigid room_from_cam = matt.CamFromRoom(0).Inverse();
  const CameraProjection camera(matt.camera());
  int num_floor = 0, num_changed = 0, num_wall = 0;
  for (int y = 0; y < before.rows; y += 3) {
    for (int x = 0; x < before.cols; x += 3) {
      const auto ray = camera.RayFromImg({x + 0.5, y + 0.5});
      ASSERT_TRUE(ray);
      const Eigen::Vector3d down = room_from_cam.rotation * *ray;
      const Eigen::Vector3d at =
          room_from_cam.translation - room_from_cam.translation.z() / down.z() * down;
      const bool on_floor = down.z() < 0 && at.x() > 0.1 && at.x() < options.width - 0.1 &&
                            at.y() > 0.1 && at.y() < options.depth - 0.1;
      const bool changed =
          cv::norm(before.at<cv::Vec3b>(y, x), after.at<cv::Vec3b>(y, x), cv::NORM_INF) > 6;
      if (on_floor) {
        ++num_floor;
        num_changed += changed;
      } else if (down.z() > 0 && down.z() < 0.15 * down.head<2>().norm()) {  // a bare wall
        ++num_wall;
        EXPECT_FALSE(changed) << x << " " << y;
      }
    }
  }
  EXPECT_GT(num_floor, 500);
  EXPECT_GT(num_wall, 500);
  EXPECT_GT(num_changed, 0.5 * num_floor);
}

TEST(SimulatedPhotos, CarryTheNoiseOfTheOptions) {
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 1;
  options.furnished = false;
  options.photo_noise = 0;
  const cv::Mat clean = SimulatedRoom(options).RenderPhoto(0);
  options.photo_noise = 3;
  const cv::Mat noisy = SimulatedRoom(options).RenderPhoto(0);
  double sum = 0, squares = 0, count = 0;
  for (int y = 0; y < clean.rows; ++y) {
    for (int x = 0; x < clean.cols; ++x) {
      for (int k = 0; k < 3; ++k) {
        const int grey = clean.at<cv::Vec3b>(y, x)[k];
        if (grey < 20 || grey > 235) continue;
        const double difference = noisy.at<cv::Vec3b>(y, x)[k] - grey;
        sum += difference;
        squares += difference * difference;
        ++count;
      }
    }
  }
  EXPECT_NEAR(sum / count, 0, 0.05);
  // Rounding to bytes, twice, adds about 1/6 to the variance.
  EXPECT_NEAR(std::sqrt(squares / count), 3.0, 0.1);
}

TEST(SimulatedPhotos, BlurTakesDetailAway) {
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 1;
  options.furnished = false;
  options.photo_noise = 0;
  const auto detail = [&] {
    cv::Mat laplacian;
    cv::Laplacian(SimulatedRoom(options).RenderPhoto(0), laplacian, CV_32F);
    return cv::norm(laplacian, cv::NORM_L1);
  };
  const double sharp = detail();
  options.blur_px = 2;
  EXPECT_LT(detail(), 0.35 * sharp);
}

TEST(SimulatedPhotos, HoldFeaturesEverywhereButInABareRoom) {
  SimulatedRoomOptions options = SmallRoom();
  options.photo_width = 960;
  options.photo_height = 640;
  options.exposure_range_ev = 0;
  const SimulatedRoom furnished(options);
  for (int photo = 0; photo < furnished.NumPhotos(); photo += 4) {
    EXPECT_GT(CountSiftFeatures(furnished, photo), 1500) << "photo " << photo;
  }
  options.furnished = false;
  options.bare_walls = true;
  const SimulatedRoom bare(options);
  for (int photo = 0; photo < bare.NumPhotos(); photo += 4) {
    EXPECT_LT(CountSiftFeatures(bare, photo), 60) << "photo " << photo;
  }
}

TEST(SimulatedPhotos, AreSteppedInThirdsOfAnEvWithinTheRange) {
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 40;
  const SimulatedRoom room(options);
  double least = 9, most = -9;
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const double ev = room.ExposureEv(photo);
    EXPECT_LE(std::abs(ev), 1.0 + 1e-12);
    EXPECT_NEAR(3 * ev, std::round(3 * ev), 1e-9);
    EXPECT_NEAR(room.ExposureTime(photo) / room.ExposureTime(0), std::exp2(ev - room.ExposureEv(0)),
                1e-9);
    least = std::min(least, ev);
    most = std::max(most, ev);
  }
  EXPECT_GE(most - least, 1.0);
  options.exposure_range_ev = 0;
  options.num_photos = 3;
  const SimulatedRoom even(options);
  for (int photo = 0; photo < 3; ++photo) EXPECT_EQ(even.ExposureEv(photo), 0);
}

SimulatedRoomOptions HeldByHand() {
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 2;
  options.photo_noise = 0;
  options.range_noise = 0;
  options.rolling_shutter_ms = 30;
  options.hand_turn_deg = 60;
  options.hand_move = 0.3;
  return options;
}

// Each row is what a photo taken at once from the pose of that row shows there.
void ExpectRowsOfAMovingHand(const SimulatedRoomOptions& options) {
  const bool upright = options.photo_height > options.photo_width;
  const SimulatedRoom room(options);
  const cv::Mat photo = room.RenderPhoto(1);
  const CameraProjection camera(room.camera());
  const TrueSamples samples = room.MakeTrueSamples();
  const std::vector<Eigen::Vector2f> seen = room.TrueSightings(samples, 1);
  size_t num_seen = 0;
  double most_turned = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    if (!(seen[i].x() >= 0)) continue;
    ++num_seen;
    const double share = upright ? seen[i].x() / options.photo_width - 0.5
                                 : seen[i].y() / options.photo_height - 0.5;
    const auto at_row = camera.ImgFromCam(room.CamFromRoomAt(1, share) * samples.points[i]);
    const auto at_once = camera.ImgFromCam(room.CamFromRoom(1) * samples.points[i]);
    ASSERT_TRUE(at_row && at_once);
    EXPECT_LT((at_row->cast<float>() - seen[i]).norm(), 1e-3);
    most_turned = std::max(most_turned, (*at_row - *at_once).norm());
  }
  EXPECT_GT(num_seen, 10000u);
  EXPECT_GT(most_turned, 4);
  const double turn = DegFromRad(
      RotationAngle(room.CamFromRoomAt(1, 0.5).rotation, room.CamFromRoomAt(1, -0.5).rotation));
  EXPECT_NEAR(turn, 60 * 0.030, 1e-6);

  // Colours of the points, in the places where the photo shows them by its rows.
  const auto error_at = [&](const auto& place_of) {
    const std::vector<Eigen::Vector3f> truth = room.TrueColors();
    const double gain = std::exp2(room.ExposureEv(1));
    std::vector<double> errors;
    for (size_t i = 0; i < seen.size(); ++i) {
      if (!(seen[i].x() >= 0)) continue;
      const Eigen::Vector2d at = place_of(i);
      if (!camera.InImage(at)) continue;
      const auto& pixel = photo.at<cv::Vec3b>(std::min<int>(at.y(), photo.rows - 1),
                                              std::min<int>(at.x(), photo.cols - 1));
      for (int k = 0; k < 3; ++k) {
        const double want = SrgbFromLinear(std::min(1.0, gain * truth[i][k]));
        errors.push_back(std::abs(pixel[2 - k] / 255.0 - want));
      }
    }
    return Median(&errors);
  };
  const double by_rows =
      error_at([&](size_t i) { return Eigen::Vector2d(seen[i].cast<double>()); });
  const double by_the_middle = error_at([&](size_t i) {
    return Eigen::Vector2d(*camera.ImgFromCam(room.CamFromRoom(1) * samples.points[i]));
  });
  EXPECT_LT(by_rows, 0.035);
  EXPECT_LT(by_rows, 0.7 * by_the_middle);
}

TEST(SimulatedPhotos, AreReadRowByRowWhileTheHandMoves) { ExpectRowsOfAMovingHand(HeldByHand()); }

// Rows lie along the longer side.
TEST(SimulatedPhotos, TakenUprightAreReadFromTheLeft) {
  SimulatedRoomOptions options = HeldByHand();
  std::swap(options.photo_width, options.photo_height);
  ExpectRowsOfAMovingHand(options);
}

TEST(SimulatedPhotos, AreBlurredAsOftenAsAsked) {
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 2;
  options.blur_px = 3;
  options.blurred = 0.5;
  const SimulatedRoom some(options);
  options.blur_px = 0;
  const SimulatedRoom none(options);
  for (int photo = 0; photo < 2; ++photo) {
    EXPECT_EQ(some.IsBlurred(photo), photo % 2 == 1);
    const double difference =
        cv::norm(some.RenderPhoto(photo), none.RenderPhoto(photo), cv::NORM_L1);
    EXPECT_EQ(difference > 0, photo % 2 == 1) << photo;
  }
}

// Sharp across the motion, smeared along it; things stay where they are.
TEST(SimulatedPhotos, AreShaken) {
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 2;
  options.photo_noise = 0;
  const SimulatedRoom still(options);
  options.motion_px = 9;
  const SimulatedRoom shaken(options);
  const auto grey_of = [](const cv::Mat& photo) {
    cv::Mat grey;
    cv::cvtColor(photo, grey, cv::COLOR_BGR2GRAY);
    return cv::Mat1f(grey);
  };
  const auto structure = [&](const cv::Mat& photo) {
    cv::Mat1f dx, dy;
    cv::Sobel(grey_of(photo), dx, CV_32F, 1, 0);
    cv::Sobel(grey_of(photo), dy, CV_32F, 0, 1);
    Eigen::Matrix2d energy;
    energy << dx.dot(dx), dx.dot(dy), dx.dot(dy), dy.dot(dy);
    return energy;
  };
  std::vector<double> angles;
  for (int photo = 0; photo < 2; ++photo) {
    const cv::Mat a = still.RenderPhoto(photo), b = shaken.RenderPhoto(photo);
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix2d> kept(structure(b),
                                                                         structure(a));
    EXPECT_LT(kept.eigenvalues()[0], 0.2) << photo;
    EXPECT_GT(kept.eigenvalues()[1], 2 * kept.eigenvalues()[0]) << photo;
    angles.push_back(std::atan2(kept.eigenvectors()(1, 0), kept.eigenvectors()(0, 0)));
    const cv::Point2d shift = cv::phaseCorrelate(grey_of(a), grey_of(b));
    EXPECT_LT(std::hypot(shift.x, shift.y), 0.3) << photo;
  }
  EXPECT_GT(std::abs(std::sin(angles[1] - angles[0])), 0.1);
}

}  // namespace
}  // namespace roomtex
