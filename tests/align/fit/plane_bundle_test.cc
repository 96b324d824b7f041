#include "align/fit/plane_bundle.h"

#include <algorithm>
#include <iterator>
#include <memory>
#include <random>
#include <vector>

#include <gmock/gmock.h>

#include "core/frames.h"
#include "tests/align/surface/curved_room.h"
#include "tests/align/surface/surface_room.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using testing::HasSubstr;

SparseModel Moved(SparseModel model, double metres, double deg, double growth) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, -2, 0.5).normalized();
  TransformModel({1 + growth, Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(deg), axis)),
                  metres * Eigen::Vector3d(0.6, -0.3, 0.74).normalized()},
                 &model);
  return model;
}

// The similarity that FitToSurface finds from a start some centimetres off.
SparseModel OnSurface(const SurfaceRoom& room, const SparseModel& model) {
  SparseModel start = Moved(model, 0.03, 0.3, 0.003);
  const std::vector<bool> used(room.picks.size(), true);
  const SimilarityFit fit =
      FitToSurface(start, FindSurfacePoints(start, 3, 0.7), *room.patches, room.picks, used, 1.5,
                   0.2, Similarity(), SimilarityFitOptions());
  EXPECT_TRUE(fit.converged);
  TransformModel(fit.scan_from_sparse, &start);
  return start;
}

TEST(PlaneBundle, BringsThePosesNearerToTheTruthThanAnySimilarity) {
  double best = 0, fitted = 0, adjusted = 0, worst_fitted = 0, worst_adjusted = 0;
  constexpr int kNumRooms = 4;
  for (int seed = 0; seed < kNumRooms; ++seed) {
    const Reconstruction& one = StraightRoom(seed);
    const SparseModel similarity = OnSurface(one.room, one.model);
    const PlaneBundle bundle = AdjustToSurface(one.room.Input(similarity), PlaneBundleOptions());
    ASSERT_TRUE(bundle.usable) << bundle.reason;
    const PoseSpread before = PoseErrorsOf(one.room.room, similarity);
    const PoseSpread after = PoseErrorsOf(one.room.room, bundle.model);
    best += PoseErrorsOf(one.room.room, one.model).position.median / kNumRooms;
    fitted += before.position.median / kNumRooms;
    adjusted += after.position.median / kNumRooms;
    worst_fitted += before.position.worst / kNumRooms;
    worst_adjusted += after.position.worst / kNumRooms;
    EXPECT_LT(after.position.median, 0.0015) << seed;
    EXPECT_LT(after.rotation.median, RadFromDeg(0.02)) << seed;
    EXPECT_LT(after.position.worst, 0.004) << seed;
    EXPECT_LT(bundle.plane_rms_after, 0.5 * bundle.plane_rms_before);
    EXPECT_LT(bundle.reprojection_rms_after, 1.1 * bundle.reprojection_rms_before);
    EXPECT_NEAR(bundle.sigma_px, 0.7, 0.1);
  }
  EXPECT_LT(adjusted, 0.9 * fitted);
  EXPECT_LT(worst_adjusted, worst_fitted);
  RecordProperty("best_similarity_mm", std::to_string(1000 * best));
  RecordProperty("fitted_mm", std::to_string(1000 * fitted));
  RecordProperty("adjusted_mm", std::to_string(1000 * adjusted));
}

TEST(PlaneBundle, ReportsTheSamePointsBeforeAndAfter) {
  const Reconstruction& one = StraightRoom();
  const SparseModel similarity = OnSurface(one.room, one.model);
  const PlaneBundle bundle = AdjustToSurface(one.room.Input(similarity), PlaneBundleOptions());
  ASSERT_TRUE(bundle.usable) << bundle.reason;
  double before = 0, after = 0;
  std::vector<int> counts(one.room.planes.size(), 0);
  for (const SurfaceConstraint& c : bundle.constraints) {
    before += std::pow(c.Distance(similarity.points.at(c.point3d_id).x_in_model), 2);
    after += std::pow(c.Distance(bundle.model.points.at(c.point3d_id).x_in_model), 2);
    if (c.plane >= 0) ++counts[c.plane];
  }
  const double n = static_cast<double>(bundle.constraints.size());
  EXPECT_NEAR(bundle.plane_rms_before, std::sqrt(before / n), 1e-12);
  EXPECT_NEAR(bundle.plane_rms_after, std::sqrt(after / n), 1e-12);
  EXPECT_EQ(bundle.num_points_of_plane, counts);
  EXPECT_GT(n, 1000);
  SparseModel copy = bundle.model;
  EXPECT_NEAR(UpdateReprojectionErrors(&copy).rms_px, bundle.reprojection_rms_after, 1e-12);
  for (const auto& [id, point] : bundle.model.points) {
    EXPECT_EQ(point.track.size(), similarity.points.at(id).track.size());
    EXPECT_NEAR(point.error, copy.points.at(id).error, 1e-12);
  }
}

// Of all points but every `kept`-th each photo shares with but one other.
SparseModel WithTracksOfTwo(SparseModel model, uint64_t kept) {
  uint64_t next_id = model.points.rbegin()->first + 1;
  std::map<uint64_t, SparsePoint> pairs;
  for (auto& [id, point] : model.points) {
    std::vector<TrackElement>& track = point.track;
    while (id % kept != 0 && track.size() >= 4) {
      SparsePoint pair = point;
      pair.track.assign(track.end() - 2, track.end());
      track.erase(track.end() - 2, track.end());
      for (const TrackElement& e : pair.track) {
        model.images.at(e.image_id).point3d_ids[e.point2d_index] = next_id;
      }
      pairs[next_id++] = pair;
    }
    if (id % kept != 0 && track.size() == 3) {
      model.images.at(track[2].image_id).point3d_ids[track[2].point2d_index] = kInvalidPoint3dId;
      track.pop_back();
    }
  }
  model.points.merge(pairs);
  return model;
}

// Photos that overlap little: no third confirms what two show. The surface does.
TEST(PlaneBundle, PointsOfTwoPhotosHoldPosesWhereFewAreOfMore) {
  double of_three = 0, of_two = 0;
  constexpr int kNumRooms = 2;
  for (int seed = 0; seed < kNumRooms; ++seed) {
    const SurfaceRoom& room = StraightRoom(seed).room;
    SparseModel true_model = room.room.MakeSparseModel(2000, 0.2);
    TransformModel(room.room.ScanFromSparse(), &true_model);
    const SparseModel model = OnSurface(room, Reconstructed(WithTracksOfTwo(true_model, 18)));
    for (const int min_track : {3, 2}) {
      PlaneBundleOptions options;
      options.min_track = min_track;
      const PlaneBundle bundle = AdjustToSurface(room.Input(model), options);
      ASSERT_TRUE(bundle.usable) << bundle.reason;
      (min_track == 3 ? of_three : of_two) +=
          PoseErrorsOf(room.room, bundle.model).position.median / kNumRooms;
    }
  }
  EXPECT_LT(of_two, 0.7 * of_three);
  RecordProperty("three_mm", std::to_string(1000 * of_three));
  RecordProperty("two_mm", std::to_string(1000 * of_two));
}

TEST(PlaneBundle, PatchesHelpWhereThereAreFewPlanes) {
  // Of the planes only the floor is known.
  double without = 0, with = 0;
  for (int seed = 0; seed < 4; ++seed) {
    const Reconstruction& one = StraightRoom(seed);
    const SparseModel similarity = OnSurface(one.room, one.model);
    const std::vector<ScanPlane> floor(one.room.planes.end() - 2, one.room.planes.end() - 1);
    PlaneBundleInput input{similarity,
                           floor,
                           *one.room.patches,
                           one.room.picks,
                           std::vector<bool>(one.room.picks.size(), true),
                           1.5,
                           one.room.picks[0].image_name};
    PlaneBundleOptions options;
    const PlaneBundle any_surface = AdjustToSurface(input, options);
    options.association.surface = false;
    const PlaneBundle planes_only = AdjustToSurface(input, options);
    ASSERT_TRUE(any_surface.usable) << any_surface.reason;
    with += PoseErrorsOf(one.room.room, any_surface.model).position.median / 4;
    without += PoseErrorsOf(one.room.room, planes_only.model).position.median / 4;
    EXPECT_GT(any_surface.constraints.size(), 2 * planes_only.constraints.size());
  }
  EXPECT_LT(with, 0.7 * without);
  EXPECT_LT(with, 0.0015);
}

Spread PositionErrors(const CurvedRoom& room, const SparseModel& model) {
  std::vector<double> errors;
  for (const auto& [id, image] : model.images) {
    errors.push_back(
        (image.cam_from_model.TargetOriginInSource() - room.TruePose(id).TargetOriginInSource())
            .norm());
  }
  return SpreadOf(errors);
}

TEST(PlaneBundle, ARoomWithoutAnyPlaneIsHeldByPatches) {
  const CurvedRoom room;
  const ScanPatches patches({room.scan}, ScanPatchOptions());
  const SparseModel best = Reconstructed(room.model), start = Moved(best, 0.02, 0.2, 0.003);
  const std::vector<ScanPlane> no_planes;
  const PlaneBundleInput input{start, no_planes,    patches, room.picks, std::vector<bool>(6, true),
                               1.5,   "photo_1.jpg"};
  PlaneBundleOptions options;
  const PlaneBundle bundle = AdjustToSurface(input, options);
  ASSERT_TRUE(bundle.usable) << bundle.reason;
  // Better than the best similarity that there is.
  EXPECT_LT(PositionErrors(room, bundle.model).median, PositionErrors(room, best).median);
  EXPECT_LT(PositionErrors(room, bundle.model).worst, 0.7 * PositionErrors(room, best).worst);
  EXPECT_LT(PositionErrors(room, bundle.model).median, 0.002);
  EXPECT_GT(bundle.constraints.size(), 3500u);
  options.association.surface = false;
  const PlaneBundle nothing = AdjustToSurface(input, options);
  EXPECT_FALSE(nothing.usable);
  EXPECT_THAT(nothing.reason, HasSubstr("Only 0 sparse points lie on the scan's planes"));
}

TEST(PlaneBundle, PicksHoldWhatOneWallLeavesOpen) {
  const Reconstruction& one = StraightRoom();
  Scan wall = one.room.scan;
  const Rigid room_from_scan = one.room.room.ScanFromRoom().Inverse();
  for (size_t i = 0; i < wall.points.size(); ++i) {
    if (!(std::abs((room_from_scan * one.room.true_scan.points[i]).x()) < 1e-6)) {
      wall.points[i] = Scan::MissingPoint();
    }
  }
  const ScanPatches patches({wall}, ScanPatchOptions());
  const std::vector<ScanPlane> planes(one.room.planes.begin(), one.room.planes.begin() + 1);
  std::vector<Pick> picks = one.room.picks;
  for (int photo = 0; photo < 8; photo += 4) {
    for (const Pick& pick : PicksOfPhoto(one.room.room, photo, 8)) picks.push_back(pick);
  }
  const SparseModel start = Moved(one.model, 0.01, 0.1, 0.002);
  const PlaneBundle bundle =
      AdjustToSurface({start, planes, patches, picks, std::vector<bool>(picks.size(), true), 1.5,
                       picks[0].image_name},
                      PlaneBundleOptions());
  ASSERT_TRUE(bundle.usable) << bundle.reason;
  EXPECT_LT(PoseErrorsOf(one.room.room, bundle.model).position.worst, 0.015);
  EXPECT_LT(bundle.plane_rms_after, 0.002);
}

TEST(PlaneBundle, ConvergesFromAWrongSimilarityOrSaysNo) {
  const Reconstruction& one = StraightRoom();
  int num_usable = 0;
  for (const double size : {0.2, -0.5, 1.0, -1.0, 3.0, 6.0}) {
    const SparseModel start = Moved(one.model, 0.05 * size, 1.0 * size, 0.005 * size);
    const PlaneBundle bundle = AdjustToSurface(one.room.Input(start), PlaneBundleOptions());
    num_usable += bundle.usable;
    if (bundle.usable) {
      EXPECT_LT(PoseErrorsOf(one.room.room, bundle.model).position.worst, 0.005) << size;
    } else {
      EXPECT_THAT(bundle.reason, testing::EndsWith("."));
      for (const auto& [id, image] : bundle.model.images) {
        EXPECT_EQ(image.cam_from_model.translation, start.images.at(id).cam_from_model.translation);
      }
    }
  }
  EXPECT_GE(num_usable, 4);
}

TEST(PlaneBundle, DoesNotDependOnTheFrameOfTheScan) {
  const Reconstruction& one = StraightRoom();
  const SparseModel start = Moved(one.model, 0.01, 0.1, 0.001);
  const PlaneBundle before = AdjustToSurface(one.room.Input(start), PlaneBundleOptions());
  const Rigid other{Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(), {120, -40, 5}};
  SparseModel moved = start;
  TransformModel({1, other.rotation, other.translation}, &moved);
  std::vector<ScanPlane> planes = one.room.planes;
  for (ScanPlane& plane : planes) {
    plane.point = other * plane.point;
    for (Eigen::Vector3d* axis : {&plane.normal, &plane.u, &plane.v}) {
      *axis = other.rotation * *axis;
    }
  }
  std::vector<Pick> picks = one.room.picks;
  for (Pick& pick : picks) pick.x_in_scan = other * pick.x_in_scan;
  // Patches depend on where their cubes lie: without them.
  PlaneBundleOptions options;
  options.association.surface = false;
  const ScanPatches no_patches({}, ScanPatchOptions());
  const std::vector<bool> used(picks.size(), true);
  const std::string clicked = picks[0].image_name;
  const PlaneBundle a = AdjustToSurface(
      {start, one.room.planes, no_patches, one.room.picks, used, 1.5, clicked}, options);
  const PlaneBundle b =
      AdjustToSurface({moved, planes, no_patches, picks, used, 1.5, clicked}, options);
  ASSERT_TRUE(a.usable && b.usable) << a.reason << b.reason;
  EXPECT_EQ(a.constraints.size(), b.constraints.size());
  for (const auto& [id, image] : a.model.images) {
    EXPECT_THAT(b.model.images.at(id).cam_from_model * other,
                IsNearRigid(image.cam_from_model, 1e-6, 1e-6));
  }
}

TEST(PlaneBundle, AFixedClickedViewKeepsItsPoseToTheLastBit) {
  const Reconstruction& one = StraightRoom();
  const SparseModel start = OnSurface(one.room, one.model);
  PlaneBundleOptions options;
  options.fix_clicked_view = true;
  const PlaneBundle fixed = AdjustToSurface(one.room.Input(start), options);
  ASSERT_TRUE(fixed.usable) << fixed.reason;
  const std::string name = one.room.picks[0].image_name;
  for (const auto& [id, image] : start.images) {
    const Rigid& adjusted = fixed.model.images.at(id).cam_from_model;
    EXPECT_EQ(image.name == name,
              adjusted.rotation.coeffs() == image.cam_from_model.rotation.coeffs() &&
                  adjusted.translation == image.cam_from_model.translation)
        << image.name;
  }
}

// Rays of photos that were taken at one place, as the faces of a panorama, may meet in the cameras.
TEST(PlaneBundle, PointsInTwoCamerasAtOnePlaceStopNoAdjustment) {
  const Reconstruction& one = StraightRoom();
  SparseModel start = OnSurface(one.room, one.model);
  const auto median_error = [&](const SparseModel& model) {
    return PoseErrorsOf(one.room.room, model).position.median;
  };
  const PlaneBundle without = AdjustToSurface(one.room.Input(start), PlaneBundleOptions());
  const uint32_t id = start.images.begin()->first, twin_id = start.images.rbegin()->first + 1;
  SparseImage twin = start.images.at(id);
  twin.image_id = twin_id;
  twin.name = "twin.jpg";
  start.images[twin_id] = twin;
  int num_in_cameras = 0;
  for (auto& [point_id, point] : start.points) {
    for (size_t k = 0, size = point.track.size(); k < size; ++k) {
      if (point.track[k].image_id != id) continue;
      const TrackElement seen = point.track[k];
      if (num_in_cameras++ < 3) {
        // Where both see it, with no residual.
        const Rigid scan_from_cam = twin.cam_from_model.Inverse();
        point.x_in_model = scan_from_cam * (1e-9 * (twin.cam_from_model * point.x_in_model));
        point.track = {seen};
      }
      point.track.push_back({twin_id, seen.point2d_index});
      break;
    }
  }
  ASSERT_GT(num_in_cameras, 3);
  const PlaneBundle bundle = AdjustToSurface(one.room.Input(start), PlaneBundleOptions());
  ASSERT_TRUE(bundle.usable) << bundle.reason;
  SparseModel adjusted = bundle.model;
  adjusted.images.erase(twin_id);
  EXPECT_LT(median_error(adjusted), median_error(without.model) + 0.0003);
}

// Leaves holes on the heap that what is allocated next fills in another order.
void ShuffleHeap() {
  std::vector<std::unique_ptr<char[]>> blocks;
  for (int i = 0; i < 20000; ++i) blocks.push_back(std::make_unique<char[]>(16 + i % 20 * 8));
  std::shuffle(blocks.begin(), blocks.end(), std::mt19937(5));
  for (size_t i = 0; i < blocks.size(); i += 2) blocks[i].reset();
  static std::vector<std::unique_ptr<char[]>> kept;
  std::move(blocks.begin(), blocks.end(), std::back_inserter(kept));
}

// Ceres orders what it adjusts by where it lies in memory.
TEST(PlaneBundle, GivesTheSameToTheLastBitEachTime) {
  const Reconstruction& one = StraightRoom();
  const SparseModel start = OnSurface(one.room, one.model);
  for (const bool row_motion : {false, true}) {
    SCOPED_TRACE(row_motion);
    PlaneBundleOptions options;
    options.row_motion = row_motion;
    const PlaneBundle a = AdjustToSurface(one.room.Input(start), options);
    ShuffleHeap();
    const PlaneBundle b = AdjustToSurface(one.room.Input(start), options);
    for (const auto& [id, image] : a.model.images) {
      const Rigid& other = b.model.images.at(id).cam_from_model;
      EXPECT_EQ(image.cam_from_model.translation, other.translation);
      EXPECT_EQ(image.cam_from_model.rotation.coeffs(), other.rotation.coeffs());
    }
  }
}

TEST(PlaneBundle, ClutterThatTheScanDoesNotHaveIsNotPulledOntoTheWall) {
  // Every tenth point stands 6 cm in front of the surface, as if put there after the scan.
  const Reconstruction& one = StraightRoom();
  SparseModel truth = one.room.true_model;
  std::map<uint64_t, Eigen::Vector3d> clutter;
  for (auto& [id, point] : truth.points) {
    if (id % 10 != 0) continue;
    Eigen::Vector3d to_cameras = Eigen::Vector3d::Zero();
    for (const TrackElement& element : point.track) {
      to_cameras += (truth.images.at(element.image_id).cam_from_model.TargetOriginInSource() -
                     point.x_in_model)
                        .normalized();
    }
    const Eigen::Vector3d before = point.x_in_model;
    point.x_in_model += 0.06 * to_cameras.normalized();
    clutter[id] = point.x_in_model;
    for (const TrackElement& element : point.track) {
      SparseImage& image = truth.images.at(element.image_id);
      const CameraProjection projection(truth.cameras.at(image.camera_id));
      image.points2d[element.point2d_index] +=
          projection.ImgFromCam(image.cam_from_model * point.x_in_model).value() -
          projection.ImgFromCam(image.cam_from_model * before).value();
    }
  }
  const SparseModel start = OnSurface(one.room, Reconstructed(truth));
  const PlaneBundle bundle = AdjustToSurface(one.room.Input(start), PlaneBundleOptions());
  ASSERT_TRUE(bundle.usable) << bundle.reason;
  std::vector<double> errors;
  for (const auto& [id, x_in_scan] : clutter) {
    errors.push_back((bundle.model.points.at(id).x_in_model - x_in_scan).norm());
  }
  EXPECT_LT(SpreadOf(errors).median, 0.005);
  EXPECT_LT(PoseErrorsOf(one.room.room, bundle.model).position.median, 0.002);
}

TEST(PlaneBundle, RefinesTheCameraOnRequest) {
  const Reconstruction& one = StraightRoom();
  SparseModel wrong = one.room.true_model;
  wrong.cameras.at(1).params[0] *= 1.003;
  wrong.cameras.at(1).params[1] *= 1.003;
  const SparseModel start = OnSurface(one.room, Reconstructed(wrong));
  PlaneBundleOptions options;
  options.refine_intrinsics = true;
  const PlaneBundle bundle = AdjustToSurface(one.room.Input(start), options);
  ASSERT_TRUE(bundle.usable) << bundle.reason;
  const Camera truth = one.room.room.camera();
  for (int k = 0; k < 2; ++k) {
    EXPECT_NEAR(bundle.model.cameras.at(1).params[k] / truth.params[k], 1, 5e-4);
  }
  EXPECT_LT(PoseErrorsOf(one.room.room, bundle.model).position.median, 0.002);
  // Held, they stay.
  const PlaneBundle held = AdjustToSurface(one.room.Input(start), PlaneBundleOptions());
  EXPECT_EQ(held.model.cameras.at(1).params, wrong.cameras.at(1).params);
}

TEST(PlaneBundle, TheFixedBetaOfTheThesisCanBeUsed) {
  const Reconstruction& one = StraightRoom();
  const SparseModel start = OnSurface(one.room, one.model);
  double before = 1;
  for (const double beta : {50.0, 500.0, 5000.0}) {
    PlaneBundleOptions options;
    options.beta = beta;
    const PlaneBundle bundle = AdjustToSurface(one.room.Input(start), options);
    ASSERT_TRUE(bundle.usable) << bundle.reason;
    EXPECT_LT(bundle.plane_rms_after, before) << beta;
    before = bundle.plane_rms_after;
  }
}

// Every fourth point that photo 5 sees keeps one more photo.
void LeavePointsToPhoto5(SparseModel* model) {
  for (auto& [id, point] : model->points) {
    const bool is_seen =
        std::any_of(point.track.begin(), point.track.end(),
                    [](const TrackElement& element) { return element.image_id == 5; });
    if (!is_seen || id % 4 != 0) continue;
    std::stable_partition(point.track.begin(), point.track.end(),
                          [](const TrackElement& element) { return element.image_id == 5; });
    for (size_t i = 2; i < point.track.size(); ++i) {
      const TrackElement& element = point.track[i];
      model->images.at(element.image_id).point3d_ids[element.point2d_index] = kInvalidPoint3dId;
    }
    if (point.track.size() > 2) point.track.resize(2);
  }
}

TEST(PlaneBundle, APhotoThatStandsElsewhereThanItsPointsWantItIsPutBackAndItsCostNotCompared) {
  const Reconstruction& one = StraightRoom();
  SparseModel start = OnSurface(one.room, one.model);
  LeavePointsToPhoto5(&start);
  start.images.at(5).cam_from_model.translation.x() += 0.25;
  const PlaneBundle bundle = AdjustToSurface(one.room.Input(start), PlaneBundleOptions());
  ASSERT_TRUE(bundle.usable) << bundle.reason;
  EXPECT_THAT(bundle.ran_away, testing::ElementsAre(5));
  EXPECT_THAT(bundle.idle_images, testing::ElementsAre(5));
  // With its pose its points follow the similarity, also those that were moved before it ran away.
  int num_own = 0;
  for (const auto& [id, point] : bundle.model.points) {
    const auto num_seen =
        std::count_if(point.track.begin(), point.track.end(),
                      [](const TrackElement& element) { return element.image_id != 5; });
    if (num_seen >= 2) continue;
    ++num_own;
    EXPECT_THAT(point.x_in_model,
                IsNearMatrix(bundle.adjusted_from_input * start.points.at(id).x_in_model, 1e-9));
  }
  EXPECT_GT(num_own, 20);
  const PlaneBundle right =
      AdjustToSurface(one.room.Input(OnSurface(one.room, one.model)), PlaneBundleOptions());
  ASSERT_TRUE(right.usable) << right.reason;
  EXPECT_TRUE(right.ran_away.empty());
  for (const auto& [one_of_two, other] : {std::pair(&right, &bundle), {&bundle, &right}}) {
    double cost = 0;
    for (const auto& [id, of_photo] : one_of_two->photo_costs) cost += of_photo;
    EXPECT_NEAR(SharedImageCost(*one_of_two, *other), cost - one_of_two->photo_costs.at(5),
                1e-9 * cost);
  }
}

TEST(PlaneBundle, APhotoThatNothingHoldsFollowsTheOthers) {
  const Reconstruction& one = StraightRoom();
  SparseModel start = OnSurface(one.room, one.model);
  // Photo 5 keeps three of its observations.
  SparseImage& image = start.images.at(5);
  int kept = 0;
  for (uint64_t& id : image.point3d_ids) {
    if (id == kInvalidPoint3dId || kept++ < 3) continue;
    auto& track = start.points.at(id).track;
    track.erase(std::remove_if(track.begin(), track.end(),
                               [](const TrackElement& element) { return element.image_id == 5; }),
                track.end());
    id = kInvalidPoint3dId;
  }
  const PlaneBundle bundle = AdjustToSurface(one.room.Input(start), PlaneBundleOptions());
  ASSERT_TRUE(bundle.usable) << bundle.reason;
  EXPECT_THAT(bundle.idle_images, testing::ElementsAre(5));
  EXPECT_THAT(
      bundle.model.images.at(5).cam_from_model,
      IsNearRigid(CamFromScan(image.cam_from_model, bundle.adjusted_from_input), 1e-7, 1e-9));
  EXPECT_LT(PoseErrorsOf(one.room.room, bundle.model).position.median, 0.0015);
}

TEST(PlaneBundle, PicksThatContradictTheSurfaceAreSaid) {
  const Reconstruction& one = StraightRoom();
  PlaneBundleInput input = one.room.Input(one.model);
  std::vector<Pick> picks = one.room.picks;
  for (Pick& pick : picks) pick.x_in_img.x() += 60;
  const PlaneBundle bundle = AdjustToSurface(
      {one.model, one.room.planes, *one.room.patches, picks, input.used, 1.5, input.clicked_image},
      PlaneBundleOptions());
  EXPECT_FALSE(bundle.usable);
  EXPECT_THAT(bundle.reason, HasSubstr("Picks and surface contradict each other"));
}

TEST(PlaneBundle, SaysSoWhereNothingLiesOnTheSurface) {
  const Reconstruction& one = StraightRoom();
  SparseModel start = one.model;
  TransformModel({1, Eigen::Quaterniond::Identity(), {50, 0, 0}}, &start);
  const PlaneBundle bundle = AdjustToSurface(one.room.Input(start), PlaneBundleOptions());
  EXPECT_FALSE(bundle.usable);
  EXPECT_THAT(bundle.reason, HasSubstr("too few to adjust"));
  EXPECT_EQ(bundle.model.points.begin()->second.x_in_model,
            start.points.begin()->second.x_in_model);
}

TEST(PlaneBundle, ABentScanGetsTheColoursToTheirPlace) {
  struct Case {
    int seed;
    double bend, drift_deg;
  };
  for (const Case& c : {Case{0, 0.01, 0}, Case{1, 0.005, 0.2}, Case{2, 0, 0.3}}) {
    const Reconstruction one(SmallRoom(c.seed, c.bend, c.drift_deg));
    const SparseModel similarity = OnSurface(one.room, one.model);
    const Spread truth = ColourErrors(one.room, one.model);  // the best similarity to the truth
    const Spread fitted = ColourErrors(one.room, similarity);
    PlaneBundleOptions bundle_options;
    bundle_options.association.surface = false;
    const PlaneBundle planes = AdjustToSurface(one.room.Input(similarity), bundle_options);
    bundle_options.association.surface = true;
    const PlaneBundle any = AdjustToSurface(one.room.Input(similarity), bundle_options);
    // Straightened.
    const std::vector<bool> used(one.room.picks.size(), true);
    const auto fit = FitScanBend(similarity, FindSurfacePoints(similarity, 3, 0.7), {one.room.scan},
                                 *one.room.patches, one.room.picks, used, 1.5, Similarity(),
                                 bundle_options.min_bend);
    ASSERT_TRUE(fit.has_value());
    SparseModel straight = similarity;
    TransformModel(fit->scan_from_sparse, &straight);
    PlaneBundleInput input = one.room.Input(straight);
    input.bend = fit->bend;
    const PlaneBundle bent = AdjustToSurface(input, bundle_options);
    ASSERT_TRUE(planes.usable && any.usable && bent.usable)
        << planes.reason << any.reason << bent.reason;
    const Spread with_planes = ColourErrors(one.room, planes.model);
    const Spread with_any = ColourErrors(one.room, any.model);
    const Spread with_bend = ColourErrors(one.room, bent.model);
    std::printf(
        "bend %.3f, drift %.1f deg: colour off by mm (median): best similarity to the "
        "truth %.2f, similarity on the surface %.2f, planes %.2f, any surface %.2f, "
        "straightened %.2f\n",
        c.bend, c.drift_deg, 1000 * truth.median, 1000 * fitted.median, 1000 * with_planes.median,
        1000 * with_any.median, 1000 * with_bend.median);
    EXPECT_LT(with_any.median, fitted.median);
    EXPECT_LT(with_bend.median, 0.8 * truth.median);
    EXPECT_LT(with_bend.median, 0.6 * fitted.median);
    EXPECT_LT(with_bend.p90, truth.p90);
    EXPECT_LT(with_bend.median, 0.0025);
    EXPECT_LT(bent.reprojection_rms_after, 2.0);
    EXPECT_LT(bent.plane_rms_after, 0.003);
  }
}

TEST(PlaneBundleOptions, NamesEveryProblem) {
  PlaneBundleOptions options;
  EXPECT_THAT(options.Problems(), testing::IsEmpty());
  options.beta = -1;
  options.association.max_distance = 0;
  options.association.surface_noise = 0;
  options.min_track = 1;
  options.min_bend = -1;
  options.num_rounds = 0;
  options.max_iterations = 0;
  EXPECT_EQ(options.Problems().size(), 7u);
}

}  // namespace
}  // namespace roomtex
