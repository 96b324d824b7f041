#include "colmap_ext/lookalike_rooms.h"

#include <cmath>
#include <functional>
#include <memory>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "core/random_stream.h"
#include "tests/colmap_ext/simulated_views.h"

namespace roomtex {
namespace {

using Rooms = std::vector<std::set<uint32_t>>;

SimulatedViewsOptions ManyViews() {
  SimulatedViewsOptions options;
  options.num_views = 12;
  options.num_points = 1500;
  options.baseline = 0.1;
  return options;
}

using IsCommon = std::function<bool(const Eigen::Vector3d& x)>;

bool InOneHalf(const Eigen::Vector3d& x) { return x.x() > 0; }

// As COLMAP would have it: a point for each thing, of the rooms that are alike only where they are.
// Sightings that `misses` says are not found; the keypoints are there.
SparseModel ModelOf(const SimulatedViews& views,
                    const std::function<int(uint32_t image_id)>& room_of,
                    const std::function<bool(uint32_t image_id, const Eigen::Vector3d& x)>& misses,
                    const IsCommon& is_common = InOneHalf) {
  SparseModel model;
  model.cameras = views.cameras;
  for (const auto& [id, image] : views.images) {
    SparseImage& photo = model.images[id];
    photo.image_id = id;
    photo.camera_id = image.camera_id;
    photo.name = image.name;
    photo.cam_from_model = views.cam_from_scene.at(id);
    photo.points2d = views.keypoints.at(id);
    photo.point3d_ids.assign(photo.points2d.size(), kInvalidPoint3dId);
    for (size_t i = 0; i < photo.points2d.size(); ++i) {
      const auto index = static_cast<size_t>(views.point_of_keypoint.at(id)[i]);
      const Eigen::Vector3d& x = views.points_in_scene[index];
      if (misses(id, x)) continue;
      const uint64_t point_id =
          10 * index + (is_common(x) ? 0 : static_cast<uint64_t>(room_of(id)));
      photo.point3d_ids[i] = point_id;
      SparsePoint& point = model.points[point_id];
      point.x_in_model = x;
      point.track.push_back({id, static_cast<uint32_t>(i)});
    }
  }
  return model;
}

Rooms RoomsOf(const SparseModel& model) {
  return FindLookalikeRooms(model, FindExpectedSightings(model, HiddenByOwnPoints(model), {}))
      .rooms;
}

// Nothing tells where a sighting is missed.
std::function<bool(uint32_t, const Eigen::Vector3d&)> MissesShare(
    const std::function<double(uint32_t)>& share) {
  return [share, random = std::make_shared<RandomStream>(5)](uint32_t id, const Eigen::Vector3d&) {
    return random->Uniform() < share(id);
  };
}

TEST(LookalikeRooms, AreTakenApart) {
  const SimulatedViews views = SimulateViews(ManyViews());
  const auto room_of = [](uint32_t id) { return id % 3 == 0 ? 2 : 1; };
  const SparseModel model = ModelOf(views, room_of, MissesShare([](uint32_t) { return 0.3; }));
  const LookalikeRooms found =
      FindLookalikeRooms(model, FindExpectedSightings(model, HiddenByOwnPoints(model), {}));
  EXPECT_EQ(found.rooms, Rooms({{1, 2, 4, 5, 7, 8, 10, 11}, {3, 6, 9, 12}}));
  // What is missed at random is missed in both; of two rooms about half is not there.
  EXPECT_NEAR(found.share_within, 0.7, 0.07);
  EXPECT_NEAR(found.share_between, 0.35, 0.12);
}

TEST(LookalikeRooms, AreTakenApartWhereThereAreThree) {
  const SimulatedViews views = SimulateViews(ManyViews());
  const auto room_of = [](uint32_t id) { return 1 + static_cast<int>(id % 3); };
  const SparseModel model = ModelOf(views, room_of, MissesShare([](uint32_t) { return 0.3; }));
  const Rooms rooms = RoomsOf(model);
  EXPECT_EQ(std::set<std::set<uint32_t>>(rooms.begin(), rooms.end()),
            std::set<std::set<uint32_t>>({{1, 4, 7, 10}, {2, 5, 8, 11}, {3, 6, 9, 12}}));
}

// Here and there a thing, as evenly as those of one's own room: few as they are, they tell.
TEST(LookalikeRooms, AreTakenApartWhereLittleIsAlike) {
  const SimulatedViews views = SimulateViews(ManyViews());
  const auto room_of = [](uint32_t id) { return id % 3 == 0 ? 2 : 1; };
  const IsCommon scattered = [](const Eigen::Vector3d& x) {
    return std::fmod(std::abs(100 * x.x()), 1) < 0.15;
  };
  const SparseModel model =
      ModelOf(views, room_of, MissesShare([](uint32_t) { return 0.3; }), scattered);
  EXPECT_EQ(RoomsOf(model), Rooms({{1, 2, 4, 5, 7, 8, 10, 11}, {3, 6, 9, 12}}));
}

// Strangers in twos and threes are no room: roomtex-align asks each of them.
TEST(LookalikeRooms, HaveFourPhotos) {
  const SimulatedViews views = SimulateViews(ManyViews());
  const auto room_of = [](uint32_t id) { return id > 9 ? 2 : 1; };
  const SparseModel model = ModelOf(views, room_of, MissesShare([](uint32_t) { return 0.3; }));
  EXPECT_EQ(RoomsOf(model).size(), 1u);
}

TEST(LookalikeRooms, OneRoomIsOne) {
  for (int seed = 0; seed < 10; ++seed) {
    SimulatedViewsOptions options = ManyViews();
    options.random_seed = seed;
    const SparseModel model = ModelOf(
        SimulateViews(options), [](uint32_t) { return 1; },
        MissesShare([](uint32_t) { return 0.3; }));
    EXPECT_EQ(RoomsOf(model).size(), 1u) << seed;
  }
}

// They find little of anything, and not of some things only.
TEST(LookalikeRooms, BlurredPhotosAreNone) {
  const SparseModel model = ModelOf(
      SimulateViews(ManyViews()), [](uint32_t) { return 1; },
      MissesShare([](uint32_t id) { return id > 7 ? 0.7 : 0.2; }));
  EXPECT_EQ(RoomsOf(model).size(), 1u);
}

// From before a wall and from behind it photos look the same way: what lies behind, those before it
// need not show.
TEST(LookalikeRooms, RoomsBehindAWallAreNone) {
  SimulatedViewsOptions options = ManyViews();
  options.num_points = 3000;
  SimulatedViews views = SimulateViews(options);
  const auto is_before = [](uint32_t id) { return id % 2 == 0; };
  const double wall = -1.5;  // z; the cameras stand about -3, the points lie beyond -1.3
  views.keypoints.clear();
  views.point_of_keypoint.clear();
  for (size_t i = 0; i < views.points_in_scene.size(); i += 2) views.points_in_scene[i].z() = wall;
  RandomStream random(2);
  for (auto& [id, pose] : views.cam_from_scene) {
    if (!is_before(id)) pose.translation += pose.rotation * Eigen::Vector3d(0, 0, -1.6);
    const CameraProjection projection(views.cameras.at(1));
    for (size_t i = 0; i < views.points_in_scene.size(); ++i) {
      const Eigen::Vector3d& x = views.points_in_scene[i];
      const auto x_in_img = projection.ImgFromCam(pose * x);
      if (!x_in_img || !projection.InImage(*x_in_img)) continue;
      if (is_before(id) != (i % 2 == 0) || random.Uniform() < 0.3) continue;
      views.keypoints[id].push_back(*x_in_img);
      views.point_of_keypoint[id].push_back(static_cast<int>(i));
    }
  }
  const SparseModel model = ModelOf(
      views, [](uint32_t) { return 1; }, [](uint32_t, const Eigen::Vector3d&) { return false; });
  const HidesPoint nothing = [](const SparseImage&, const Eigen::Vector2d&,
                                const Eigen::Vector3d&) { return false; };
  const auto count_misses = [&](const HidesPoint& hides) {
    size_t count = 0;
    for (const auto& [id, sightings] : FindExpectedSightings(model, hides, {})) {
      for (const ExpectedSighting& one : sightings) {
        // Beyond the wall, of those before it.
        count += is_before(id) && !one.is_found && !is_before(one.witnesses[0]);
      }
    }
    return count;
  };
  EXPECT_GT(count_misses(nothing), 100u);
  EXPECT_LT(count_misses(HiddenByOwnPoints(model)), count_misses(nothing) / 20);
  EXPECT_EQ(RoomsOf(model).size(), 1u);
}

}  // namespace
}  // namespace roomtex
