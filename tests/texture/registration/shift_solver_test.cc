#include "texture/registration/shift_solver.h"

#include <gtest/gtest.h>

namespace roomtex {
namespace {

// Two photos that look at one wall alike; only the first two numbers of a pose move anything.
PlaceInPhoto Place(int photo, const PhotoWarp& lattice, float x, float y) {
  PlaceInPhoto place;
  place.photo = photo;
  place.by_pose(0, 0) = place.by_pose(1, 1) = 1;
  lattice.NodesAt(x, y, &place.nodes, &place.node_weights);
  return place;
}

MeasuredShift Between(int photo, const PhotoWarp& lattice, float x, float y,
                      const Eigen::Vector2f& shift) {
  MeasuredShift measured;
  measured.terms.push_back({Place(photo, lattice, x, y), Eigen::Matrix2f::Identity()});
  measured.terms.push_back({Place(1 - photo, lattice, x, y), -Eigen::Matrix2f::Identity()});
  measured.shift = shift;
  measured.information = 100 * Eigen::Matrix2f::Identity();
  return measured;
}

class ShiftSolver : public testing::Test {
 protected:
  // The second photo shows everything `shift` away from where the first one does.
  std::vector<MeasuredShift> Measure(const Eigen::Vector2f& shift) const {
    std::vector<MeasuredShift> shifts;
    for (int i = 0; i < 20; ++i) {
      const float x = 5.0f * static_cast<float>(i % 5), y = 6.0f * static_cast<float>(i / 5);
      shifts.push_back(Between(0, lattice_, x, y, -shift));
      shifts.push_back(Between(1, lattice_, x, y, shift));
    }
    return shifts;
  }
  PhotoWarp lattice_{30, 20, 10};
};

TEST_F(ShiftSolver, TwoPhotosMeetHalfWay) {
  const std::vector<PhotoStep> steps = SolveShifts(Measure({0.8f, -0.4f}), {{}, {}}, 3);
  EXPECT_NEAR(steps[0].pose[0], -0.4, 1e-3);
  EXPECT_NEAR(steps[0].pose[1], 0.2, 1e-3);
  EXPECT_NEAR(steps[1].pose[0], 0.4, 1e-3);
  EXPECT_TRUE(steps[0].warp.empty());
}

TEST_F(ShiftSolver, AFixedPhotoStaysAndTheOtherComesToIt) {
  std::vector<PhotoPrior> priors(2);
  priors[0].is_free = false;
  const std::vector<PhotoStep> steps = SolveShifts(Measure({0.8f, 0}), priors, 3);
  EXPECT_TRUE(steps[0].pose.isZero());
  EXPECT_NEAR(steps[1].pose[0], 0.8, 2e-3);
}

TEST_F(ShiftSolver, WhatIsHeldTightlyMovesLess) {
  std::vector<PhotoPrior> priors(2);
  priors[0].pose_sigma.setConstant(1e-4);
  const std::vector<PhotoStep> steps = SolveShifts(Measure({0.8f, 0}), priors, 3);
  EXPECT_NEAR(steps[0].pose[0], 0, 1e-3);
  EXPECT_NEAR(steps[1].pose[0], 0.8, 5e-3);
}

TEST_F(ShiftSolver, LiesDoNotCount) {
  std::vector<MeasuredShift> shifts = Measure({0.5f, 0});
  for (size_t i = 0; i < shifts.size(); i += 5) shifts[i].shift = {30, -25};
  const std::vector<PhotoStep> steps = SolveShifts(shifts, {{}, {}}, 1);
  EXPECT_NEAR(steps[1].pose[0] - steps[0].pose[0], 0.5, 0.02);
}

TEST_F(ShiftSolver, AWarpTakesUpWhatNoPoseCan) {
  std::vector<PhotoPrior> priors(2);
  priors[0].is_free = false;
  priors[1].warp = &lattice_;
  std::vector<MeasuredShift> shifts;
  for (int i = 0; i < 600; ++i) {
    const float x = static_cast<float>(i % 30), y = static_cast<float>(i / 30);
    shifts.push_back(Between(1, lattice_, x, y, {0.02f * (x - 15), 0}));
  }
  const PhotoStep step = SolveShifts(shifts, priors, 3)[1];
  ASSERT_EQ(step.warp.size(), static_cast<size_t>(lattice_.num_nodes()));
  PhotoWarp warp = lattice_;
  for (int n = 0; n < warp.num_nodes(); ++n) warp.Shift(n) = step.warp[n];
  for (const float x : {2.0f, 15.0f, 28.0f}) {
    EXPECT_NEAR(warp.At(x, 10).x() + step.pose[0], 0.02 * (x - 15), 0.03) << x;
  }
}

TEST_F(ShiftSolver, NothingMeasuredMovesNothing) {
  const std::vector<PhotoStep> steps = SolveShifts({}, {{}, {}}, 1);
  EXPECT_TRUE(steps[0].pose.isZero());
  EXPECT_TRUE(SolveShifts({}, {}, 1).empty());
}

}  // namespace
}  // namespace roomtex
