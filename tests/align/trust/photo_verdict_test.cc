#include "align/trust/photo_verdict.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "core/random_stream.h"
#include "core/statistics.h"
#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

constexpr double kSigmaPx = 0.7;

SparseModel AlignedModel() {
  SparseModel model = MakeCase().model;
  TransformModel(MakeCase().room->ScanFromSparse(), &model);
  return model;
}

// The photo has keypoints as before, but those that `loses` have nothing to do with what is there.
void LosePoints(uint32_t image_id,
                const std::function<bool(const Eigen::Vector2d& x_in_img)>& loses,
                SparseModel* model) {
  SparseImage& image = model->images.at(image_id);
  for (auto& [id, point] : model->points) {
    std::vector<TrackElement> kept;
    for (const TrackElement& element : point.track) {
      if (element.image_id == image_id && loses(image.points2d[element.point2d_index])) {
        image.point3d_ids[element.point2d_index] = kInvalidPoint3dId;
      } else {
        kept.push_back(element);
      }
    }
    point.track = kept;
  }
}

std::map<uint32_t, PhotoVerdict> Judge(const SparseModel& aligned,
                                       const std::map<uint32_t, double>& support = {},
                                       const std::set<uint32_t>& picked = {}) {
  const SurveyedScans& surveyed = Survey(MakeCase().scans);
  const auto photos = JudgePhotos(aligned, surveyed.patches(), surveyed.free_space(), 0.05,
                                  kSigmaPx, support, picked);
  EXPECT_EQ(photos.size(), aligned.images.size());
  return photos;
}

TEST(PhotoVerdict, DoubtsNoRightPhoto) {
  for (const auto& [id, photo] : Judge(AlignedModel())) {
    EXPECT_EQ(photo.doubt, "") << id;
    EXPECT_GT(photo.num_points, 100u) << id;
    EXPECT_GT(photo.num_expected, 60) << id;
    // 15 % of all sightings are left out by the simulator.
    EXPECT_GT(photo.sight_share, 0.7) << id;
    EXPECT_GT(photo.surface_share, 0.9) << id;
    EXPECT_TRUE(std::isnan(photo.match_support)) << id;
  }
}

// Its walls are those of this room, what hangs there is not: all that it has lies right.
TEST(PhotoVerdict, DoubtsAPhotoThatShowsAnotherRoomInMostOfItsPicture) {
  SparseModel model = AlignedModel();
  const double width = model.cameras.begin()->second.width;
  LosePoints(
      4, [&](const Eigen::Vector2d& x) { return x.x() > 0.3 * width; }, &model);
  for (const auto& [id, photo] : Judge(model)) {
    EXPECT_EQ(photo.doubt.empty(), id != 4) << id << ": " << photo.doubt;
  }
  const PhotoVerdict photo = Judge(model).at(4);
  EXPECT_GT(photo.surface_share, 0.9);
  EXPECT_NE(photo.doubt.find("ought to show"), std::string::npos) << photo.doubt;
}

// More than half of what is usual, and all of it in one part of the picture.
TEST(PhotoVerdict, DoubtsAPhotoThatShowsAnotherRoomInHalfOfItsPicture) {
  SparseModel model = AlignedModel();
  const double width = model.cameras.begin()->second.width;
  LosePoints(
      4, [&](const Eigen::Vector2d& x) { return x.x() > 0.57 * width; }, &model);
  const std::map<uint32_t, PhotoVerdict> photos = Judge(model);
  std::vector<double> shares;
  for (const auto& [id, photo] : photos) {
    EXPECT_EQ(photo.doubt.empty(), id != 4) << id << ": " << photo.doubt;
    shares.push_back(photo.sight_share);
  }
  const double usual = Median(&shares);
  EXPECT_GT(photos.at(4).sight_share, 0.5 * usual);
  EXPECT_LT(photos.at(4).sight_share, 0.6 * usual);
}

// Their sightings of what is not alike become points of their own at the same places.
void MoveToAnotherRoom(const std::set<uint32_t>& strangers,
                       const std::function<bool(uint64_t id, const SparsePoint& point)>& is_alike,
                       SparseModel* model) {
  const auto is_stranger = [&](const TrackElement& element) {
    return strangers.count(element.image_id) > 0;
  };
  uint64_t next_id = model->points.rbegin()->first + 1;
  std::map<uint64_t, SparsePoint> theirs;
  for (auto& [id, point] : model->points) {
    if (is_alike(id, point)) continue;
    SparsePoint other = point;
    std::vector<TrackElement>& track = point.track;
    const auto first = std::stable_partition(track.begin(), track.end(), std::not_fn(is_stranger));
    other.track.assign(first, track.end());
    track.erase(first, track.end());
    for (const TrackElement& element : other.track) {
      model->images.at(element.image_id).point3d_ids[element.point2d_index] = next_id;
    }
    theirs[next_id++] = other;
  }
  model->points.insert(theirs.begin(), theirs.end());
}

// On the way out through a door, say: what they show of the other room each of them has, and nobody
// else here; of this room they have little. Then the right ones that look the same way lack what
// these found, and are not to be taken for strangers either.
TEST(PhotoVerdict, DoubtsPhotosOfAnotherRoomThatCameTogether) {
  SparseModel model = AlignedModel();
  const std::set<uint32_t> strangers = {3, 4, 5, 6};
  MoveToAnotherRoom(
      strangers, [](uint64_t id, const SparsePoint&) { return id % 8 == 0; }, &model);
  for (const auto& [id, photo] : Judge(model)) {
    EXPECT_EQ(photo.doubt.empty(), strangers.count(id) == 0)
        << id << ": " << photo.sight_share << " of " << photo.num_expected << " "
        << photo.unevenness;
  }
}

// Half of what there is is the same in both rooms: the larger one is doubted where a photo of the
// other is known to show what was scanned.
TEST(PhotoVerdict, DoubtsARoomThatIsAlike) {
  SparseModel model = AlignedModel();
  std::vector<double> heights;
  for (const auto& [id, point] : model.points) heights.push_back(point.x_in_model.y());
  const double middle = Median(heights);
  std::set<uint32_t> strangers;
  for (const auto& [id, image] : model.images) {
    if (id % 3 == 0) strangers.insert(id);
  }
  MoveToAnotherRoom(
      strangers, [&](uint64_t, const SparsePoint& point) { return point.x_in_model.y() > middle; },
      &model);
  for (const bool picked : {false, true}) {
    for (const auto& [id, photo] :
         Judge(model, {}, picked ? std::set<uint32_t>{3} : std::set<uint32_t>{})) {
      EXPECT_EQ(photo.doubt.empty(), (strangers.count(id) > 0) == picked)
          << id << ": " << photo.sight_share << " of " << photo.num_expected << " "
          << photo.unevenness;
      EXPECT_EQ(photo.other_room >= 0, !photo.doubt.empty());
      if (!photo.doubt.empty()) {
        EXPECT_NE(photo.doubt.find("another room that is alike"), std::string::npos) << photo.doubt;
      }
    }
  }
}

// Two sides of one room of which nothing was matched look like two rooms. Photos of either are
// believed by what they show together, those of a third room are not.
TEST(PhotoVerdict, BelievesAGroupByWhatItsPhotosShowTogether) {
  const auto detail = [](int num_windows, int num_alike) {
    DetailAgreement one;
    one.num_windows = num_windows;
    one.num_alike = num_alike;
    return one;
  };
  std::map<uint32_t, PhotoVerdict> photos;
  for (const uint32_t id : {1, 2, 3, 4, 5, 6, 7, 8}) photos[id].doubt = id > 1 ? "doubt" : "";
  for (const uint32_t id : {2, 3, 4}) photos[id].other_room = 1;
  for (const uint32_t id : {5, 6}) photos[id].other_room = 2;
  for (const uint32_t id : {7, 8}) photos[id].lacks_sights = true;
  // Blurred (3), and with no windows at all (4).
  BelieveWhatShowsTheSame({{2, detail(2000, 1940)},
                           {3, detail(300, 245)},
                           {5, detail(2000, 1500)},
                           {6, detail(400, 395)},
                           {7, detail(800, 780)},
                           {8, detail(800, 640)}},
                          &photos);
  std::set<uint32_t> doubtful;
  for (const auto& [id, photo] : photos) {
    if (!photo.doubt.empty()) doubtful.insert(id);
  }
  EXPECT_EQ(doubtful, (std::set<uint32_t>{5, 6, 8}));
  EXPECT_EQ(photos.at(5).detail.num_alike, 1500);
}

TEST(PhotoVerdict, DoesNotDoubtABlurredPhotoThatFindsLittleAnywhere) {
  SparseModel model = AlignedModel();
  RandomStream random(1);
  LosePoints(
      4, [&](const Eigen::Vector2d&) { return random.Uniform() < 0.6; }, &model);
  const PhotoVerdict photo = Judge(model).at(4);
  EXPECT_LT(photo.sight_share, 0.5);
  EXPECT_EQ(photo.doubt, "");
}

// It finds little where it has no keypoints: too dark there.
TEST(PhotoVerdict, DoesNotAskForPointsWhereThePhotoHasNoKeypoints) {
  SparseModel model = AlignedModel();
  const double width = model.cameras.begin()->second.width;
  LosePoints(
      4, [&](const Eigen::Vector2d& x) { return x.x() > 0.3 * width; }, &model);
  for (Eigen::Vector2d& x : model.images.at(4).points2d) {
    if (x.x() > 0.3 * width) x = {-100, -100};
  }
  EXPECT_EQ(Judge(model).at(4).doubt, "");
}

// Points that rest on it and one more photo lie halfway to what they show.
TEST(PhotoVerdict, CountsPointsOfAPhotoThatFloat) {
  SparseModel model = AlignedModel();
  const Eigen::Vector3d centre = model.images.at(4).cam_from_model.TargetOriginInSource();
  for (auto& [id, point] : model.points) {
    const auto is_of_it = [](const TrackElement& element) { return element.image_id == 4; };
    const auto own = std::find_if(point.track.begin(), point.track.end(), is_of_it);
    if (own == point.track.end() || id % 4 == 0) continue;
    std::vector<TrackElement> kept = {*own};
    for (const TrackElement& element : point.track) {
      if (element.image_id == 4) continue;
      if (kept.size() < 2) {
        kept.push_back(element);
      } else {
        model.images.at(element.image_id).point3d_ids[element.point2d_index] = kInvalidPoint3dId;
      }
    }
    point.track = kept;
    point.x_in_model = 0.5 * (point.x_in_model + centre);
  }
  const PhotoVerdict photo = Judge(model).at(4);
  EXPECT_LT(photo.surface_share, 0.4);
}

TEST(PhotoVerdict, DoubtsAPhotoThatItsOwnMatchesContradict) {
  std::map<uint32_t, double> support;
  for (const auto& [id, image] : MakeCase().model.images) support[id] = 0.97;
  support[7] = 0.59;
  for (const auto& [id, photo] : Judge(AlignedModel(), support)) {
    EXPECT_EQ(photo.match_support, support.at(id));
    EXPECT_EQ(photo.doubt.empty(), id != 7) << id;
  }
  EXPECT_NE(Judge(AlignedModel(), support).at(7).doubt.find("59 %"), std::string::npos);
}

}  // namespace
}  // namespace roomtex
