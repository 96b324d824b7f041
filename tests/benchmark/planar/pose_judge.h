#pragma once
// Right or wrong, by the simulated truth.

#include "colmap_ext/initializer.h"
#include "colmap_ext/sparse_model.h"
#include "tests/benchmark/planar/motion_uncertainty.h"
#include "tests/colmap_ext/simulated_views.h"

namespace roomtex {

// A pair is right within these of its true motion. Where noise allows no estimate to be that good,
// the limit of the baseline is three standard deviations of the best one (Cramer-Rao bound), up to
// kMaxUncertainBaselineDeg; the other solution of a wall is several times as far away.
inline constexpr double kMaxPairRotationDeg = 3, kMaxPairBaselineDeg = 5;
inline constexpr double kMaxUncertainBaselineDeg = 10;

struct MotionErrors {
  double rotation_deg = 0, baseline_deg = 0;  // 3D angle, angle of the baselines' directions
};
MotionErrors CompareMotions(const Rigid& a, const Rigid& b);

struct PairVerdict {
  MotionErrors from_truth;
  MotionErrors from_optimum;        // where bundle adjustment ends that starts at the truth
  MotionErrors optimum_from_truth;  // what that one makes of the noise
  MotionUncertainty uncertainty;    // Cramer-Rao bound at the truth

  // Degrees.
  double BaselineLimit() const;
  bool Right() const { return Within(from_truth) || Within(from_optimum); }
  // By the fixed limits and the truth alone, whatever noise allows.
  bool StrictlyRight() const {
    return from_truth.rotation_deg < kMaxPairRotationDeg &&
           from_truth.baseline_deg < kMaxPairBaselineDeg;
  }
  // The keypoints allow an answer within the limits: three standard deviations are not more, and
  // the optimum itself holds them.
  bool Identifiable() const;

 private:
  bool Within(const MotionErrors& errors) const {
    return errors.rotation_deg < kMaxPairRotationDeg && errors.baseline_deg < BaselineLimit();
  }
};
// By the pair's right matches, and what up to max_third_views further views see of them (as the
// initialiser takes its third views). noise_px: of the simulation.
PairVerdict JudgePair(const SimulatedViews& views, double noise_px, MatchedImages* images,
                      const DatabasePair& pair, const Rigid& right_from_left, int max_third_views);

struct ModelVerdict {
  size_t num_registered = 0;
  // Every registered view stands and looks right and the points lie where they are.
  bool poses_right = false;
  std::vector<double> centre_errors;           // metres, ascending; one per view
  std::vector<double> rotation_errors_deg;     // degrees, ascending; one per view
  double max_relative_rotation_error_deg = 0;  // degrees, of any two views
  double median_point_error = 0;               // metres
  double mean_reprojection_error_px = 0;       // over all observations

  // NaN without views.
  double MedianCentreError() const;
  double MedianRotationErrorDeg() const;
};

// A model is right when the rotation between any two of its views is, within kMaxViewRotationDeg,
// and ONE similarity brings every view within kMaxCentreError of the truth (and a fifth of the
// distance between the outermost views) and half of the points within kMaxPointError of theirs. Its
// rotation is the mean of what the views' orientations ask for; scale and translation follow from
// all centres and points, which weigh the same. Nothing of it is left open by cameras in a row, and
// a mirrored model finds no place.
inline constexpr double kMaxCentreError = 0.10;   // metres, 3 m from the wall
inline constexpr double kMaxViewRotationDeg = 3;  // degrees
inline constexpr double kMaxPointError = 0.10;    // metres
ModelVerdict JudgeModel(SparseModel model, const SimulatedViews& views);

// The views and points where bundle adjustment of all right observations ends when it starts at the
// truth: what noise makes of the truth. A model within the limits of this one is right, too.
SimulatedViews WholeOptimumFromTruth(const SimulatedViews& views);

// The largest of the models that COLMAP left below `folder` (0, 1, ...); empty if there is none.
SparseModel LargestModel(const std::string& folder);

}  // namespace roomtex
