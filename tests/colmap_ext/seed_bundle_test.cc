#include "colmap_ext/seed_bundle.h"

#include <map>
#include <numeric>

#include <glog/logging.h>
#include <gtest/gtest.h>

#include "colmap_ext/solver_log.h"
#include "colmap_ext/two_view_geometry.h"
#include "colmap_ext/two_view_hypotheses.h"
#include "tests/colmap_ext/simulated_views.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using Scene = SimulatedViewsOptions::Scene;

// A pair of simulated views with everything bundle adjustment needs, at the truth; baseline 1.
struct TruePair {
  explicit TruePair(const SimulatedViewsOptions& options) : views(SimulateViews(options)) {
    matches = views.Matched().Matches(views.pairs[0]);
    Rigid right_from_left = views.TrueRelativePose(1, 2);
    const double baseline = right_from_left.translation.norm();
    right_from_left.translation /= baseline;
    truth.views_from_left = {Rigid(), right_from_left};
    for (const RayMatch& match : matches) {
      const int index = views.point_of_keypoint.at(1)[match.left_row];
      const Eigen::Vector3d x = views.cam_from_scene.at(1) * views.points_in_scene[index];
      const int point = static_cast<int>(truth.points.size());
      truth.points.emplace_back(x.x() / x.z(), x.y() / x.z(), baseline / x.z());
      observations.push_back({0, point, match.left});
      observations.push_back({1, point, match.right});
    }
  }
  SimulatedViews views;
  std::vector<RayMatch> matches;
  SeedGeometry truth;
  std::vector<SeedObservation> observations;
};

SimulatedViewsOptions MakeOptions(Scene scene, double noise_px, int seed) {
  SimulatedViewsOptions options;
  options.scene = scene;
  options.noise_px = noise_px;
  options.outlier_share = 0;
  options.random_seed = seed;
  return options;
}

SeedGeometry Disturbed(const SeedGeometry& geometry, double angle) {
  SeedGeometry start = geometry;
  Rigid& right = start.views_from_left[1];
  right.rotation =
      Eigen::AngleAxisd(angle, Eigen::Vector3d(1, -2, 0.5).normalized()) * right.rotation;
  right.translation =
      Eigen::AngleAxisd(2 * angle, Eigen::Vector3d(0, 1, 1).normalized()) * right.translation;
  for (size_t i = 0; i < start.points.size(); ++i) {
    start.points[i].z() *= i % 2 == 0 ? 1.1 : 0.93;
  }
  return start;
}

// What Ceres says of a step that it retries comes by this way.
TEST(SolverLog, CeresSaysNothingOnStandardError) {
  SilenceCeres();
  testing::internal::CaptureStderr();
  LOG(WARNING) << "Linear solver failure.";
  LOG(ERROR) << "Residual and Jacobian evaluation failed.";
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(SeedBundle, ErrorsAreZeroAtTheTruthOfExactKeypoints) {
  SimulatedViewsOptions options = MakeOptions(Scene::kRoom, 0, 1);
  options.distortion = options.two_cameras = true;
  const TruePair pair(options);
  ASSERT_GT(ObservationErrors(pair.truth, pair.observations).size(), 100u);
  for (const double error : ObservationErrors(pair.truth, pair.observations)) {
    EXPECT_NEAR(error, 0.0, 1e-5);
  }
}

TEST(SeedBundle, CostIsHalfTheSumOfSquaredErrors) {
  const TruePair pair(MakeOptions(Scene::kRoom, 0.6, 2));
  double expected = 0;
  for (const double error : ObservationErrors(pair.truth, pair.observations)) {
    expected += 0.5 * error * error;
  }
  SeedBundleOptions options;
  options.loss_scale_px = 0;
  const SeedBundleResult result = AdjustSeed(pair.truth, pair.observations, options);
  EXPECT_NEAR(result.initial_cost, expected, 1e-6 * expected);
  double final_cost = 0;
  for (const double error : ObservationErrors(result.geometry, pair.observations)) {
    final_cost += 0.5 * error * error;
  }
  EXPECT_NEAR(result.final_cost, final_cost, 1e-6 * expected);
  EXPECT_LT(result.final_cost, result.initial_cost);
}

TEST(SeedBundle, FindsTheTruthOfExactKeypointsFromADisturbedStart) {
  for (int seed = 0; seed < 4; ++seed) {
    const TruePair pair(MakeOptions(Scene::kRoom, 0, seed));
    SeedBundleOptions options;
    options.max_iterations = 60;
    const SeedBundleResult result =
        AdjustSeed(Disturbed(pair.truth, 0.02), pair.observations, options);
    ASSERT_TRUE(result.usable);
    EXPECT_THAT(result.geometry.views_from_left[1],
                IsNearRigid(pair.truth.views_from_left[1], 1e-5, 1e-4));
    EXPECT_NEAR(result.geometry.views_from_left[1].translation.norm(), 1.0, 1e-12);
  }
}

TEST(SeedBundle, EndsInAMinimumOfItsCost) {
  const TruePair pair(MakeOptions(Scene::kRoom, 0.5, 3));
  SeedBundleOptions options;
  options.loss_scale_px = 0;
  options.max_iterations = 100;
  const SeedBundleResult result = AdjustSeed(pair.truth, pair.observations, options);
  const auto cost = [&](const SeedGeometry& geometry) {
    double sum = 0;
    for (const double error : ObservationErrors(geometry, pair.observations)) {
      sum += 0.5 * error * error;
    }
    return sum;
  };
  // Along every direction of the pose the slope (central difference) vanishes beside the curvature.
  for (int axis = 0; axis < 6; ++axis) {
    double cost_at[2];
    const double step = 1e-4;
    for (const int side : {0, 1}) {
      SeedGeometry moved = result.geometry;
      Rigid& right = moved.views_from_left[1];
      const double signed_step = side == 0 ? -step : step;
      if (axis < 3) {
        right.rotation =
            Eigen::AngleAxisd(signed_step, Eigen::Vector3d::Unit(axis)) * right.rotation;
      } else {
        right.translation += signed_step * Eigen::Vector3d::Unit(axis - 3);
        right.translation.normalize();
      }
      cost_at[side] = cost(moved);
    }
    const double slope = (cost_at[1] - cost_at[0]) / (2 * step);
    const double curvature = (cost_at[0] + cost_at[1] - 2 * cost(result.geometry)) / (step * step);
    EXPECT_GE(curvature, 0);
    EXPECT_LE(std::abs(slope), 1e-4 * curvature + 1e-3) << "axis " << axis;
  }
}

TEST(SeedBundle, RobustLossResistsAWrongMatch) {
  TruePair pair(MakeOptions(Scene::kRoom, 0.3, 4));
  pair.observations[11].ray.x += Eigen::Vector2d(0.2, -0.1);  // some 180 px
  const SeedBundleResult result = AdjustSeed(pair.truth, pair.observations, {});
  ASSERT_TRUE(result.usable);
  EXPECT_THAT(result.geometry.views_from_left[1],
              IsNearRigid(pair.truth.views_from_left[1], 0.004, 0.03));
}

TEST(SeedBundle, SamePoseStartConvergesOnAWall) {
  for (int seed = 0; seed < 10; ++seed) {
    const double noise_px = 0.5;
    const TruePair pair(MakeOptions(Scene::kWall, noise_px, seed));
    std::vector<int> all(pair.matches.size());
    std::iota(all.begin(), all.end(), 0);
    const SeedBundleResult result = SolveFromSamePose(pair.matches, all);
    ASSERT_TRUE(result.usable);
    EXPECT_NEAR(result.geometry.views_from_left[1].translation.norm(), 1.0, 1e-12);
    // One of the wall's solutions: the keypoints are met to their noise. Of every four coordinates
    // three determine the point, so one chi-square degree per match is left.
    const double chi_square = 2 * result.final_cost / (noise_px * noise_px);
    EXPECT_LT(chi_square, 1.4 * static_cast<double>(pair.matches.size()));
  }
}

TEST(SeedBundle, SamePoseStartFindsTheTrueMotionBeforeARelief) {
  // Depth of 10 % leaves one solution, and the start leads to it.
  for (int seed = 0; seed < 10; ++seed) {
    SimulatedViewsOptions options = MakeOptions(Scene::kRelief, 0.3, seed);
    options.relief = 0.1;
    const TruePair pair(options);
    std::vector<int> all(pair.matches.size());
    std::iota(all.begin(), all.end(), 0);
    const SeedBundleResult result = SolveFromSamePose(pair.matches, all);
    ASSERT_TRUE(result.usable);
    const Rigid& found = result.geometry.views_from_left[1];
    const Rigid& truth = pair.truth.views_from_left[1];
    EXPECT_LT(DegFromRad(RotationAngle(found.rotation, truth.rotation)), 1.0);
    EXPECT_LT(DegFromRad(BaselineAngle(found.translation, truth.translation)), 5.0);
  }
}

TEST(SeedBundle, PureRotationGivesNoUsableBaseline) {
  SimulatedViewsOptions options = MakeOptions(Scene::kRoom, 0, 5);
  options.only_turn = true;
  const SimulatedViews views = SimulateViews(options);
  const std::vector<RayMatch> matches = views.Matched().Matches(views.pairs[0]);
  HypothesisOptions hypothesis_options;
  const TwoViewAnalysis analysis = AnalysePair(matches, hypothesis_options);
  EXPECT_TRUE(analysis.pure_rotation);
  EXPECT_TRUE(analysis.hypotheses.empty());
}

TEST(SeedBundle, FixedViewsStayToTheLastBitAndHoldTheScale) {
  SimulatedViewsOptions options = MakeOptions(Scene::kRoom, 0, 4);
  options.num_views = 3;
  const SimulatedViews views = SimulateViews(options);
  SeedGeometry truth;
  std::map<int, int> point_of_index;
  std::vector<SeedObservation> observations;
  const CameraProjection projection(views.cameras.at(1));
  for (uint32_t image_id = 1; image_id <= 3; ++image_id) {
    truth.views_from_left.push_back(views.TrueRelativePose(1, image_id));  // in metres
    const std::vector<Ray> rays = RaysFromKeypoints(projection, views.keypoints.at(image_id));
    for (size_t row = 0; row < rays.size(); ++row) {
      const int index = views.point_of_keypoint.at(image_id)[row];
      const Eigen::Vector3d x = views.cam_from_scene.at(1) * views.points_in_scene[index];
      if (x.z() <= 0.3) continue;
      const auto [entry, is_new] =
          point_of_index.emplace(index, static_cast<int>(truth.points.size()));
      if (is_new) truth.points.emplace_back(x.x() / x.z(), x.y() / x.z(), 1 / x.z());
      observations.push_back({static_cast<int>(image_id) - 1, entry->second, rays[row]});
    }
  }
  SeedGeometry start = truth;
  start.views_from_left[2].rotation =
      Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitX()) * truth.views_from_left[2].rotation;
  start.views_from_left[2].translation += Eigen::Vector3d(0.08, -0.05, 0.06);
  SeedBundleOptions bundle;
  bundle.num_fixed_views = 2;
  const SeedBundleResult result = AdjustSeed(start, observations, bundle);
  ASSERT_TRUE(result.usable);
  EXPECT_THAT(result.geometry.views_from_left[1], IsNearRigid(truth.views_from_left[1], 1e-15, 0));
  EXPECT_THAT(result.geometry.views_from_left[2],
              IsNearRigid(truth.views_from_left[2], 1e-6, 1e-5));
}

TEST(SeedBundle, MovesOneViewOntoItsPoints) {
  SimulatedViewsOptions options = MakeOptions(Scene::kRoom, 0, 6);
  options.num_views = 3;
  const SimulatedViews views = SimulateViews(options);
  SeedGeometry geometry;
  geometry.views_from_left = {Rigid(), views.TrueRelativePose(1, 3)};
  std::vector<SeedObservation> observations;
  const CameraProjection projection(views.cameras.at(1));
  const std::vector<Ray> rays = RaysFromKeypoints(projection, views.keypoints.at(3));
  for (size_t row = 0; row < rays.size(); ++row) {
    const int index = views.point_of_keypoint.at(3)[row];
    const Eigen::Vector3d x = views.cam_from_scene.at(1) * views.points_in_scene[index];
    if (x.z() <= 0.1) continue;
    observations.push_back({1, static_cast<int>(geometry.points.size()), rays[row]});
    geometry.points.emplace_back(x.x() / x.z(), x.y() / x.z(), 1 / x.z());
  }
  const Rigid truth = geometry.views_from_left[1];
  Rigid& start = geometry.views_from_left[1];
  start.rotation = Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY()) * start.rotation;
  start.translation += Eigen::Vector3d(0.1, 0.05, -0.1);
  EXPECT_THAT(AdjustView(geometry, 1, observations, {}), IsNearRigid(truth, 1e-6, 1e-5));
}

}  // namespace
}  // namespace roomtex
