#include "align/trust/photo_corners.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "align/trust/free_space.h"
#include "core/frames.h"
#include "core/report.h"
#include "core/statistics.h"
#include "tests/align/case_folder.h"
#include "tests/align/photographed_room.h"

namespace roomtex {
namespace {

// The model with the true poses, in the scan frame.
SparseModel TrueModelOf(const PhotographedRoom& one) {
  SparseModel model = one.model;
  for (auto& [id, image] : model.images) {
    for (int photo = 0; photo < one.room.NumPhotos(); ++photo) {
      if (one.room.PhotoName(photo) == image.name)
        image.cam_from_model = one.room.CamFromScan(photo);
    }
  }
  return model;
}

SimulatedRoomOptions SmallOptions() {
  SimulatedRoomOptions options;
  options.num_photos = 8;
  options.photo_width = 640;
  options.photo_height = 480;
  options.scan_columns = 800;
  options.scan_rows = 340;
  return options;
}

const PhotographedRoom& Scanned() {
  static const PhotographedRoom one(SmallOptions(), 2000, 0.5);
  return one;
}

// Degrees between where a photo shows a corner and where its true pose has it, median.
double MedianMiss(const PhotoCorners& found, const SparseModel& looked_from) {
  const SparseModel truth = TrueModelOf(Scanned());
  std::vector<double> misses;
  for (const FittingCorner& corner : found.corners) {
    const SparseImage& image = truth.images.at(corner.image_id);
    const CameraProjection projection(truth.cameras.at(image.camera_id));
    const Eigen::Vector3d x_in_scan =
        looked_from.images.at(corner.image_id).cam_from_model.Inverse() * corner.x_in_cam;
    const auto x_in_img = projection.ImgFromCam(image.cam_from_model * x_in_scan);
    misses.push_back(x_in_img ? (*x_in_img - corner.x_in_img).norm() : 1e3);
  }
  return DegFromRad(Median(&misses) / truth.cameras.begin()->second.MeanFocalLength());
}

TEST(PhotoCorners, AreWhereTheTruePosesHaveThemThoughLookedForBesideIt) {
  const FreeSpace free_space(Scanned().scans, 100000);
  const ScanViewer viewer(Scanned().scans, free_space);
  for (const double turn_deg : {0.0, 1.0}) {
    SparseModel model = TrueModelOf(Scanned());
    for (auto& [id, image] : model.images) {
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit(id % 2);
      image.cam_from_model.rotation =
          Eigen::AngleAxisd(RadFromDeg(turn_deg), axis) * image.cam_from_model.rotation;
      image.cam_from_model.translation =
          Eigen::AngleAxisd(RadFromDeg(turn_deg), axis) * image.cam_from_model.translation;
    }
    const PhotoCorners found = FindPhotoCorners({model, Scanned().folder.path()}, viewer, 100, 2);
    EXPECT_GE(found.num_photos, 6);
    EXPECT_GE(found.corners.size(), 150u);
    // The scan has a sample every 0.45 degrees.
    EXPECT_LT(MedianMiss(found, model), 0.3) << turn_deg;
  }
}

TEST(PhotoCorners, AreOfSoManyPhotosAtMostAndTheSameWithAnyNumberOfThreads) {
  const FreeSpace free_space(Scanned().scans, 100000);
  const ScanViewer viewer(Scanned().scans, free_space);
  const SparseModel model = TrueModelOf(Scanned());
  const PhotoCorners one = FindPhotoCorners({model, Scanned().folder.path()}, viewer, 5, 1);
  const PhotoCorners four = FindPhotoCorners({model, Scanned().folder.path()}, viewer, 5, 4);
  EXPECT_LE(one.num_photos, 5);
  EXPECT_GT(one.num_photos, 0);
  ASSERT_EQ(one.corners.size(), four.corners.size());
  for (size_t i = 0; i < one.corners.size(); ++i) {
    EXPECT_EQ(one.corners[i].x_in_img, four.corners[i].x_in_img);
  }
  const TempFolder empty;
  EXPECT_EQ(FindPhotoCorners({model, empty.path()}, viewer, 100, 1).num_photos, 0);
}

// A room scanned by a depth camera, whose parts drift, so that no similarity brings the sparse
// model onto all of it; the photos' rows are read one after the other.
struct DriftingCase : PhotographedRoom {
  explicit DriftingCase(int seed, double rolling_shutter_ms)
      : PhotographedRoom(
            [&] {
              SimulatedRoomOptions options = SmallOptions();
              options.random_seed = seed;
              options.num_photos = 16;
              options.depth_camera = true;
              options.rolling_shutter_ms = rolling_shutter_ms;
              return options;
            }(),
            2000, 0.5) {
    SimulatedCase files_of_case;
    files_of_case.model = sparse;
    files_of_case.scans = scans;
    files_of_case.picks = PicksOfPhoto(room, room.BestPhotoForPicks(), 8);
    files = std::make_unique<CaseFolder>(files_of_case);
  }

  SparseModel Align(const std::string& more = "") const {
    const CommandResult result = files->Align(more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return ReadSparseModel(files->output_path);
  }
  SparseModel AlignWithPhotos() const { return Align("--image_path " + folder.path()); }
  Json Report() const { return Json::parse(ReadBytes(files->folder / "aligned/alignment.json")); }

  // Millimetres, median over the photos.
  double MedianOff(const SparseModel& aligned) const {
    const SparseModel truth = TrueModelOf(*this);
    std::vector<double> offs;
    for (const auto& [id, image] : aligned.images) {
      offs.push_back(1000 * (image.cam_from_model.TargetOriginInSource() -
                             truth.images.at(id).cam_from_model.TargetOriginInSource())
                                .norm());
    }
    return Median(&offs);
  }

  std::unique_ptr<CaseFolder> files;
};

TEST(AlignCommand, HoldsPhotosByCornersWhereModelAndScanDiffer) {
  const DriftingCase one(21, 40);
  const std::string rolled = "--PlaneBA.rolling_shutter 0 ";
  const double without = one.MedianOff(one.Align(rolled)),
               with = one.MedianOff(one.Align(rolled + "--image_path " + one.folder.path()));
  const Json report = one.Report(), corners = report["plane_bundle"]["corners"];
  ASSERT_TRUE(corners.is_object());
  EXPECT_EQ(corners["used"], true);
  EXPECT_LT(corners["held_out_after_px"], corners["held_out_before_px"]);
  EXPECT_GE(corners["correlation_after"], corners["correlation_before"]);
  EXPECT_LT(with, 0.85 * without);
  EXPECT_LT(with, 2 * report["expected_error"]["at_cameras_mm"].get<double>());
  // Most of the difference is the shutter's.
  EXPECT_LT(one.MedianOff(one.AlignWithPhotos()), 0.8 * with);
  EXPECT_TRUE(one.Report()["rolling_shutter"].is_object());
}

TEST(AlignCommand, LeavesPosesAsTheyAreWhereNotAllSpeaksForTheCorners) {
  const DriftingCase one(23, 15);
  const SparseModel without = one.Align(), with = one.AlignWithPhotos();
  const Json corners = one.Report()["plane_bundle"]["corners"];
  ASSERT_TRUE(corners.is_object());
  EXPECT_EQ(corners["used"], false);
  for (const auto& [id, image] : without.images) {
    EXPECT_EQ(image.cam_from_model.translation, with.images.at(id).cam_from_model.translation);
  }
}

}  // namespace
}  // namespace roomtex
