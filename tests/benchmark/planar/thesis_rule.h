#pragma once
// Two rules that start from one pair without asking a third view: what the benchmark compares with.

#include <optional>

#include "colmap_ext/matched_images.h"
#include "colmap_ext/two_view_hypotheses.h"

namespace roomtex {

struct ChosenPair {
  const DatabasePair* pair = nullptr;
  std::vector<RayMatch> matches;
  TwoViewHypothesis solution;
};

// Thesis 6.1, to the letter: F by eight points, H on F's inliers; above 95 % both views start at
// the same pose and bundle adjustment finds the motion, otherwise E = F with its singular values
// corrected, the pose with most points in front, and bundle adjustment. The thesis leaves open
// where the points of a same-pose start lie: at constant depth, which serves it best. Of all pairs,
// the one with most reconstructed points.
std::optional<ChosenPair> StartByThesisRule(MatchedImages* images,
                                            const HypothesisOptions& options);

// The hypotheses of two_view_hypotheses.h, of which the one with the lower two-view cost is
// believed. Of all pairs, the one with most inliers.
std::optional<ChosenPair> StartByLowerCost(MatchedImages* images, const HypothesisOptions& options);

}  // namespace roomtex
