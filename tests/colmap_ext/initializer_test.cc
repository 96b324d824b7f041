#include "colmap_ext/initializer.h"

#include <limits>

#include <gtest/gtest.h>

#include "tests/colmap_ext/simulated_views.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using Scene = SimulatedViewsOptions::Scene;

struct PoseErrors {
  double rotation_deg = 0, baseline_deg = 0;
};

PoseErrors ErrorsOfSeed(const SimulatedViews& views, const Seed& seed) {
  const uint32_t left = seed.trial.image_id1, right = seed.trial.image_id2;
  const Rigid truth = views.TrueRelativePose(left, right);
  const Rigid found = seed.pair_model.images.at(right).cam_from_model *
                      seed.pair_model.images.at(left).cam_from_model.Inverse();
  return {DegFromRad(RotationAngle(truth.rotation, found.rotation)),
          DegFromRad(BaselineAngle(truth.translation, found.translation))};
}

bool IsRight(const PoseErrors& errors) {
  return errors.rotation_deg < 2 && errors.baseline_deg < 8;
}

std::optional<Seed> FirstSeed(const SimulatedViews& views, const InitOptions& options = {}) {
  MatchedImages images = views.Matched();
  return Initializer(&images, options, 1, 0).Next();
}

TEST(TwoViewHypotheses, FindTheTrueMotionInARoom) {
  for (int seed = 0; seed < 6; ++seed) {
    SimulatedViewsOptions options;
    options.noise_px = seed % 2 == 0 ? 0.5 : 1.0;
    options.outlier_share = 0.1 * (seed % 4);
    options.distortion = seed >= 2;
    options.two_cameras = seed >= 4;
    options.random_seed = seed;
    const SimulatedViews views = SimulateViews(options);
    const TwoViewAnalysis analysis =
        AnalysePair(views.Matched().Matches(views.pairs[0]), HypothesisOptions());
    EXPECT_FALSE(analysis.degenerate);
    EXPECT_FALSE(analysis.pure_rotation);
    ASSERT_FALSE(analysis.hypotheses.empty()) << analysis.problem;
    const Rigid truth = views.TrueRelativePose(1, 2);
    const Rigid& found = analysis.hypotheses[0].right_from_left;
    EXPECT_LT(DegFromRad(RotationAngle(found.rotation, truth.rotation)), 0.6);
    EXPECT_LT(DegFromRad(BaselineAngle(found.translation, truth.translation)), 3.0);
    EXPECT_GE(analysis.num_f_inliers, 0.9 * (1 - options.outlier_share) *
                                          static_cast<double>(views.pairs[0].matches.size()));
  }
}

TEST(TwoViewHypotheses, OfAWallHoldTheTrueMotion) {
  for (int seed = 0; seed < 10; ++seed) {
    SimulatedViewsOptions options;
    options.scene = Scene::kWall;
    options.random_seed = seed;
    const SimulatedViews views = SimulateViews(options);
    const TwoViewAnalysis analysis =
        AnalysePair(views.Matched().Matches(views.pairs[0]), HypothesisOptions());
    EXPECT_GT(analysis.h_ratio, 0.9);
    const Rigid truth = views.TrueRelativePose(1, 2);
    bool holds_truth = false;
    for (const TwoViewHypothesis& hypothesis : analysis.hypotheses) {
      holds_truth |=
          DegFromRad(RotationAngle(hypothesis.right_from_left.rotation, truth.rotation)) < 2 &&
          DegFromRad(BaselineAngle(hypothesis.right_from_left.translation, truth.translation)) < 8;
    }
    EXPECT_TRUE(holds_truth) << "seed " << seed;
  }
}

TEST(TwoViewHypotheses, VerdictFollowsTheRatio) {
  SimulatedViewsOptions options;
  options.scene = Scene::kWall;
  const SimulatedViews views = SimulateViews(options);
  const std::vector<RayMatch> matches = views.Matched().Matches(views.pairs[0]);
  HypothesisOptions hypothesis_options;
  const TwoViewAnalysis wall = AnalysePair(matches, hypothesis_options);
  EXPECT_TRUE(wall.degenerate);
  EXPECT_NEAR(wall.h_ratio, 1.0 * wall.num_h_inliers / wall.num_f_inliers, 1e-12);
  hypothesis_options.degenerate_ratio = 1.0;
  EXPECT_FALSE(AnalysePair(matches, hypothesis_options).degenerate);
}

TEST(Initializer, StartsRightInARoom) {
  SimulatedViewsOptions options;
  options.num_views = 5;
  options.outlier_share = 0.2;
  options.distortion = options.two_cameras = true;
  const SimulatedViews views = SimulateViews(options);
  const auto seed = FirstSeed(views);
  ASSERT_TRUE(seed);
  EXPECT_FALSE(seed->ambiguous);
  const PoseErrors errors = ErrorsOfSeed(views, *seed);
  EXPECT_LT(errors.rotation_deg, 0.5);
  EXPECT_LT(errors.baseline_deg, 2.0);
}

TEST(Initializer, SeedViewsStandWhereTheyTrulyStood) {
  SimulatedViewsOptions options;
  options.num_views = 6;
  const SimulatedViews views = SimulateViews(options);
  const auto seed = FirstSeed(views);
  ASSERT_TRUE(seed);
  ASSERT_GE(seed->poses.images.size(), 4u);
  const uint32_t left = seed->trial.image_id1;
  const double scale = views.TrueRelativePose(left, seed->trial.image_id2).translation.norm();
  for (const auto& [image_id, image] : seed->poses.images) {
    Rigid found = image.cam_from_model;
    found.translation *= scale;
    EXPECT_THAT(found, IsNearRigid(views.TrueRelativePose(left, image_id), 0.01, 0.03));
  }
}

TEST(Initializer, PairModelIsWholeAndHoldsTogether) {
  SimulatedViewsOptions options;
  options.num_views = 3;
  const SimulatedViews views = SimulateViews(options);
  const auto seed = FirstSeed(views);
  ASSERT_TRUE(seed);
  SparseModel model = seed->pair_model;
  ASSERT_EQ(model.images.size(), 2u);
  EXPECT_GT(model.points.size(), 50u);
  for (const auto& [image_id, image] : model.images) {
    EXPECT_EQ(image.points2d.size(), views.keypoints.at(image_id).size());
    EXPECT_EQ(image.name, views.images.at(image_id).name);
  }
  size_t num_tracked = 0;
  for (const auto& [point_id, point] : model.points) {
    ASSERT_EQ(point.track.size(), 2u);
    for (const TrackElement& element : point.track) {
      EXPECT_EQ(model.images.at(element.image_id).point3d_ids[element.point2d_index], point_id);
      ++num_tracked;
    }
  }
  EXPECT_EQ(num_tracked, 2 * model.points.size());
  EXPECT_LT(UpdateReprojectionErrors(&model).rms_px, 1.0);
}

// Two views of a wall have two solutions; the third one decides. Both lenses and noises of
// docs/colmap.md.
TEST(Initializer, IsRightBeforeAWall) {
  struct Lens {
    double field_of_view_deg, baseline, noise_px;
  };
  for (const Lens& lens : {Lens{58, 0.5, 0.5}, Lens{58, 0.5, 1.0}, Lens{28, 0.35, 0.5}}) {
    int num_right = 0;
    constexpr int kNumSets = 8;
    for (int seed = 0; seed < kNumSets; ++seed) {
      SimulatedViewsOptions options;
      options.scene = Scene::kWall;
      options.num_views = 4;
      options.field_of_view_deg = lens.field_of_view_deg;
      options.baseline = lens.baseline;
      options.noise_px = lens.noise_px;
      options.random_seed = 100 + seed;
      const SimulatedViews views = SimulateViews(options);
      const auto found = FirstSeed(views);
      ASSERT_TRUE(found);
      if (IsRight(ErrorsOfSeed(views, *found))) {
        ++num_right;
      } else {
        EXPECT_TRUE(found->ambiguous) << "a wrong seed must not pass as certain";
      }
    }
    EXPECT_EQ(num_right, kNumSets);
  }
}

TEST(Initializer, NeverBelievesTwoViewsOfAWall) {
  int num_seeds = 0;
  for (int seed = 0; seed < 12; ++seed) {
    SimulatedViewsOptions options;
    options.scene = Scene::kWall;
    options.random_seed = seed;
    const auto found = FirstSeed(SimulateViews(options));
    if (!found) continue;
    ++num_seeds;
    EXPECT_TRUE(found->ambiguous) << "seed " << seed;
  }
  EXPECT_GE(num_seeds, 8);
}

TEST(Initializer, BelievesTwoViewsOfARoom) {
  for (int seed = 0; seed < 12; ++seed) {
    SimulatedViewsOptions options;
    options.random_seed = seed;
    options.outlier_share = 0.1 * (seed % 4);
    const SimulatedViews views = SimulateViews(options);
    const auto found = FirstSeed(views);
    ASSERT_TRUE(found) << "seed " << seed;
    EXPECT_FALSE(found->ambiguous) << "seed " << seed;
    EXPECT_TRUE(IsRight(ErrorsOfSeed(views, *found))) << "seed " << seed;
  }
}

TEST(Initializer, NeverStartsFromATurnOnTheSpot) {
  SimulatedViewsOptions options;
  options.only_turn = true;
  options.num_views = 3;
  const SimulatedViews views = SimulateViews(options);
  MatchedImages images = views.Matched();
  Initializer initializer(&images, {}, 1, 0);
  EXPECT_FALSE(initializer.Next());
  ASSERT_EQ(initializer.Rejected().size(), 3u);
  for (const PairTrial& trial : initializer.Rejected()) {
    EXPECT_NE(trial.problem.find("turned"), std::string::npos) << trial.problem;
  }
}

TEST(Initializer, GivesTheNextPairWhenAskedAgain) {
  SimulatedViewsOptions options;
  options.num_views = 4;
  const SimulatedViews views = SimulateViews(options);
  MatchedImages images = views.Matched();
  Initializer initializer(&images, {}, 1, 0);
  std::set<std::pair<uint32_t, uint32_t>> pairs;
  int count = 0;
  while (const auto seed = initializer.Next()) {
    pairs.insert({seed->trial.image_id1, seed->trial.image_id2});
    EXPECT_TRUE(IsRight(ErrorsOfSeed(views, *seed)));
    ++count;
  }
  EXPECT_EQ(count, static_cast<int>(pairs.size())) << "no pair comes twice";
  EXPECT_EQ(pairs.size() + initializer.Rejected().size(), views.pairs.size());
  EXPECT_GE(count, 3);
}

TEST(Initializer, StartsFromTheImagesItIsTold) {
  SimulatedViewsOptions options;
  options.num_views = 5;
  const SimulatedViews views = SimulateViews(options);
  InitOptions init;
  init.image_name1 = "view_003.jpg";
  auto seed = FirstSeed(views, init);
  ASSERT_TRUE(seed);
  EXPECT_TRUE(seed->trial.image_id1 == 4 || seed->trial.image_id2 == 4);
  init.image_name2 = "view_001.jpg";
  seed = FirstSeed(views, init);
  ASSERT_TRUE(seed);
  EXPECT_EQ(seed->trial.image_id1, 2u);
  EXPECT_EQ(seed->trial.image_id2, 4u);
}

TEST(Initializer, ThresholdsOfItsOptionsHold) {
  SimulatedViewsOptions options;
  options.num_views = 3;
  const SimulatedViews views = SimulateViews(options);
  InitOptions init;
  init.min_num_inliers = 100000;
  EXPECT_FALSE(FirstSeed(views, init));
  init = {};
  init.min_tri_angle_deg = 80;
  EXPECT_FALSE(FirstSeed(views, init));
  init = {};
  init.max_third_views = 0;
  const auto seed = FirstSeed(views, init);
  ASSERT_TRUE(seed);
  EXPECT_EQ(seed->poses.images.size(), 2u);
  init = {};
  init.max_error_px = 0.05;  // far below the noise: hardly a match is left
  EXPECT_FALSE(FirstSeed(views, init));
}

TEST(Initializer, DoesNotDependOnTheNumberOfThreads) {
  SimulatedViewsOptions options;
  options.num_views = 5;
  options.scene = Scene::kRelief;
  const SimulatedViews views = SimulateViews(options);
  MatchedImages images = views.Matched();
  const auto one = Initializer(&images, {}, 1, 3).Next();
  const auto four = Initializer(&images, {}, 4, 3).Next();
  ASSERT_TRUE(one && four);
  ASSERT_EQ(one->trial.image_id1, four->trial.image_id1);
  ASSERT_EQ(one->trial.image_id2, four->trial.image_id2);
  const Rigid& a = one->pair_model.images.at(one->trial.image_id2).cam_from_model;
  const Rigid& b = four->pair_model.images.at(four->trial.image_id2).cam_from_model;
  EXPECT_THAT(a, IsNearRigid(b, 0.0, 0.0));
}

TEST(Initializer, ListsEveryBadOption) {
  InitOptions options;
  EXPECT_TRUE(options.Problems().empty());
  options.min_num_inliers = 3;
  options.keypoint_noise_px = std::numeric_limits<double>::quiet_NaN();
  options.min_tri_angle_deg = 0;
  options.max_pairs = 0;
  EXPECT_EQ(options.Problems().size(), 4u);
}

}  // namespace
}  // namespace roomtex
