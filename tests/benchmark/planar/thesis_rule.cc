#include "tests/benchmark/planar/thesis_rule.h"

#include <functional>

#include "colmap_ext/two_view_geometry.h"

namespace roomtex {
namespace {

using PairRule = std::function<std::optional<TwoViewHypothesis>(const std::vector<RayMatch>&,
                                                                const HypothesisOptions&)>;

std::optional<ChosenPair> StartByRule(MatchedImages* images, const HypothesisOptions& options,
                                      const PairRule& rule) {
  std::optional<ChosenPair> best;
  for (const DatabasePair& pair : images->pairs()) {
    if (static_cast<int>(pair.matches.size()) < options.min_num_inliers) continue;
    std::vector<RayMatch> matches = images->Matches(pair);
    HypothesisOptions pair_options = options;
    pair_options.random_seed += PairIdFromImages(pair.image_id1, pair.image_id2);
    auto solution = rule(matches, pair_options);
    if (!solution) continue;
    if (best && solution->inliers.size() <= best->solution.inliers.size()) continue;
    best = ChosenPair{&pair, std::move(matches), std::move(*solution)};
  }
  return best;
}

// One bundle adjustment of a pose with the given matches, which all lie in front.
std::optional<Rigid> Adjust(const Rigid& right_from_left, const std::vector<RayMatch>& matches,
                            const std::vector<int>& among, const HypothesisOptions& options) {
  SeedGeometry start;
  start.views_from_left = {Rigid(), right_from_left};
  std::vector<SeedObservation> observations;
  for (const int i : among) {
    const auto point = TriangulatePair(right_from_left, matches[i].left.x, matches[i].right.x);
    if (!point || !ProjectPoint(right_from_left, *point)) continue;
    const int index = static_cast<int>(start.points.size());
    start.points.push_back(*point);
    observations.push_back({0, index, matches[i].left});
    observations.push_back({1, index, matches[i].right});
  }
  SeedBundleOptions bundle;
  bundle.loss_scale_px = 2 * options.keypoint_noise_px;
  const SeedBundleResult adjusted = AdjustSeed(start, observations, bundle);
  if (!adjusted.usable) return std::nullopt;
  return adjusted.geometry.views_from_left[1];
}

std::optional<TwoViewHypothesis> ThesisPair(const std::vector<RayMatch>& matches,
                                            const HypothesisOptions& options) {
  RansacOptions ransac;
  ransac.random_seed = options.random_seed;
  ransac.max_error_px = options.MaxEpipolarErrorPx();
  const RansacResult fundamental = EstimateFundamental(matches, ransac);
  if (!fundamental.success) return std::nullopt;
  ransac.max_error_px = options.MaxErrorPx();
  const RansacResult homography = EstimateHomography(matches, fundamental.inliers, ransac);
  std::optional<Rigid> pose;
  if (1.0 * homography.inliers.size() > options.degenerate_ratio * fundamental.inliers.size()) {
    const SeedBundleResult solved = SolveFromSamePose(matches, fundamental.inliers);
    if (solved.usable) pose = solved.geometry.views_from_left[1];
  } else {
    int most_in_front = 0;
    for (const Rigid& candidate : PosesFromEssential(EssentialFromFundamental(fundamental.model))) {
      const int in_front = CountInFront(candidate, matches, fundamental.inliers);
      if (in_front <= most_in_front) continue;
      most_in_front = in_front;
      pose = candidate;
    }
    if (pose) pose = Adjust(*pose, matches, fundamental.inliers, options);
  }
  if (!pose) return std::nullopt;
  return EvaluatePose(*pose, matches, options);
}

std::optional<TwoViewHypothesis> LowerCostPair(const std::vector<RayMatch>& matches,
                                               const HypothesisOptions& options) {
  const TwoViewAnalysis analysis = AnalysePair(matches, options);
  if (analysis.hypotheses.empty()) return std::nullopt;
  return analysis.hypotheses.front();
}

}  // namespace

std::optional<ChosenPair> StartByThesisRule(MatchedImages* images,
                                            const HypothesisOptions& options) {
  return StartByRule(images, options, ThesisPair);
}

std::optional<ChosenPair> StartByLowerCost(MatchedImages* images,
                                           const HypothesisOptions& options) {
  return StartByRule(images, options, LowerCostPair);
}

}  // namespace roomtex
