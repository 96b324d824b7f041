#include "colmap_ext/view_chaining.h"

#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "tests/colmap_ext/wall_sequence.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using Scene = SimulatedViewsOptions::Scene;

Rigid SomePose(double seed) {
  Rigid pose;
  pose.rotation = Eigen::AngleAxisd(0.3 + seed, Eigen::Vector3d(1, seed, 0.2).normalized());
  pose.translation = Eigen::Vector3d(0.4, -seed, 1.5);
  return pose;
}

TEST(AverageRatios, IsNotMovedByMismatches) {
  const RatioAverage average = AverageRatios({2.0, 2.02, 1.98, 2.01, 1.99, 7.0, 0.3});
  EXPECT_NEAR(average.scale, 2.0, 1e-4);
  EXPECT_LT(average.spread, 0.02);
  EXPECT_GT(AverageRatios({1.0, 1.5, 2.2, 3.1, 0.6}).spread, 0.3);
}

TEST(AverageRatios, OfInversesIsTheInverse) {
  const std::vector<double> ratios = {0.4, 0.44, 0.41, 0.39, 2.0};
  std::vector<double> inverses;
  for (const double ratio : ratios) inverses.push_back(1 / ratio);
  EXPECT_NEAR(AverageRatios(ratios).scale * AverageRatios(inverses).scale, 1, 1e-12);
}

TEST(ChainPose, IsThesis622) {
  const Rigid left_from_model = SomePose(0.1), right_from_left = SomePose(0.7);
  const double scale = 2.5;
  const Eigen::Matrix3d r = left_from_model.rotation.toRotationMatrix(),
                        r2 = right_from_left.rotation.toRotationMatrix();
  const Rigid chained = ChainPose(left_from_model, right_from_left, scale);
  EXPECT_TRUE(chained.rotation.toRotationMatrix().isApprox(r2 * r, 1e-12));
  EXPECT_TRUE(chained.translation.isApprox(
      r2 * left_from_model.translation + scale * right_from_left.translation, 1e-12));
}

// The model of some of the views at true poses (or those given), with true points where at least
// two of them match.
SparseModel ModelOf(const SimulatedViews& views, const std::map<uint32_t, Rigid>& poses) {
  SparseModel model;
  model.cameras = views.cameras;
  for (const auto& [image_id, pose] : poses) {
    SparseImage& image = model.images[image_id];
    image.image_id = image_id;
    image.camera_id = views.images.at(image_id).camera_id;
    image.name = views.images.at(image_id).name;
    image.cam_from_model = pose;
    image.points2d = views.keypoints.at(image_id);
    image.point3d_ids.assign(image.points2d.size(), kInvalidPoint3dId);
  }
  for (const DatabasePair& pair : views.pairs) {
    if (poses.count(pair.image_id1) == 0 || poses.count(pair.image_id2) == 0) continue;
    for (const Eigen::Vector2i& match : pair.matches) {
      const int point = views.point_of_keypoint.at(pair.image_id1)[match.x()];
      if (views.point_of_keypoint.at(pair.image_id2)[match.y()] != point) continue;
      const auto add = [&](uint32_t image_id, int row) {
        uint64_t& id = model.images.at(image_id).point3d_ids[row];
        if (id != kInvalidPoint3dId) return;
        id = static_cast<uint64_t>(point) + 1;
        model.points[id].x_in_model = views.points_in_scene[point];
        model.points[id].track.push_back({image_id, static_cast<uint32_t>(row)});
      };
      add(pair.image_id1, match.x());
      add(pair.image_id2, match.y());
    }
  }
  return model;
}

std::map<uint32_t, Rigid> TruePoses(const SimulatedViews& views, std::set<uint32_t> without) {
  std::map<uint32_t, Rigid> poses = views.cam_from_scene;
  for (const uint32_t image_id : without) poses.erase(image_id);
  return poses;
}

std::map<uint32_t, Rigid> PosesOf(const SparseModel& model) {
  std::map<uint32_t, Rigid> poses;
  for (const auto& [image_id, image] : model.images) poses[image_id] = image.cam_from_model;
  return poses;
}

MapperResult ResultOf(SparseModel model) {
  MapperResult result;
  result.folder = "somewhere";
  result.model = std::move(model);
  return result;
}

TEST(ViewChainer, PlacesAViewNearTheTruthFromFewCommonPoints) {
  for (const Scene scene : {Scene::kRelief, Scene::kWall}) {
    for (int seed = 0; seed < 4; ++seed) {
      const SimulatedViews views = WeakWallSequence(scene, seed);
      MatchedImages images = views.Matched();
      ViewChainer chainer(&images, {}, {}, 2);
      for (const uint32_t image_id : {1u, 4u, 8u}) {
        const SparseModel model = ModelOf(views, TruePoses(views, {image_id}));
        const std::vector<ChainedView> placed = chainer.Place(model, {});
        ASSERT_EQ(placed.size(), 1u);
        SCOPED_TRACE("seed " + std::to_string(seed) + ", view " + std::to_string(image_id));
        ASSERT_EQ(placed[0].problem, "");
        EXPECT_GE(placed[0].num_common_points, 5);
        EXPECT_LT(placed[0].scale_spread, 0.05);
        const Rigid& truth = views.cam_from_scene.at(image_id);
        EXPECT_LT(RotationAngle(placed[0].cam_from_model.rotation, truth.rotation), 0.01);
        EXPECT_LT(
            (placed[0].cam_from_model.TargetOriginInSource() - truth.TargetOriginInSource()).norm(),
            0.03);
      }
    }
  }
}

TEST(ViewChainer, GivesTheSameInAnotherFrameAndScale) {
  const SimulatedViews views = WeakWallSequence(Scene::kRelief, 2);
  MatchedImages images = views.Matched();
  SparseModel model = ModelOf(views, TruePoses(views, {1}));
  const ChainedView placed = ViewChainer(&images, {}, {}, 1).Place(model, {})[0];
  Similarity moved_from_model;
  moved_from_model.scale = 7;
  moved_from_model.rotation = Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, 3).normalized());
  moved_from_model.translation = {4, -5, 6};
  TransformModel(moved_from_model, &model);
  const ChainedView moved = ViewChainer(&images, {}, {}, 2).Place(model, {})[0];
  EXPECT_EQ(moved.num_common_points, placed.num_common_points);
  EXPECT_THAT(moved.cam_from_model,
              IsNearRigid(CamFromScan(placed.cam_from_model, moved_from_model), 1e-4, 1e-5));
}

TEST(ViewChainer, RejectsAViewWhoseTwoViewGeometryIsWrong) {
  for (const Scene scene : {Scene::kRelief, Scene::kWall}) {
    for (int seed = 0; seed < 4; ++seed) {
      const SimulatedViews views = WithGhostView(WeakWallSequence(scene, seed), 8);
      MatchedImages images = views.Matched();
      const SparseModel model = ModelOf(views, TruePoses(views, {8}));
      ChainOptions options;
      options.min_num_inliers = 30;  // 7-8 only, which is wrong; 6-8 has 20 matches, and is right
      const std::vector<ChainedView> placed = ViewChainer(&images, options, {}, 2).Place(model, {});
      ASSERT_EQ(placed.size(), 1u);
      EXPECT_NE(placed[0].problem, "") << "seed " << seed;
    }
  }
}

TEST(ViewChainer, TrustsTheNeighbourWhoseGeometryAgreesWithTheModel) {
  for (int seed = 0; seed < 4; ++seed) {  // 1-2 is wrong, 1-3 is right
    const SimulatedViews views = WithGhostView(WeakWallSequence(Scene::kRelief, seed), 1);
    MatchedImages images = views.Matched();
    const SparseModel model = ModelOf(views, TruePoses(views, {1}));
    const ChainedView placed = ViewChainer(&images, {}, {}, 2).Place(model, {})[0];
    ASSERT_EQ(placed.problem, "") << "seed " << seed;
    EXPECT_EQ(placed.neighbor_id, 3u);
    EXPECT_LT((placed.cam_from_model.TargetOriginInSource() -
               views.cam_from_scene.at(1).TargetOriginInSource())
                  .norm(),
              0.05);
  }
}

TEST(ViewChainer, RejectsAViewWithTooFewCommonPoints) {
  const SimulatedViews views = WeakWallSequence(Scene::kRelief, 0);
  MatchedImages images = views.Matched();
  const SparseModel model = ModelOf(views, TruePoses(views, {1}));
  ChainOptions strict;
  strict.min_common_points = 60;
  const ChainedView placed = ViewChainer(&images, strict, {}, 1).Place(model, {})[0];
  EXPECT_NE(placed.problem.find("points in common"), std::string::npos) << placed.problem;
}

TEST(ViewChainer, ChainsRoundAfterRound) {
  const SimulatedViews views = WeakWallSequence(Scene::kRelief, 1);
  MatchedImages images = views.Matched();
  ViewChainer chainer(&images, {}, {}, 2);
  int num_rounds = 0;
  const ChainResult chain = chainer.Run(
      ResultOf(ModelOf(views, TruePoses(views, {5, 6, 7, 8}))), [&](const SparseModel& poses) {
        ++num_rounds;
        for (const auto& [image_id, image] : poses.images) EXPECT_TRUE(image.points2d.empty());
        std::map<uint32_t, Rigid> adjusted;  // what a bundle adjustment would give
        for (const auto& [image_id, pose] : PosesOf(poses)) {
          adjusted[image_id] = views.cam_from_scene.at(image_id);
        }
        return ResultOf(ModelOf(views, adjusted));
      });
  EXPECT_EQ(chain.result.model.images.size(), 8u);
  EXPECT_EQ(chain.chained.size(), 4u);
  EXPECT_TRUE(chain.reasons.empty());
  EXPECT_GE(num_rounds, 2);
}

TEST(ViewChainer, TakesAViewBackWhenTheErrorsJump) {
  const SimulatedViews views = WeakWallSequence(Scene::kRelief, 1);
  MatchedImages images = views.Matched();
  Rigid bend;
  bend.rotation = Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitX());
  bend.translation = Eigen::Vector3d(0, 0.05, 0.05);
  // An adjustment that tears the new view off its pair, and one that bends its neighbour instead.
  for (const uint32_t bent_id : {1u, 2u}) {
    ViewChainer chainer(&images, {}, {}, 2);
    const ChainResult chain = chainer.Run(ResultOf(ModelOf(views, TruePoses(views, {1, 8}))),
                                          [&](const SparseModel& poses) {
                                            std::map<uint32_t, Rigid> adjusted = PosesOf(poses);
                                            if (adjusted.count(1) > 0)
                                              adjusted.at(bent_id) = bend * adjusted.at(bent_id);
                                            return ResultOf(ModelOf(views, adjusted));
                                          });
    EXPECT_EQ(chain.result.model.images.count(1), 0u);
    EXPECT_EQ(chain.result.model.images.count(8), 1u) << "the other one holds";
    EXPECT_EQ(chain.chained.count(8), 1u);
    ASSERT_EQ(chain.reasons.count(1), 1u);
    EXPECT_THAT(chain.result.model.images.at(2).cam_from_model,
                IsNearRigid(views.cam_from_scene.at(2), 1e-9, 1e-9));
  }
}

TEST(ViewChainer, KeepsTheModelWhenTheAdjustmentFails) {
  const SimulatedViews views = WeakWallSequence(Scene::kRelief, 1);
  MatchedImages images = views.Matched();
  const ChainResult chain =
      ViewChainer(&images, {}, {}, 1)
          .Run(ResultOf(ModelOf(views, TruePoses(views, {1, 8}))), [](const SparseModel&) {
            MapperResult failed;
            failed.problem = "out of luck";
            return failed;
          });
  EXPECT_EQ(chain.result.model.images.size(), 6u);
  EXPECT_EQ(chain.result.folder, "somewhere");
  EXPECT_EQ(chain.result.problem, "");
  EXPECT_EQ(chain.reasons.at(1), "out of luck");
  EXPECT_EQ(chain.reasons.at(8), "out of luck");
}

}  // namespace
}  // namespace roomtex
