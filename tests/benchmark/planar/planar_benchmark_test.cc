// A few sets of every row of the benchmark, without COLMAP.

#include <gtest/gtest.h>

#include "core/parallel.h"
#include "tests/benchmark/planar/in_process_table.h"
#include "tests/benchmark/planar/pose_judge.h"
#include "tests/benchmark/planar/wilson_interval.h"

namespace roomtex {
namespace {

// Every row, outlier share, number of views and of matches is met.
TEST(PlanarBenchmark, SeedsAreRightAndNeverWrongWithoutSaying) {
  constexpr int kSetsPerRow = 2;
  const std::vector<GridRow> rows = GridRows();
  std::vector<SetOutcome> outcomes(kSetsPerRow * rows.size());
  ParallelFor(2, 0, static_cast<int>(outcomes.size()), [&](int i) {
    const std::vector<PlanarSet>& cells = rows[i / kSetsPerRow].cells;
    outcomes[i] = RunInProcess(cells[(5 * i) % cells.size()], 100 + i % kSetsPerRow, false);
  });
  OutcomeCounts counts;
  for (const SetOutcome& outcome : outcomes) {
    counts.Add(outcome);
    EXPECT_NE(outcome.ours, SeedOutcome::kWrong) << outcome.set << " --seed " << outcome.seed;
  }
  EXPECT_EQ(counts.num_sets, 48);
  EXPECT_GE(counts.identifiable, 0.9 * counts.num_sets);
  EXPECT_GE(counts.identifiable_right, 0.98 * counts.identifiable);
}

// The scatter of the optimum over many sets is the one that the bound predicts.
TEST(PlanarBenchmark, UncertaintyIsThatOfTheOptimum) {
  double error2 = 0, bound2 = 0;
  const PlanarSet set = FindSet("corner, 28 deg, 1 px, 10 % outliers, 3 views, few");
  for (int seed = 0; seed < 40; ++seed) {
    const SimulatedViews views = MakeSet(set, seed);
    MatchedImages images = views.Matched();
    const DatabasePair& pair = images.pairs()[0];
    const PairVerdict verdict = JudgePair(views, set.noise_px, &images, pair, Rigid(), 1);
    error2 += std::pow(verdict.optimum_from_truth.baseline_deg, 2);
    bound2 += std::pow(verdict.uncertainty.baseline_deg, 2);
  }
  // The error has two components, and the bound is that of the larger one.
  EXPECT_GT(error2, 0.6 * bound2);
  EXPECT_LT(error2, 2.4 * bound2);
}

SparseModel TrueModel(const SimulatedViews& views) {
  SparseModel model;
  model.cameras = views.cameras;
  for (const auto& [image_id, image] : views.images) {
    SparseImage& out = model.images[image_id];
    out.image_id = image_id;
    out.camera_id = image.camera_id;
    out.cam_from_model = views.cam_from_scene.at(image_id);
    out.points2d = views.keypoints.at(image_id);
    out.point3d_ids.assign(out.points2d.size(), kInvalidPoint3dId);
    for (size_t row = 0; row < out.points2d.size(); ++row) {
      const int point = views.point_of_keypoint.at(image_id)[row];
      out.point3d_ids[row] = point;
      model.points[point].x_in_model = views.points_in_scene[point];
      model.points[point].track.push_back({image_id, static_cast<uint32_t>(row)});
    }
  }
  return model;
}

TEST(PlanarBenchmark, JudgeAcceptsTheTruthInAnyFrameOnly) {
  const SimulatedViews views =
      MakeSet(FindSet("room, 58 deg, 0.5 px, 10 % outliers, 4 views, many"), 3);
  SparseModel model = TrueModel(views);
  Similarity moved;
  moved.scale = 0.2;
  moved.rotation = Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, -2, 0.5).normalized());
  moved.translation = {3, -7, 1};
  TransformModel(moved, &model);
  const ModelVerdict right = JudgeModel(model, views);
  EXPECT_TRUE(right.poses_right);
  EXPECT_LT(right.centre_errors.back(), 1e-9);
  EXPECT_LT(right.rotation_errors_deg.back(), 1e-5);
  EXPECT_LT(right.median_point_error, 1e-9);

  SparseModel mirrored = model;  // about the plane x = 0 of its frame
  for (auto& [point_id, point] : mirrored.points) point.x_in_model.x() *= -1;
  for (auto& [image_id, image] : mirrored.images) {
    Eigen::Vector3d centre = image.cam_from_model.TargetOriginInSource();
    centre.x() *= -1;
    image.cam_from_model.translation = image.cam_from_model.rotation * -centre;
  }
  EXPECT_FALSE(JudgeModel(mirrored, views).poses_right);

  SparseModel turned = model;  // one view looks elsewhere
  Rigid turn;
  turn.rotation = Eigen::AngleAxisd(0.09, Eigen::Vector3d::UnitY());
  turned.images.begin()->second.cam_from_model =
      turn * turned.images.begin()->second.cam_from_model;
  EXPECT_FALSE(JudgeModel(turned, views).poses_right);

  SparseModel bent = model;  // the wall only
  for (auto& [point_id, point] : bent.points) point.x_in_model += 0.05 * Eigen::Vector3d::Random();
  EXPECT_FALSE(JudgeModel(bent, views).poses_right);
}

TEST(PlanarBenchmark, WilsonIntervalIsThatOfTheTables) {
  EXPECT_NEAR(WilsonInterval(50, 50).low, 0.9286, 1e-4);  // known values
  EXPECT_NEAR(WilsonInterval(18, 30).low, 0.4232, 1e-4);
  EXPECT_NEAR(WilsonInterval(18, 30).high, 0.7541, 1e-4);
}

}  // namespace
}  // namespace roomtex
