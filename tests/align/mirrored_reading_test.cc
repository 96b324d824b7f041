#include "align/mirrored_reading.h"

#include <random>

#include <gmock/gmock.h>

#include "core/ray_caster.h"
#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

using Kind = MirroredReading::Kind;

// Samples of the scan that a photo sees, those of one plane (one wall) or any.
std::vector<Pick> AnyPicks(const SimulatedCase& one, int photo, int count, unsigned seed,
                           bool one_wall) {
  const Scan& scan = one.scans[0];
  const SurveyedScans& surveyed = Survey(one.scans);
  const RayCaster caster(scan.points, surveyed.meshes()[0]);
  const CameraProjection projection(one.room->camera());
  const Rigid cam_from_scan = one.room->CamFromScan(photo);
  const Eigen::Vector3d centre = cam_from_scan.TargetOriginInSource();
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1.5);
  const ScanPlane* plane = nullptr;
  std::vector<Pick> picks;
  for (int trial = 0; trial < 400000 && static_cast<int>(picks.size()) < count; ++trial) {
    const int i = static_cast<int>(random() % scan.points.size());
    if (scan.IsMissing(i)) continue;
    const Eigen::Vector3d& x = scan.points[i];
    const auto at = projection.ImgFromCam(cam_from_scan * x);
    if (!at || !projection.InImage(*at)) continue;
    const double distance = (x - centre).norm();
    const auto hit = caster.Cast(centre, (x - centre) / distance);
    if (!hit || std::abs(hit->distance - distance) > 0.01) continue;
    if (one_wall && plane == nullptr) {
      for (const ScanPlane& any : surveyed.planes()) {
        if (std::abs(any.normal.dot(x - any.point)) < 0.01) plane = &any;
      }
    }
    if (one_wall && (plane == nullptr || std::abs(plane->normal.dot(x - plane->point)) > 0.01)) {
      continue;
    }
    const Eigen::Vector2d click = *at + Eigen::Vector2d(noise(random), noise(random));
    if (!projection.InImage(click)) continue;
    picks.push_back({one.room->PhotoName(photo), click, x, static_cast<long>(picks.size()) + 2});
  }
  return picks;
}

struct Found {
  AlignmentAttempt attempt;
  MirroredReading reading;
};
Found Find(const SimulatedCase& one) {
  Progress progress(true);
  const AlignmentOptions options;
  const AlignmentInput input{one.model, Survey(one.scans), one.picks, "picks.csv", one.azimuth};
  Found found;
  found.attempt = AttemptAlignment(input, options, &progress);
  found.reading = FindMirroredReading(input, found.attempt, options, &progress);
  return found;
}

SimulatedCase WithAnyPicks(int photo, unsigned seed, bool one_wall) {
  SimulatedCase one = MakeCase();
  one.picks = AnyPicks(one, photo, 6, seed, one_wall);
  return one;
}

// Six picks that lie on one wall fit a mirrored room as well as the room.
TEST(MirroredReading, IsFoundWithPicksOnOneWall) {
  SimulatedCase one = WithAnyPicks(6, 1, true);
  ASSERT_EQ(one.picks.size(), 6u);
  const Found right = Find(one);
  EXPECT_TRUE(right.attempt.trusted());
  EXPECT_EQ(right.reading.kind, Kind::kNone);
  // Picked on the room, and read mirrored.
  one.scans = MirrorScans(one.scans);
  Found found = Find(one);
  EXPECT_EQ(found.reading.kind, Kind::kScan) << found.attempt.refusal;
  EXPECT_TRUE(found.reading.attempt.trusted());
  // Picked on the mirror image.
  for (Pick& pick : one.picks) pick.x_in_scan.x() *= -1;
  found = Find(one);
  EXPECT_EQ(found.reading.kind, Kind::kScanAndPicks) << found.attempt.refusal;
}

TEST(MirroredReading, IsFoundWithAnySixPicks) {
  SimulatedCase one = WithAnyPicks(3, 2, false);
  ASSERT_EQ(one.picks.size(), 6u);
  EXPECT_EQ(Find(one).reading.kind, Kind::kNone);
  one.scans = MirrorScans(one.scans);
  EXPECT_EQ(Find(one).reading.kind, Kind::kScan);
  for (Pick& pick : one.picks) pick.x_in_scan.x() *= -1;
  EXPECT_TRUE(Find(one).attempt.says_mirrored);
}

// Six picks on the floor, which lie on it however the scan is read.
std::vector<Pick> FloorPicks(const SimulatedCase& one, int photo, unsigned seed) {
  std::vector<Pick> picks;
  for (const Pick& pick : AnyPicks(one, photo, 200, seed, false)) {
    const bool on_floor =
        std::abs((one.room->ScanFromRoom().Inverse() * pick.x_in_scan).z()) < 0.01;
    if (on_floor && picks.size() < 6) picks.push_back(pick);
  }
  return picks;
}

// Photos of people and things that were gone when the scan was made, and of the floor: read
// rightly, too many points are off the surface for their share to speak against the other reading.
// They float; of those of another room as many lie behind the surface.
TEST(MirroredReading, IsFoundByPointsThatLieAsInAnotherRoom) {
  SimulatedCase one = MakeCase();
  one.model = one.room->MakeSparseModel(8000, 0.7);
  one.picks = FloorPicks(one, 6, 1);
  ASSERT_EQ(one.picks.size(), 6u);
  const Similarity room_from_sparse{
      one.room->ScanFromSparse().scale,
      one.room->ScanFromRoom().rotation.conjugate() * one.room->ScanFromSparse().rotation,
      one.room->ScanFromRoom().Inverse() * one.room->ScanFromSparse().translation};
  for (auto point = one.model.points.begin(); point != one.model.points.end();) {
    Eigen::Vector3d& x = point->second.x_in_model;
    const std::vector<TrackElement>& track = point->second.track;
    const bool on_floor = std::abs((room_from_sparse * x).z()) < 0.02;
    if (!on_floor && point->first % 12 != 0) {
      for (const TrackElement& seen : track) {
        one.model.images.at(seen.image_id).point3d_ids[seen.point2d_index] = kInvalidPoint3dId;
      }
      point = one.model.points.erase(point);
      continue;
    }
    if (!on_floor && point->first % 24 == 0) {
      const Rigid& pose = one.model.images.at(track[0].image_id).cam_from_model;
      x += 0.3 / room_from_sparse.scale * (pose.TargetOriginInSource() - x).normalized();
    }
    ++point;
  }
  one.scans = MirrorScans(one.scans);
  const Found found = Find(one);
  ASSERT_TRUE(found.attempt.alignment) << found.attempt.refusal;
  ASSERT_TRUE(found.reading.attempt.alignment) << found.reading.attempt.refusal;
  const Placement &as_read = found.attempt.alignment->placement,
                  &mirrored = found.reading.attempt.alignment->placement;
  EXPECT_GT(1 - mirrored.SurfaceShare(), 0.5 * (1 - as_read.SurfaceShare()));
  EXPECT_EQ(found.reading.kind, Kind::kScan);
  EXPECT_TRUE(found.reading.attempt.trusted());
  EXPECT_THAT(found.reading.evidence, testing::HasSubstr("lie as in another room, as it is"));
}

TEST(MirroredReading, PicksOfAnotherPhotoAreNoMirroredScan) {
  SimulatedCase one = MakeCase();
  const std::string right = one.picks[0].image_name;
  for (Pick& pick : one.picks) {
    pick.image_name = right == "photo_001.jpg" ? "photo_002.jpg" : "photo_001.jpg";
  }
  const Found found = Find(one);
  EXPECT_FALSE(found.attempt.trusted());
  EXPECT_EQ(found.reading.kind, Kind::kNone);
}

TEST(MirroredReading, AMirroredScanIsReadTwiceAsItself) {
  const SimulatedCase& one = MakeCase();
  const std::vector<Scan> twice = MirrorScans(MirrorScans(one.scans));
  for (size_t i = 0; i < twice[0].points.size(); ++i) {
    if (one.scans[0].IsMissing(static_cast<int>(i))) continue;
    ASSERT_LT((twice[0].points[i] - one.scans[0].points[i]).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace roomtex
