#include "colmap_ext/model_check.h"

#include <gtest/gtest.h>

#include "colmap_ext/seed_model.h"
#include "colmap_ext/third_view.h"
#include "tests/colmap_ext/simulated_views.h"

namespace roomtex {
namespace {

using Scene = SimulatedViewsOptions::Scene;

SimulatedViews Views(Scene scene, int seed) {
  SimulatedViewsOptions options;
  options.scene = scene;
  options.num_views = 5;
  options.random_seed = seed;
  options.noise_px = seed % 2 == 0 ? 0.5 : 1.0;
  return SimulateViews(options);
}

TEST(ModelCheck, TrustsTheTruth) {
  for (const Scene scene : {Scene::kRoom, Scene::kWall, Scene::kRelief}) {
    for (int seed = 0; seed < 8; ++seed) {
      const SimulatedViews views = Views(scene, seed);
      MatchedImages images = views.Matched();
      const SparseModel model = MakePoseModel(images, views.cam_from_scene);
      const ModelCheck check = CheckModel(&images, model, {1, 2}, {}, 2);
      EXPECT_GE(check.num_pairs, 3);
      EXPECT_TRUE(check.trusted) << "seed " << seed << ": " << check.contradicting.size() << " of "
                                 << check.num_pairs;
    }
  }
}

// The model that a wall's second solution leads to: every view is placed, and wrong.
TEST(ModelCheck, DoesNotTrustTheSecondSolutionOfAWall) {
  int num_tested = 0;
  for (int seed = 0; seed < 30; ++seed) {
    SimulatedViewsOptions options;  // a narrow lens and few points: the two are hard to tell apart
    options.scene = Scene::kWall;
    options.field_of_view_deg = 28;
    options.baseline = 0.3;
    options.num_views = 5;
    options.num_points = 150;
    options.random_seed = seed;
    const SimulatedViews views = SimulateViews(options);
    MatchedImages images = views.Matched();
    const DatabasePair& pair = images.pairs()[0];
    const std::vector<RayMatch> matches = images.Matches(pair);
    const TwoViewAnalysis analysis = AnalysePair(matches, {});
    const ThirdViewOptions third;
    const std::vector<ThirdView> others = images.FindThirdViews(pair, matches, 12, 4);
    const ThirdViewDecision decision =
        DecideByThirdViews(matches, analysis.hypotheses, others, third);
    const Rigid truth = views.TrueRelativePose(1, 2);
    for (const HypothesisVerdict& verdict : decision.verdicts) {
      if (RotationAngle(verdict.right_from_left.rotation, truth.rotation) < RadFromDeg(3)) continue;
      std::map<uint32_t, Rigid> poses = {{1, Rigid()}, {2, verdict.right_from_left}};
      for (size_t k = 0; k < others.size(); ++k) {
        if (verdict.views_from_left[k]) poses[others[k].image_id] = *verdict.views_from_left[k];
      }
      if (poses.size() < 3) continue;
      ++num_tested;
      const ModelCheck check = CheckModel(&images, MakePoseModel(images, poses), {1, 2}, {}, 2);
      EXPECT_FALSE(check.trusted) << "seed " << seed << ": " << check.contradicting.size() << " of "
                                  << check.num_pairs;
    }
  }
  EXPECT_GE(num_tested, 3);
}

TEST(ModelCheck, DoesNotTrustABentModel) {
  for (int seed = 0; seed < 6; ++seed) {
    const SimulatedViews views = Views(Scene::kRelief, seed);
    MatchedImages images = views.Matched();
    std::map<uint32_t, Rigid> poses = views.cam_from_scene;
    for (auto& [image_id, pose] : poses) {  // turns and drifts from photo to photo
      Rigid bend;
      bend.rotation = Eigen::AngleAxisd(0.12 * image_id, Eigen::Vector3d::UnitY());
      pose = bend * pose;
    }
    const ModelCheck check = CheckModel(&images, MakePoseModel(images, poses), {1, 2}, {}, 2);
    EXPECT_FALSE(check.trusted) << "seed " << seed << ": " << check.contradicting.size() << " of "
                                << check.num_pairs;
  }
}

// The misplaced photo's own pairs are all that tells: one photo in eight, 15 cm off at 3 m.
TEST(ModelCheck, NamesThePhotoThatStandsInTheWrongPlace) {
  for (int seed = 0; seed < 6; ++seed) {
    SimulatedViewsOptions options;
    options.scene = seed % 2 == 0 ? Scene::kRoom : Scene::kWall;
    options.num_views = 8;
    options.baseline = 0.25;
    options.outlier_share = 0.1 * (seed % 4);
    options.random_seed = seed;
    const SimulatedViews views = SimulateViews(options);
    MatchedImages images = views.Matched();
    const ModelCheck truth =
        CheckModel(&images, MakePoseModel(images, views.cam_from_scene), {1, 2}, {}, 2);
    EXPECT_TRUE(truth.trusted) << "seed " << seed;
    EXPECT_TRUE(truth.doubtful.empty()) << "seed " << seed;
    EXPECT_EQ(truth.support.size(), 8u);

    std::map<uint32_t, Rigid> poses = views.cam_from_scene;
    poses.at(5).translation += Eigen::Vector3d(0.05, 0.12, 0.07);
    const ModelCheck check = CheckModel(&images, MakePoseModel(images, poses), {1, 2}, {}, 2);
    EXPECT_EQ(check.doubtful, std::vector<uint32_t>{5}) << "seed " << seed;
    EXPECT_FALSE(check.trusted);
  }
}

}  // namespace
}  // namespace roomtex
