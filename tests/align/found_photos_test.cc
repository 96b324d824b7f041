// Photos without a sparse model and without picks.
#include "align/found_photos.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "align/mirrored_reading.h"
#include "align/photo_alignment.h"
#include "core/frames.h"
#include "core/text.h"
#include "tests/align/simulated_alignment.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

constexpr int kNumPhotos = 3;

// A room, its scan by a laser, whose intensity is not the brightness, and photos.
struct PhotosOfARoom {
  explicit PhotosOfARoom(int seed, double roll_deg = 0)
      : room(Options(seed, roll_deg)), scans{room.MakeScan(0)} {
    std::vector<std::string> names;
    for (int photo = 0; photo < room.NumPhotos(); ++photo) {
      names.push_back(room.PhotoName(photo));
      cv::imwrite(folder / names.back(), room.RenderPhoto(photo));
    }
    PhotoCameraOptions camera;
    camera.camera_model = CameraModelName(room.camera().model);
    for (const double param : room.camera().params) {
      camera.camera_params += (camera.camera_params.empty() ? "" : ",") + Exact(param);
    }
    photos = MakePhotoModel(folder.path(), names, camera);
  }
  static SimulatedRoomOptions Options(int seed, double roll_deg = 0) {
    SimulatedRoomOptions options = CaseOptions(seed);
    if (roll_deg > 0) options.roll_deg = roll_deg;
    options.num_photos = kNumPhotos;
    options.photo_width = 640;
    options.photo_height = 480;
    options.scan_columns = 1200;
    options.scan_rows = 500;
    return options;
  }
  FoundPhotos FindIn(const std::vector<Scan>& of, int num_threads = 2) const {
    return FindIn(of, photos, num_threads);
  }
  FoundPhotos FindIn(const std::vector<Scan>& of, const PhotoModel& some, int num_threads,
                     const PhotoHints& hints = {}) const {
    Progress quiet(true);
    return FindPhotos(some, SurveyedScans(of), folder.path(), hints, {}, {}, num_threads, &quiet);
  }

  TempFolder folder;
  SimulatedRoom room;
  std::vector<Scan> scans;
  PhotoModel photos;
};

TEST(FoundPhotos, StandWhereTheyWereTakenWithinTwiceTheExpectedError) {
  const PhotosOfARoom one(3);
  const FoundPhotos found = one.FindIn(one.scans);
  ASSERT_EQ(found.photos.size(), static_cast<size_t>(kNumPhotos));
  EXPECT_EQ(found.views.size(), 3u);
  const SurveyedScans surveyed(one.scans);
  const AlignmentInput input{one.photos.model, surveyed, found.picks, "", ""};
  const PhotoAlignment placed = AlignFoundPhotos(input, one.photos, found, {});
  EXPECT_TRUE(placed.alignment.reasons.empty());
  EXPECT_EQ(placed.alignment.warnings.size(), kNumPhotos - found.views.size());
  ASSERT_EQ(placed.model.images.size(), found.views.size());
  for (int photo = 0; photo < one.room.NumPhotos(); ++photo) {
    const SparseImage* image = placed.model.FindImage(one.room.PhotoName(photo));
    if (image == nullptr) continue;
    SCOPED_TRACE(image->name);
    const double off = (image->cam_from_model.TargetOriginInSource() -
                        one.room.CamFromScan(photo).TargetOriginInSource())
                           .norm();
    const double said = placed.alignment.photo_sigmas.at(image->image_id).position;
    EXPECT_LT(off, 2 * said);
    EXPECT_LT(off, 0.06);
    EXPECT_LT(said, 0.1);
  }
  PhotoModel first = one.photos;
  while (first.model.images.size() > 1) first.model.images.erase(--first.model.images.end());
  const FoundPhotos again = one.FindIn(one.scans, first, 1);
  ASSERT_EQ(again.picks.size(), found.views[0].picks.size());
  for (size_t i = 0; i < again.picks.size(); ++i) {
    EXPECT_EQ(again.picks[i].x_in_img, found.picks[i].x_in_img);
  }
}

// Nothing says which way is down in them: features are turned as their own gradients say.
TEST(FoundPhotos, AreFoundHeldSidewaysOrUpsideDown) {
  const PhotosOfARoom one(3, 180);
  const FoundPhotos found = one.FindIn(one.scans);
  ASSERT_EQ(found.views.size(), static_cast<size_t>(kNumPhotos));
  const SurveyedScans surveyed(one.scans);
  const AlignmentInput input{one.photos.model, surveyed, found.picks, "", ""};
  const PhotoAlignment placed = AlignFoundPhotos(input, one.photos, found, {});
  double most_turned = 0;
  for (int photo = 0; photo < one.room.NumPhotos(); ++photo) {
    const SparseImage* image = placed.model.FindImage(one.room.PhotoName(photo));
    ASSERT_NE(image, nullptr);
    const Rigid truth = one.room.CamFromScan(photo);
    EXPECT_LT((image->cam_from_model.TargetOriginInSource() - truth.TargetOriginInSource()).norm(),
              0.06);
    const Eigen::Vector3d down = truth.rotation * -Eigen::Vector3d::UnitZ();
    most_turned = std::max(most_turned, DegFromRad(std::atan2(std::abs(down.x()), down.y())));
  }
  EXPECT_GT(most_turned, 60);
}

TEST(FoundPhotos, AreNotPlacedInARoomWithSomeOfTheSameFurnitureNorInTheMirrorImageOfTheirs) {
  const PhotosOfARoom one(3);
  SimulatedRoomOptions other = PhotosOfARoom::Options(3);
  other.random_seed += 100;
  for (const std::vector<Scan>& scans :
       {std::vector<Scan>{SimulatedRoom(other).MakeScan(0)}, MirrorScans(one.scans)}) {
    const FoundPhotos found = one.FindIn(scans);
    EXPECT_TRUE(found.views.empty());
    for (const PhotoEvidence& photo : found.photos) EXPECT_NE(photo.problem, "");
  }
}

}  // namespace
}  // namespace roomtex
