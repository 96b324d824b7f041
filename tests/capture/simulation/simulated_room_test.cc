// Scans, picks and the sparse model of the simulated room against its truth.

#include "capture/simulation/simulated_room.h"

#include <cmath>
#include <set>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "core/camera_model.h"
#include "core/error.h"
#include "core/frames.h"
#include "tests/capture/simulation/small_room.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

bool SamePoints(const Scan& a, const Scan& b) {
  if (a.points.size() != b.points.size() || a.intensity != b.intensity) return false;
  for (size_t i = 0; i < a.points.size(); ++i) {
    if (a.IsMissing(static_cast<int>(i)) != b.IsMissing(static_cast<int>(i))) return false;
    if (!a.IsMissing(static_cast<int>(i)) && a.points[i] != b.points[i]) return false;
  }
  return true;
}

TEST(SimulatedRoom, IsTheSameForTheSameSeedAndAnyNumberOfThreads) {
  SimulatedRoomOptions options = SmallRoom();
  options.shading = true;
  options.num_threads = 1;
  const SimulatedRoom one(options);
  options.num_threads = 3;
  const SimulatedRoom three(options);
  EXPECT_EQ(cv::norm(one.RenderPhoto(2), three.RenderPhoto(2), cv::NORM_INF), 0);
  EXPECT_TRUE(SamePoints(one.MakeScan(), three.MakeScan()));
  EXPECT_EQ(one.TrueColors(), three.TrueColors());
  const auto picks_one = one.MakePicks(1, 6), picks_three = three.MakePicks(1, 6);
  ASSERT_EQ(picks_one.size(), picks_three.size());
  for (size_t i = 0; i < picks_one.size(); ++i) {
    EXPECT_EQ(picks_one[i].x_in_img, picks_three[i].x_in_img);
    EXPECT_EQ(picks_one[i].x_in_scan, picks_three[i].x_in_scan);
  }
  const SparseModel model_one = one.MakeSparseModel(200, 0.5);
  const SparseModel model_three = three.MakeSparseModel(200, 0.5);
  ASSERT_EQ(model_one.points.size(), model_three.points.size());
  for (const auto& [id, point] : model_one.points) {
    EXPECT_EQ(point.x_in_model, model_three.points.at(id).x_in_model);
  }
}

TEST(SimulatedRoom, DiffersForAnotherSeed) {
  SimulatedRoomOptions options = SmallRoom();
  const SimulatedRoom first(options);
  options.random_seed = 4;
  const SimulatedRoom second(options);
  EXPECT_GT(cv::norm(first.RenderPhoto(0), second.RenderPhoto(0), cv::NORM_L1), 1e6);
  EXPECT_GT((first.CamFromScan(0).translation - second.CamFromScan(0).translation).norm(), 0.01);
}

TEST(SimulatedRoom, NamesEveryBadOption) {
  SimulatedRoomOptions options;
  EXPECT_TRUE(options.Problems().empty());
  options.width = 2;
  options.num_photos = 0;
  options.camera_model = "OPENCY";
  options.range_noise = std::nan("");
  options.num_stations = 99;
  EXPECT_EQ(options.Problems().size(), 5u);
  EXPECT_THROW(SimulatedRoom{options}, UsageError);
  SimulatedRoomOptions held;
  held.rolling_shutter_ms = 30;
  EXPECT_TRUE(held.Problems().empty());
  held.photo_height = held.photo_width + 1;
  EXPECT_TRUE(held.Problems().empty());
  held.projectors = 1;
  EXPECT_THAT(held.Problems(), testing::Contains(testing::HasSubstr("stands still")));
}

TEST(SimulatedRoom, StandsUprightInItsScanFrame) {
  const SimulatedRoom room(SmallRoom());
  const Rigid scan_from_room = room.ScanFromRoom();
  // The room's up is the scan's y; the scanner is the origin, 1.5 m above the floor.
  EXPECT_THAT(scan_from_room.rotation * Eigen::Vector3d::UnitZ(),
              IsNearMatrix(Eigen::Vector3d::UnitY(), 1e-12));
  EXPECT_NEAR(scan_from_room.translation.y(), -1.5, 1e-9);
  const Scan scan = room.MakeScan();
  EXPECT_THAT(scan.scan_from_station, IsNearRigid(Rigid(), 1e-12, 1e-12));
  const Bounds bounds = FindBounds(scan);
  EXPECT_NEAR(bounds.min.y(), -1.5, 0.02);
  EXPECT_NEAR(bounds.max.y(), 2.7 - 1.5, 0.02);
  // No axis of the scan is parallel to a wall.
  const Eigen::Vector3d along = scan_from_room.rotation * Eigen::Vector3d::UnitX();
  EXPECT_GT(std::min(std::abs(along.x()), std::abs(along.z())), 0.2);
}

TEST(SimulatedRoom, CamerasStandInTheOpen) {
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 30;
  const SimulatedRoom room(options);
  const Scan scan = room.MakeScan();
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const Eigen::Vector3d in_room = room.CamFromRoom(photo).TargetOriginInSource();
    EXPECT_GT(in_room.x(), 0.4);
    EXPECT_LT(in_room.x(), options.width - 0.4);
    EXPECT_GT(in_room.y(), 0.4);
    EXPECT_LT(in_room.y(), options.depth - 0.4);
    EXPECT_GT(in_room.z(), 1.15);
    EXPECT_LT(in_room.z(), 1.85);
    const Eigen::Vector3d in_scan = room.CamFromScan(photo).TargetOriginInSource();
    EXPECT_THAT(in_scan, IsNearMatrix(room.ScanFromRoom() * in_room, 1e-9));
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (!scan.IsMissing(static_cast<int>(i))) {
        ASSERT_GT((scan.points[i] - in_scan).norm(), 0.35) << "photo " << photo;
      }
    }
  }
}

TEST(SimulatedScan, HasThetaGrowingWithTheColumnAndPhiFallingWithTheRow) {
  const SimulatedRoom room(SmallRoom());
  const Scan scan = room.MakeScan();
  ASSERT_EQ(scan.points.size(), 480u * 240u);
  for (int row = 0; row < scan.num_rows; row += 7) {
    for (int column = 0; column < scan.num_columns; column += 11) {
      const int i = scan.Index(column, row);
      if (scan.IsMissing(i)) continue;
      const Eigen::Vector3d d = scan.points[i].normalized();
      // Thesis 5.1.1, clockwise: x = sin(theta) cos(phi) r, z = -cos(theta) cos(phi) r.
      EXPECT_NEAR(std::atan2(d.x(), -d.z()), -kPi + 2 * kPi * (column + 0.5) / 480, 1e-9);
      EXPECT_NEAR(DegFromRad(std::asin(d.y())), 75 - 135 * (row + 0.5) / 240, 1e-7);
    }
  }
}

TEST(SimulatedScan, HasTheRangeNoiseOfTheOptions) {
  SimulatedRoomOptions options = SmallRoom();
  options.range_noise = 0;
  const Scan clean = SimulatedRoom(options).MakeScan();
  for (const double growth : {0.0, 0.5}) {
    options.range_noise = 0.004;
    options.range_noise_growth = growth;
    const Scan noisy = SimulatedRoom(options).MakeScan();
    double sum = 0, squares = 0, count = 0;
    for (size_t i = 0; i < clean.points.size(); ++i) {
      ASSERT_EQ(clean.IsMissing(static_cast<int>(i)), noisy.IsMissing(static_cast<int>(i)));
      if (clean.IsMissing(static_cast<int>(i))) continue;
      const double range = clean.points[i].norm();
      const double expected = 0.004 * (1 + growth * range);
      // Along the ray only.
      ASSERT_LT(clean.points[i].normalized().cross(noisy.points[i]).norm(), 1e-9);
      const double error = (noisy.points[i].norm() - range) / expected;
      sum += error;
      squares += error * error;
      ++count;
    }
    EXPECT_GT(count, 80000);
    EXPECT_NEAR(sum / count, 0, 0.015);
    EXPECT_NEAR(std::sqrt(squares / count), 1, 0.01);
  }
}

TEST(SimulatedScan, MissesWindowAndMirrorAndAFewOthers) {
  SimulatedRoomOptions options = SmallRoom();
  const Scan scan = SimulatedRoom(options).MakeScan();
  const double missing =
      static_cast<double>(scan.NumMissing()) / static_cast<double>(scan.points.size());
  EXPECT_GT(missing, 0.01);
  EXPECT_LT(missing, 0.08);
  options.bare_walls = true;
  options.furnished = false;
  const Scan bare = SimulatedRoom(options).MakeScan();
  EXPECT_NEAR(static_cast<double>(bare.NumMissing()) / static_cast<double>(bare.points.size()),
              0.002, 0.0006);
  options.missing_samples = false;
  const Scan whole = SimulatedRoom(options).MakeScan();
  EXPECT_EQ(whole.NumMissing(), 0);
  // The samples that are there are the same.
  for (size_t i = 0; i < bare.points.size(); ++i) {
    if (bare.IsMissing(static_cast<int>(i))) continue;
    ASSERT_EQ(whole.points[i], bare.points[i]);
    ASSERT_EQ(whole.intensity[i], bare.intensity[i]);
  }
}

TEST(SimulatedScan, BendsAndDriftsAsAsked) {
  SimulatedRoomOptions options = SmallRoom();
  options.range_noise = 0;
  const Scan clean = SimulatedRoom(options).MakeScan();
  options.bend = 0.01;
  options.azimuth_drift_deg = 0.5;
  const Scan bent = SimulatedRoom(options).MakeScan();
  double largest = 0;
  for (int column = 0; column < clean.num_columns; ++column) {
    for (int row = 0; row < clean.num_rows; ++row) {
      const int i = clean.Index(column, row);
      if (clean.IsMissing(i)) continue;
      const double ratio = bent.points[i].norm() / clean.points[i].norm() - 1;
      EXPECT_LE(std::abs(ratio), 0.01 + 1e-9);
      largest = std::max(largest, std::abs(ratio));
      const auto theta = [](const Eigen::Vector3d& x) { return std::atan2(x.x(), -x.z()); };
      const double drift = std::remainder(theta(bent.points[i]) - theta(clean.points[i]), 2 * kPi);
      EXPECT_NEAR(DegFromRad(drift), 0.5 * column / clean.num_columns, 1e-6);
    }
  }
  EXPECT_GT(largest, 0.007);
}

TEST(SimulatedScan, HasAnIntensityThatIsNotTheBrightnessOfThePhotos) {
  const SimulatedRoom room(SmallRoom());
  const Scan scan = room.MakeScan();
  const auto colors = room.TrueColors();
  double sx = 0, sy = 0, sxx = 0, syy = 0, sxy = 0, n = 0;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i))) {
      EXPECT_EQ(scan.intensity[i], 0);
      EXPECT_EQ(colors[i], Eigen::Vector3f::Zero());
      continue;
    }
    EXPECT_EQ(scan.intensity[i], std::round(scan.intensity[i]));
    EXPECT_GE(scan.intensity[i], 1);
    EXPECT_LE(scan.intensity[i], 4095);
    const double x = scan.intensity[i] / 4095, y = colors[i].mean();
    sx += x;
    sy += y;
    sxx += x * x;
    syy += y * y;
    sxy += x * y;
    ++n;
  }
  const double correlation = (sxy / n - sx * sy / n / n) /
                             std::sqrt((sxx / n - sx * sx / n / n) * (syy / n - sy * sy / n / n));
  EXPECT_LT(std::abs(correlation), 0.7);
}

TEST(SimulatedScan, SecondStationSeesTheSameRoomFromElsewhere) {
  SimulatedRoomOptions options = SmallRoom();
  options.num_stations = 2;
  options.range_noise = 0;
  const SimulatedRoom room(options);
  const Scan second = room.MakeScan(1);
  EXPECT_GT(second.Station().norm(), 0.7);
  // Its points lie within the same walls.
  const Rigid room_from_scan = room.ScanFromRoom().Inverse();
  for (size_t i = 0; i < second.points.size(); ++i) {
    if (second.IsMissing(static_cast<int>(i))) continue;
    const Eigen::Vector3d p = room_from_scan * second.points[i];
    ASSERT_GT(p.x(), -1e-6);
    ASSERT_LT(p.x(), options.width + 1e-6);
    ASSERT_GT(p.z(), -1e-6);
    ASSERT_LT(p.z(), options.height + 1e-6);
    ASSERT_GT(p.y(), -1e-6);
    ASSERT_LT(p.y(), options.depth + 0.2);  // the reveal of the window
  }
}

TEST(SimulatedPicks, ReprojectWithTheClickNoiseOnly) {
  SimulatedRoomOptions options = SmallRoom();
  options.range_noise = 0;
  options.click_noise_px = 2;
  const SimulatedRoom room(options);
  const CameraProjection camera(room.camera());
  double squares = 0, count = 0;
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    for (const SimulatedPick& pick : room.MakePicks(photo, 30)) {
      EXPECT_EQ(pick.image_name, room.PhotoName(photo));
      const auto at = camera.ImgFromCam(room.CamFromScan(photo) * pick.x_in_scan);
      ASSERT_TRUE(at.has_value());
      squares += (pick.x_in_img - *at).squaredNorm();
      count += 2;
    }
  }
  EXPECT_GT(count, 200);
  EXPECT_NEAR(std::sqrt(squares / count), 2, 0.25);
}

TEST(SimulatedPicks, AreScanSamplesSpreadOverThePhoto) {
  const SimulatedRoom room(SmallRoom());
  const Scan scan = room.MakeScan();
  const auto picks = room.MakePicks(room.BestPhotoForPicks(), 6);
  ASSERT_EQ(picks.size(), 6u);
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  for (const SimulatedPick& pick : picks) {
    double nearest = 1e9;
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (!scan.IsMissing(static_cast<int>(i)))
        nearest = std::min(nearest, (scan.points[i] - pick.x_in_scan).norm());
    }
    EXPECT_LT(nearest, 1e-9);
    low = low.cwiseMin(pick.x_in_img);
    high = high.cwiseMax(pick.x_in_img);
  }
  EXPECT_GT((high - low).x(), 0.5 * 480);
  EXPECT_GT((high - low).y(), 0.4 * 320);
}

TEST(SimulatedSparseModel, ReprojectsWithTheKeypointNoise) {
  const SimulatedRoom room(SmallRoom());
  const double noise_px = 0.7;
  const SparseModel model = room.MakeSparseModel(1500, noise_px);
  ASSERT_EQ(model.points.size(), 1500u);
  const CameraProjection camera(model.cameras.at(1));
  double squares = 0, count = 0;
  std::set<std::pair<uint32_t, uint32_t>> used;
  for (const auto& [id, point] : model.points) {
    EXPECT_GE(point.track.size(), 2u);
    double error = 0;
    for (const TrackElement& element : point.track) {
      const SparseImage& image = model.images.at(element.image_id);
      ASSERT_LT(element.point2d_index, image.points2d.size());
      EXPECT_EQ(image.point3d_ids[element.point2d_index], id);
      EXPECT_TRUE(used.emplace(element.image_id, element.point2d_index).second);
      const auto at = camera.ImgFromCam(image.cam_from_model * point.x_in_model);
      ASSERT_TRUE(at.has_value());
      const double distance = (image.points2d[element.point2d_index] - *at).norm();
      error += distance;
      squares += distance * distance;
      count += 2;
    }
    EXPECT_NEAR(point.error, error / static_cast<double>(point.track.size()), 1e-6);
  }
  EXPECT_NEAR(std::sqrt(squares / count), noise_px, 0.02);
  size_t with_point = 0;
  for (const auto& [id, image] : model.images) {
    ASSERT_EQ(image.points2d.size(), image.point3d_ids.size());
    for (const uint64_t point : image.point3d_ids) with_point += point != kInvalidPoint3dId ? 1 : 0;
  }
  EXPECT_EQ(with_point, used.size());
}

TEST(SimulatedSparseModel, IsTheScanFrameMovedByItsSimilarity) {
  const SimulatedRoom room(SmallRoom());
  const SparseModel model = room.MakeSparseModel(300, 0.0);
  const Similarity scan_from_sparse = room.ScanFromSparse();
  EXPECT_GT(std::abs(scan_from_sparse.scale - 1), 0.1);
  for (int photo = 0; photo < room.NumPhotos(); ++photo) {
    const SparseImage* const image = model.FindImage(room.PhotoName(photo));
    ASSERT_NE(image, nullptr);
    EXPECT_THAT(CamFromScan(image->cam_from_model, scan_from_sparse),
                IsNearRigid(room.CamFromScan(photo), 1e-9, 1e-9));
  }
  // The points lie on the surfaces that were scanned, or behind something; most of them near a
  // sample.
  const Scan scan = room.MakeScan();
  int near = 0;
  for (const auto& [id, point] : model.points) {
    const Eigen::Vector3d x = scan_from_sparse * point.x_in_model;
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.IsMissing(static_cast<int>(i)) || (scan.points[i] - x).squaredNorm() > 0.05 * 0.05)
        continue;
      ++near;
      break;
    }
  }
  EXPECT_GT(near, 240);
}

TEST(SimulatedSparseModel, EveryPhotoSeesManyPointsAndOverlapsSeveralOthers) {
  SimulatedRoomOptions options = SmallRoom();
  for (const int num_photos : {14, 30}) {
    options.num_photos = num_photos;
    const SparseModel model = SimulatedRoom(options).MakeSparseModel(2000, 0.5);
    std::map<uint32_t, std::map<uint32_t, int>> shared;
    for (const auto& [id, point] : model.points) {
      for (const TrackElement& a : point.track) {
        for (const TrackElement& b : point.track) ++shared[a.image_id][b.image_id];
      }
    }
    for (const auto& [id, image] : model.images) {
      const int own = shared[id][id];
      EXPECT_GT(own, 150) << image.name;
      // Half of it, of which a sixth are not found again (MakeRoomSparseModel leaves 15 % out).
      int overlapping = 0;
      for (const auto& [other, count] : shared[id])
        overlapping += other != id && count > 0.5 * 0.85 * own ? 1 : 0;
      EXPECT_GE(overlapping, 2) << image.name << " of " << num_photos;
    }
  }
}

TEST(SimulatedRoom, HasNoFinerDetailThanAskedFor) {
  SimulatedRoomOptions options = SmallRoom();
  // Mean step of the colour from sample to sample.
  const auto roughness = [](const SimulatedRoom& room) {
    const std::vector<Eigen::Vector3f> colors = room.TrueColors();
    double sum = 0;
    for (size_t i = 1; i < colors.size(); ++i) sum += (colors[i] - colors[i - 1]).norm();
    return sum / static_cast<double>(colors.size());
  };
  const double fine = roughness(SimulatedRoom(options));
  options.finest_detail = 0.05;
  EXPECT_LT(roughness(SimulatedRoom(options)), 0.9 * fine);
}

TEST(SimulatedRoom, SightingsProjectTheSamplesThatNothingHides) {
  const SimulatedRoom room(SmallRoom());
  const Scan scan = room.MakeScan();
  const TrueSamples samples = room.MakeTrueSamples();
  const CameraProjection camera(room.camera());
  const Rigid scan_from_room = room.ScanFromRoom();
  int num_seen = 0;
  const std::vector<Eigen::Vector2f> sightings = room.TrueSightings(samples, 1);
  for (size_t i = 0; i < scan.points.size(); ++i) {
    ASSERT_EQ(samples.points[i].x() == samples.points[i].x(), !scan.IsMissing(static_cast<int>(i)));
    if (scan.IsMissing(static_cast<int>(i))) continue;
    // Without noise: on the ray, within five standard deviations.
    const Eigen::Vector3d point = scan_from_room * samples.points[i];
    ASSERT_LT((point - scan.points[i]).norm(), 6 * room.options().range_noise);
    ASSERT_LT(point.normalized().cross(scan.points[i].normalized()).norm(), 1e-6);
    if (!(sightings[i].x() == sightings[i].x())) continue;
    ++num_seen;
    const auto position = camera.ImgFromCam(room.CamFromScan(1) * point);
    ASSERT_TRUE(position.has_value());
    ASSERT_LT((sightings[i].cast<double>() - *position).norm(), 1e-2);
  }
  EXPECT_GT(num_seen, 0.05 * static_cast<double>(scan.points.size()));
}

// What lies at a distance from the middle of a photo lies 1.3 times as far out in a zoomed one.
TEST(SimulatedRoom, ZoomedPhotosShowAThirdMore) {
  SimulatedRoomOptions options = SmallRoom();
  options.distortion = false;
  options.camera_model = "PINHOLE";
  const SimulatedRoom usual(options);
  options.zoomed = 0.2;
  const SimulatedRoom zoomed(options);
  const TrueSamples samples = usual.MakeTrueSamples(0);
  const auto& params = usual.camera().params;
  const Eigen::Vector2f centre = Eigen::Vector2d(params[2], params[3]).cast<float>();
  for (const int photo : {3, 4}) {  // every fifth
    const double zoom = photo == 4 ? 1.3 : 1;
    EXPECT_NEAR(zoomed.TrueCamera(photo).params[0], zoom * zoomed.camera().params[0], 1e-9);
    const auto before = usual.TrueSightings(samples, photo);
    const auto after = zoomed.TrueSightings(samples, photo);
    int num_seen = 0;
    for (size_t i = 0; i < before.size(); ++i) {
      if (!before[i].allFinite() || !after[i].allFinite()) continue;
      ++num_seen;
      EXPECT_LT((after[i] - centre - static_cast<float>(zoom) * (before[i] - centre)).norm(),
                0.01f);
    }
    EXPECT_GT(num_seen, 1000);
  }
  EXPECT_NE(zoomed.BestPhotoForPicks(), 4);
}

TEST(SimulatedRoom, StrangersStandInTheGivenShareOfThePhotos) {
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 4;
  const SimulatedRoom empty(options);
  options.strangers = 0.5;
  const SimulatedRoom visited(options);
  int num_strangers = 0;
  for (int photo = 0; photo < 4; ++photo) {
    cv::Mat difference;
    cv::absdiff(empty.RenderPhoto(photo), visited.RenderPhoto(photo), difference);
    const double changed =
        cv::countNonZero(difference.reshape(1) > 8) / static_cast<double>(3 * difference.total());
    num_strangers += visited.HasStranger(photo);
    EXPECT_EQ(changed > 0, visited.HasStranger(photo));
    EXPECT_LT(changed, 0.25);
    EXPECT_GE(changed, visited.HasStranger(photo) ? 0.03 : 0.0);
  }
  EXPECT_EQ(num_strangers, 2);
}

// Metres to the nearest sample of a scan that lies within four degrees of the ray; 0 = there is
// none.
double RangeAlong(const Scan& scan, const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  double nearest = 0;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    const Eigen::Vector3d to = scan.points[i] - from;
    if (to.normalized().dot(direction) < std::cos(RadFromDeg(4))) continue;
    if (nearest == 0 || to.norm() < nearest) nearest = to.norm();
  }
  return nearest;
}

TEST(SimulatedRoom, ASecondOneLiesBehindTheOpenDoor) {
  SimulatedRoomOptions options = SmallRoom();
  options.range_noise = 0;
  const SimulatedRoom closed(options);
  options.second_room = true;
  const SimulatedRoom room(options);
  ASSERT_EQ(room.NumStations(), 2);
  ASSERT_EQ(room.NumPhotos(), 32);
  const auto place_of = [&](int photo) { return room.CamFromRoom(photo).TargetOriginInSource(); };
  for (int photo = 0; photo < 10; ++photo) {
    EXPECT_GT(place_of(photo).y(), 0.4);
    EXPECT_LT(place_of(photo + 10).y(), -kPartitionThickness - 0.4);
  }
  // On the way through the door: from the first room into the second, and back.
  EXPECT_GT(place_of(20).y(), 0.5);
  EXPECT_LT(place_of(25).y(), -kPartitionThickness);
  EXPECT_LT(place_of(26).y(), -0.5);
  EXPECT_GT(place_of(31).y(), 0);
  for (int photo = 20; photo < 32; ++photo) {
    EXPECT_NEAR(place_of(photo).x(), options.DoorX(), 0.1) << photo;
    const double forward =
        room.CamFromRoom(photo).rotation.conjugate()._transformVector({0, 0, 1}).y();
    EXPECT_EQ(forward < 0, photo < 26) << photo;
  }

  // Each scan has its room, and what the door shows of the other.
  const Rigid room_from_scan = room.ScanFromRoom().Inverse();
  const double other_side[] = {-kPartitionThickness - 0.01, 0.01};
  for (const int station : {0, 1}) {
    const Scan scan = room.MakeScan(station);
    int num_here = 0, num_there = 0;
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      const double y = (room_from_scan * scan.points[i]).y();
      const bool there = station == 0 ? y < other_side[0] : y > other_side[1];
      ++(there ? num_there : num_here);
    }
    EXPECT_GT(num_there, 100) << station;
    EXPECT_LT(num_there, 0.1 * num_here) << station;
  }
  // Through the door, and against it where it is shut.
  const Eigen::Vector3d before_door(options.DoorX(), 1, 1.9);
  const auto range = [&](const SimulatedRoom& of, const Scan& scan) {
    return RangeAlong(scan, of.ScanFromRoom() * before_door,
                      of.ScanFromRoom().rotation * Eigen::Vector3d(0, -1, 0));
  };
  EXPECT_NEAR(range(closed, closed.MakeScan()), 1, 0.05);
  EXPECT_GT(range(room, room.MakeScan(1)), 1 + kPartitionThickness + 1.5);

  // Picks of the second room are in the frame of its own scan.
  const int picked = room.BestPhotoForPicks(1);
  EXPECT_GE(picked, 10);
  const Rigid scan_from_station = room.MakeScan(1).scan_from_station;
  const CameraProjection camera(room.camera());
  const auto picks = room.MakePicks(picked, 6, 1);
  ASSERT_EQ(picks.size(), 6u);
  for (const SimulatedPick& pick : picks) {
    const auto at =
        camera.ImgFromCam(room.CamFromScan(picked) * (scan_from_station * pick.x_in_scan));
    ASSERT_TRUE(at.has_value());
    EXPECT_LT((pick.x_in_img - *at).norm(), 5 * options.click_noise_px);
  }
}

}  // namespace
}  // namespace roomtex
