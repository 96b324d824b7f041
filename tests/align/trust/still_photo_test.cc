#include "align/trust/still_photo.h"

#include <utility>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "align/trust/free_space.h"
#include "align/trust/perspective_views.h"
#include "capture/simulation/simulated_room.h"
#include "core/twist.h"

namespace roomtex {
namespace {

SimulatedRoomOptions Held(double rolling_shutter_ms, bool upright) {
  SimulatedRoomOptions options;
  options.num_photos = 3;
  options.photo_width = 640;
  options.photo_height = 480;
  if (upright) std::swap(options.photo_width, options.photo_height);
  options.photo_noise = 0;
  options.scan_columns = 800;
  options.scan_rows = 340;
  options.rolling_shutter_ms = rolling_shutter_ms;
  options.hand_turn_deg = 60;
  options.hand_move = 0.5;
  return options;
}

// Mean difference of two photos, bytes, a margin left out.
double Difference(const cv::Mat& a, const cv::Mat& b) {
  const cv::Rect inner(30, 30, a.cols - 60, a.rows - 60);
  cv::Mat difference;
  cv::absdiff(a(inner), b(inner), difference);
  const cv::Scalar mean = cv::mean(difference);
  return (mean[0] + mean[1] + mean[2]) / 3;
}

class StillPhotoTest : public testing::TestWithParam<bool> {};

// Photos of a moving hand become those that a hand holding still takes of the same room.
TEST_P(StillPhotoTest, ShowsWhatACameraThatStandsStillShows) {
  const SimulatedRoom moving(Held(30, GetParam())), still(Held(0, GetParam()));
  const std::vector<Scan> scans = {still.MakeScan(0)};
  const FreeSpace free_space(scans, 100000);
  const ScanViewer viewer(scans, free_space);
  const LookSetup camera(still.camera(), viewer, 4);
  for (int photo = 0; photo < still.NumPhotos(); ++photo) {
    const Rigid last_from_first =
        moving.CamFromRoomAt(photo, 0.5) * moving.CamFromRoomAt(photo, -0.5).Inverse();
    const RowMotion motion{VectorFromRotation(last_from_first.rotation),
                           last_from_first.translation};
    const cv::Mat rolled = moving.RenderPhoto(photo), truth = still.RenderPhoto(photo);
    const ScanView view = camera.Look(viewer, still.CamFromScan(photo));
    const double before = Difference(rolled, truth);
    const double after = Difference(WithStillRows(rolled, view, camera, motion), truth);
    EXPECT_GT(before, 5) << photo;
    EXPECT_LT(after, 0.4 * before) << photo;
  }
}

INSTANTIATE_TEST_SUITE_P(LyingAndUpright, StillPhotoTest, testing::Bool());

// Smaller pictures, too; photos that are not named stay as they are.
TEST(StillPhoto, SmallerPicturesAreMovedByAsMuchOfThem) {
  const SimulatedRoom room(Held(0, false));
  const std::vector<Scan> scans = {room.MakeScan(0)};
  const FreeSpace free_space(scans, 100000);
  const ScanViewer viewer(scans, free_space);
  const LookSetup camera(room.camera(), viewer, 4);
  const ScanView view = camera.Look(viewer, room.CamFromScan(0));
  RowMotion motion;
  motion.turn = {0.03, 0.03, 0};
  const cv::Mat photo = room.RenderPhoto(0);
  cv::Mat small, expected;
  cv::resize(photo, small, {}, 0.5, 0.5, cv::INTER_AREA);
  cv::resize(WithStillRows(photo, view, camera, motion), expected, {}, 0.5, 0.5, cv::INTER_AREA);
  const cv::Mat moved = WithStillRows(small, view, camera, motion);
  EXPECT_LT(Difference(moved, expected), 0.3 * Difference(small, expected));

  SparseModel model;
  model.cameras[room.camera().camera_id] = room.camera();
  SparseImage image;
  image.image_id = 7;
  image.camera_id = room.camera().camera_id;
  AlignedPhotos photos{model, ""};
  photos.row_motions[8] = motion;
  EXPECT_EQ(PerspectiveViews(photos).Still(image, view, camera, small).data, small.data);
  photos.row_motions[7] = motion;
  EXPECT_EQ(Difference(PerspectiveViews(photos).Still(image, view, camera, small), moved), 0);
}

}  // namespace
}  // namespace roomtex
