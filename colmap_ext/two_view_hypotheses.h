#pragma once
// What a pair of views may look like. Two views of a plane have two valid solutions in about half
// of the cases, so a pair yields a list of hypotheses; third_view.h decides between them.

#include <string>
#include <vector>

#include "colmap_ext/ransac.h"
#include "colmap_ext/seed_bundle.h"
#include "colmap_ext/view_rays.h"
#include "core/similarity.h"

namespace roomtex {

struct HypothesisOptions {
  // Standard deviation of a keypoint's coordinates, pixels; larger = more tolerant. All thresholds
  // follow from it by chi-square.
  double keypoint_noise_px = 1.0;
  // Largest reprojection error of an inlier, pixels; larger = more tolerant. 0 = from
  // keypoint_noise_px.
  double max_error_px = 0;
  // Share of F inliers that obey one homography above which the structure is called degenerate
  // (thesis 6.1.3). Reported; never decides.
  double degenerate_ratio = 0.95;
  int min_num_inliers = 30;
  // Bundle adjustment of hypotheses uses at most this many points; larger = slower, hardly better.
  int max_points = 250;
  uint64_t random_seed = 0;

  double MaxErrorPx() const;          // of a position, two constraints
  double MaxEpipolarErrorPx() const;  // of a match, one constraint
};

struct TwoViewHypothesis {
  std::string origin;                     // "essential", "homography" or "same pose"
  Rigid right_from_left;                  // unit baseline
  std::vector<int> inliers;               // positions in the pair's matches
  std::vector<InverseDepthPoint> points;  // of the inliers
  double cost = 0;              // sum over all matches of min(squared error, threshold^2), px^2
  double median_angle_deg = 0;  // triangulation angle
};

struct TwoViewAnalysis {
  int num_f_inliers = 0, num_h_inliers = 0;
  double h_ratio = 0;          // num_h_inliers / num_f_inliers
  bool degenerate = false;     // thesis' verdict: h_ratio above degenerate_ratio
  bool pure_rotation = false;  // the matches show no parallax: no hypotheses
  // Inliers of the best hypothesis that the best homography does not explain: what two views can
  // tell its rivals apart by.
  int num_off_plane = 0;
  // Different from each other, best two-view cost first.
  std::vector<TwoViewHypothesis> hypotheses;
  std::string problem;  // why there are none; "" if there are some
};

// Thesis 6.1 and the hypotheses of docs/colmap.md: the best essential matrix, the homography's
// poses, and the same-pose start at constant depth, each refined by robust bundle adjustment with
// inliers chosen anew, equal ones merged. Departure: E comes from five points instead of from F,
// which a plane leaves open; F serves the thesis' verdict only.
TwoViewAnalysis AnalysePair(const std::vector<RayMatch>& matches, const HypothesisOptions& options);

// The start of the thesis for a degenerate structure: both views at the same pose, all points at
// constant depth (never at random ones, which end in the right solution in a third of the cases
// only), then bundle adjustment. `among`: matches that one homography explains.
SeedBundleResult SolveFromSamePose(const std::vector<RayMatch>& matches,
                                   const std::vector<int>& among);

// One step for all: inliers, points and cost of a pose.
TwoViewHypothesis EvaluatePose(const Rigid& right_from_left, const std::vector<RayMatch>& matches,
                               const HypothesisOptions& options);

// Robust bundle adjustment with the inliers chosen anew, twice; max_points limits the points used
// (0 = all).
TwoViewHypothesis RefineHypothesis(const Rigid& right_from_left,
                                   const std::vector<RayMatch>& matches, int max_points,
                                   const HypothesisOptions& options);

}  // namespace roomtex
