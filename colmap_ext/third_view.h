#pragma once
// A third view decides between the hypotheses of a pair: each hypothesis' points place the further
// views (P3P in RANSAC, refined), everything is adjusted together, and the truncated cost of the
// same observations tells which one is right. The views that were placed become part of the seed.

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "colmap_ext/two_view_hypotheses.h"

namespace roomtex {

// What a further view sees of a pair's matches.
struct ThirdView {
  uint32_t image_id = 0;
  struct Sighting {
    int match = 0;  // position in the pair's matches
    Ray ray;
    int row = -1;  // keypoint row in this view
  };
  std::vector<Sighting> sightings;  // each match at most once
};

struct ThirdViewOptions {
  HypothesisOptions pair;
  int min_sightings = 12;  // inliers that place a view; larger = stricter
  double min_share = 0.4;  // of a view's sightings that must fit; larger = stricter
};

// One hypothesis after the third views had their say.
struct HypothesisVerdict {
  double cost = 0;  // px^2, comparable between the hypotheses of one call only
  Rigid right_from_left;
  // Per third view; none where it could not be placed.
  std::vector<std::optional<Rigid>> views_from_left;
};

struct ThirdViewDecision {
  int best = -1;  // index of the hypothesis
  // Second best cost / best cost. Infinite with a single hypothesis that a third view confirms; 1
  // without any third view.
  double confidence = 1;
  int num_views = 0;  // placed under the best hypothesis
  std::vector<HypothesisVerdict> verdicts;
};

ThirdViewDecision DecideByThirdViews(const std::vector<RayMatch>& matches,
                                     const std::vector<TwoViewHypothesis>& hypotheses,
                                     const std::vector<ThirdView>& views,
                                     const ThirdViewOptions& options);

// Pose of a view from rays and points (P3P in RANSAC, the two best modes refined). None if fewer
// than options.min_sightings fit. sightings[i].match indexes `points`; points that are none are
// skipped.
std::optional<Rigid> PlaceView(const std::vector<std::optional<InverseDepthPoint>>& points,
                               const ThirdView& view, const ThirdViewOptions& options);

}  // namespace roomtex
