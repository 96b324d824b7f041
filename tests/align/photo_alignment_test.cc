#include "align/photo_alignment.h"

#include <gmock/gmock.h>

#include "core/error.h"
#include "core/frames.h"
#include "tests/align/simulated_alignment.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

// Photos of the room, their camera told so far.
PhotoModel PhotosOf(const SimulatedRoom& room, const std::vector<int>& photos, FocalSource source) {
  PhotoModel model;
  for (const int photo : photos) {
    const auto id = static_cast<uint32_t>(photo + 1);
    Camera camera = room.camera();
    if (source != FocalSource::kGiven) {
      const double focal = 1.02 * room.camera().MeanFocalLength();
      camera = {id, CameraModel::kSimpleRadial, camera.width, camera.height, {}};
      camera.params = {focal, 0.5 * camera.width, 0.5 * camera.height, 0};
    }
    camera.camera_id = id;
    SparseImage image;
    image.image_id = image.camera_id = id;
    image.name = room.PhotoName(photo);
    model.model.cameras[id] = camera;
    model.model.images[id] = image;
    model.focal_sources[image.name] = source;
  }
  return model;
}

PhotoAlignment AlignThese(const SimulatedCase& one, const std::vector<int>& photos,
                          FocalSource source) {
  const PhotoModel model = PhotosOf(*one.room, photos, source);
  Progress progress(true);
  return AlignPhotos({model.model, Survey(one.scans), one.picks, "picks.csv", one.azimuth}, model,
                     FoundPhotos(), AlignmentOptions(), &progress);
}

double PositionError(const SimulatedRoom& room, const PhotoAlignment& found, int photo) {
  return (found.model.FindImage(room.PhotoName(photo))->cam_from_model.TargetOriginInSource() -
          room.CamFromScan(photo).TargetOriginInSource())
      .norm();
}

TEST(PhotoAlignment, PlacesPhotosByTheirOwnPicksAndSaysHowWell) {
  for (const FocalSource source : {FocalSource::kGiven, FocalSource::kExif, FocalSource::kPicks}) {
    SimulatedCase one = MakeCase();
    const std::vector<int> photos = {2, 7, 12};
    one.picks.clear();
    for (const int photo : photos) {
      const int count = source == FocalSource::kPicks ? 10 : 6;
      for (const Pick& pick : PicksOfPhoto(*one.room, photo, count)) one.picks.push_back(pick);
    }
    const PhotoAlignment found = AlignThese(one, photos, source);
    EXPECT_THAT(found.alignment.reasons, IsEmpty()) << FocalSourceName(source);
    ASSERT_EQ(found.model.images.size(), 3u);
    EXPECT_EQ(found.model.points.size(), one.picks.size());
    for (const int photo : photos) {
      const double error = PositionError(*one.room, found, photo);
      const double sigma =
          found.alignment.photo_sigmas.at(static_cast<uint32_t>(photo + 1)).position;
      EXPECT_LT(error, 3 * sigma) << FocalSourceName(source) << " " << photo;
      EXPECT_LT(sigma, 0.3);
      EXPECT_LT(error, source == FocalSource::kGiven ? 0.05 : 0.3) << photo;
    }
    EXPECT_GT(found.alignment.expected_error.at_cameras, 0.001);
    for (const auto& [id, point] : found.model.points) EXPECT_FALSE(point.track.empty());
  }
}

TEST(PhotoAlignment, APointPickedInTwoPhotosIsOnePoint) {
  SimulatedCase one = MakeCase();
  one.picks = PicksOfPhoto(*one.room, 3, 7);
  const CameraProjection projection(one.room->camera());
  std::vector<Pick> more;
  for (Pick pick : one.picks) {
    pick.image_name = one.room->PhotoName(4);
    const auto x = projection.ImgFromCam(one.room->CamFromScan(4) * pick.x_in_scan);
    if (!x || !projection.InImage(*x)) continue;
    pick.x_in_img = *x;
    more.push_back(pick);
  }
  ASSERT_GE(more.size(), 1u);
  while (more.size() < 6) {
    const auto extra = PicksOfPhoto(*one.room, 4, 6);
    more.push_back(extra[more.size() - 1]);
  }
  const size_t num_first = one.picks.size();
  one.picks.insert(one.picks.end(), more.begin(), more.end());
  const PhotoAlignment found = AlignThese(one, {3, 4}, FocalSource::kGiven);
  EXPECT_LT(found.model.points.size(), num_first + more.size());
}

TEST(PhotoAlignment, APhotoWithTooFewPicksIsLeftOutByName) {
  SimulatedCase one = MakeCase();
  one.picks = PicksOfPhoto(*one.room, 2, 6);
  for (const Pick& pick : PicksOfPhoto(*one.room, 7, 4)) one.picks.push_back(pick);
  const PhotoAlignment found = AlignThese(one, {2, 7}, FocalSource::kGiven);
  EXPECT_EQ(found.model.images.size(), 1u);
  EXPECT_THAT(found.alignment.reasons, IsEmpty());
  EXPECT_THAT(found.alignment.warnings,
              Contains(HasSubstr(one.room->PhotoName(7) + " is left out: it has 4 picks")));
  one.picks.erase(one.picks.begin(), one.picks.begin() + 3);
  EXPECT_INPUT_ERROR(AlignThese(one, {2, 7}, FocalSource::kGiven), "no photo has 6 picks");
}

TEST(PhotoAlignment, SixPicksDoNotTellAFocalLength) {
  SimulatedCase one = MakeCase();
  one.picks = PicksOfPhoto(*one.room, 2, 6);
  EXPECT_INPUT_ERROR(AlignThese(one, {2}, FocalSource::kPicks), "6 picks do not tell it");
}

TEST(PhotoAlignment, WrongPicksAreNotTrusted) {
  // Of another photo.
  SimulatedCase one = MakeCase();
  one.picks = PicksOfPhoto(*one.room, 2, 6);
  const auto others = PicksOfPhoto(*one.room, 9, 6);
  for (size_t i = 0; i < 6; ++i) one.picks[i].x_in_img = others[i].x_in_img;
  try {
    EXPECT_THAT(AlignThese(one, {2}, FocalSource::kGiven).alignment.reasons,
                testing::Not(IsEmpty()));
  } catch (const Contradiction&) {
  }
  // On the mirrored scan.
  one.picks = PicksOfPhoto(*one.room, 2, 6);
  for (Scan& scan : one.scans) {
    for (Eigen::Vector3d& point : scan.points) point.x() *= -1;
  }
  EXPECT_THROW(AlignThese(one, {2}, FocalSource::kGiven), Contradiction);
}

}  // namespace
}  // namespace roomtex
