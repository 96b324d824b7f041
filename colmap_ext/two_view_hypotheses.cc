#include "colmap_ext/two_view_hypotheses.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "colmap_ext/two_view_geometry.h"
#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// A homography is taken for a hypothesis when it explains this share of the matches; below, its
// points are a minor plane of a scene that E describes better.
constexpr double kMinPlaneShare = 0.3;
// Of a homography's points, in front of both views; noise may put a few far ones behind.
constexpr double kMinShareInFront = 0.75;
// A rotation that explains this share of what F explains leaves no parallax to build on.
constexpr double kPureRotationShare = 0.9;
// Equal hypotheses: closer than bundle adjustment from different starts ends up.
constexpr double kEqualRotationDeg = 0.4, kEqualBaselineDeg = 2.5;
// Points of a first refinement, and the share of an equal one's cost below which the second is
// worth refining all the same.
constexpr int kMaxRoughPoints = 80;
constexpr double kClearlyBetter = 0.9;
// Hypotheses whose own two views already fit this much worse are no rivals.
constexpr double kHopelessCostRatio = 3;

bool Equal(const TwoViewHypothesis& a, const TwoViewHypothesis& b) {
  const double cosine = a.right_from_left.translation.dot(b.right_from_left.translation);
  return RotationAngle(a.right_from_left.rotation, b.right_from_left.rotation) <
             RadFromDeg(kEqualRotationDeg) &&
         cosine > std::cos(RadFromDeg(kEqualBaselineDeg));
}

SeedGeometry PairGeometry(const Rigid& right_from_left) {
  SeedGeometry geometry;
  geometry.views_from_left = {Rigid(), right_from_left};
  return geometry;
}

std::vector<SeedObservation> PairObservations(const std::vector<RayMatch>& matches,
                                              const std::vector<int>& among) {
  std::vector<SeedObservation> observations;
  for (size_t i = 0; i < among.size(); ++i) {
    observations.push_back({0, static_cast<int>(i), matches[among[i]].left});
    observations.push_back({1, static_cast<int>(i), matches[among[i]].right});
  }
  return observations;
}

// The poses to start from, each once refined.
class HypothesisMaker {
 public:
  HypothesisMaker(const std::vector<RayMatch>& matches, const HypothesisOptions& options,
                  std::vector<TwoViewHypothesis>* hypotheses)
      : matches_(matches), options_(options), hypotheses_(hypotheses) {}

  void FromEssential(const RansacResult& essential) {
    if (!essential.success) return;
    const Rigid* best = nullptr;
    const std::vector<Rigid> poses = PosesFromEssential(essential.model);
    int best_in_front = 0;
    for (const Rigid& pose : poses) {
      const int in_front = CountInFront(pose, matches_, essential.inliers);
      if (in_front > best_in_front) {
        best_in_front = in_front;
        best = &pose;
      }
    }
    if (best != nullptr) Add(*best, "essential");
  }

  void FromHomography(const RansacResult& homography) {
    for (const Rigid& pose : PosesFromHomography(homography.model)) {
      const int in_front = CountInFront(pose, matches_, homography.inliers);
      if (in_front >= kMinShareInFront * homography.inliers.size()) Add(pose, "homography");
    }
  }

  void FromSamePose(const RansacResult& homography) {
    std::vector<int> chosen;
    const int num_inliers = static_cast<int>(homography.inliers.size());
    for (const int k : RandomSubset(num_inliers, kMaxRoughPoints, options_.random_seed)) {
      chosen.push_back(homography.inliers[k]);
    }
    const SeedBundleResult solved = SolveFromSamePose(matches_, chosen);
    if (solved.usable) Add(solved.geometry.views_from_left[1], "same pose");
  }

 private:
  // A few points first: most starts end where another one did, and need no more.
  void Add(const Rigid& right_from_left, const std::string& origin) {
    const TwoViewHypothesis rough =
        RefineHypothesis(right_from_left, matches_, kMaxRoughPoints, options_);
    if (static_cast<int>(rough.inliers.size()) < options_.min_num_inliers) return;
    for (const TwoViewHypothesis& other : roughs_) {
      if (Equal(rough, other) && !(rough.cost < kClearlyBetter * other.cost)) return;
    }
    roughs_.push_back(rough);
    TwoViewHypothesis hypothesis =
        RefineHypothesis(rough.right_from_left, matches_, options_.max_points, options_);
    hypothesis.origin = origin;
    for (TwoViewHypothesis& other : *hypotheses_) {
      if (!Equal(hypothesis, other)) continue;
      if (hypothesis.cost < other.cost) {
        hypothesis.origin = other.origin;
        other = hypothesis;
      }
      return;
    }
    hypotheses_->push_back(std::move(hypothesis));
  }

  const std::vector<RayMatch>& matches_;
  const HypothesisOptions& options_;
  std::vector<TwoViewHypothesis>* hypotheses_;
  std::vector<TwoViewHypothesis> roughs_;  // everything that was refined with all points
};

RansacOptions EpipolarRansac(const HypothesisOptions& options) {
  RansacOptions ransac;
  ransac.max_error_px = options.MaxEpipolarErrorPx();
  ransac.random_seed = options.random_seed;
  return ransac;
}

// max_samples: enough for the share of inliers from which on the answer matters.
RansacOptions PositionRansac(const HypothesisOptions& options, int max_samples) {
  RansacOptions ransac = EpipolarRansac(options);
  ransac.max_error_px = options.MaxErrorPx();
  ransac.max_samples = max_samples;
  return ransac;
}
// A sample of five has several solutions, each of which is scored: 300 find a clean one where half
// of the matches are wrong.
RansacOptions EssentialRansac(const HypothesisOptions& options) {
  RansacOptions ransac = EpipolarRansac(options);
  ransac.max_samples = 300;
  return ransac;
}
constexpr int kRotationSamples = 40;     // finds half of the matches, and 0.9 are asked for
constexpr int kHomographySamples = 600;  // finds a third of them

// At 1.5 times the limit of an inlier, so that the plane's own noise does not count.
int CountOffPlane(const Eigen::Matrix3d& homography, const std::vector<RayMatch>& matches,
                  const std::vector<int>& among, const HypothesisOptions& options) {
  const double limit2 = std::pow(1.5 * options.MaxErrorPx(), 2);
  return static_cast<int>(std::count_if(among.begin(), among.end(), [&](int i) {
    return HomographyError2(homography, matches[i]) > limit2;
  }));
}

}  // namespace

double HypothesisOptions::MaxErrorPx() const {
  return max_error_px > 0 ? max_error_px : std::sqrt(kChiSquare2) * keypoint_noise_px;
}

double HypothesisOptions::MaxEpipolarErrorPx() const {
  return std::sqrt(kChiSquare1 / kChiSquare2) * MaxErrorPx();
}

SeedBundleResult SolveFromSamePose(const std::vector<RayMatch>& matches,
                                   const std::vector<int>& among) {
  Rigid same_pose;
  SeedGeometry start = PairGeometry(same_pose);
  for (const int i : among) {
    start.points.emplace_back(matches[i].left.x.x(), matches[i].left.x.y(), 1.0);
  }
  SeedBundleOptions options;
  options.loss_scale_px = 0;  // the start is far off, and the matches are a homography's inliers
  options.max_iterations = 100;
  options.free_baseline = true;
  return AdjustSeed(start, PairObservations(matches, among), options);
}

TwoViewHypothesis EvaluatePose(const Rigid& right_from_left, const std::vector<RayMatch>& matches,
                               const HypothesisOptions& options) {
  TwoViewHypothesis result;
  result.right_from_left = right_from_left;
  const Eigen::Matrix3d essential = EssentialFromPose(right_from_left);
  const double limit2 = std::pow(options.MaxEpipolarErrorPx(), 2);
  std::vector<double> angles;
  for (size_t i = 0; i < matches.size(); ++i) {
    const double error2 = EpipolarError2(essential, matches[i]);
    std::optional<InverseDepthPoint> point;
    if (error2 < limit2) {
      point = TriangulatePair(right_from_left, matches[i].left.x, matches[i].right.x);
    }
    if (!point || !ProjectPoint(right_from_left, *point)) {
      result.cost += limit2;
      continue;
    }
    result.cost += error2;
    result.inliers.push_back(static_cast<int>(i));
    result.points.push_back(*point);
    angles.push_back(TriangulationAngle(right_from_left, *point));
  }
  result.median_angle_deg = DegFromRad(Median(std::move(angles)));
  return result;
}

TwoViewHypothesis RefineHypothesis(const Rigid& right_from_left,
                                   const std::vector<RayMatch>& matches, int max_points,
                                   const HypothesisOptions& options) {
  TwoViewHypothesis best = EvaluatePose(right_from_left, matches, options);
  SeedBundleOptions bundle;
  bundle.loss_scale_px = 2 * options.keypoint_noise_px;
  constexpr int kNumRounds = 2;
  for (int round = 0; round < kNumRounds; ++round) {
    const int num_inliers = static_cast<int>(best.inliers.size());
    if (num_inliers < 8) break;
    SeedGeometry start = PairGeometry(best.right_from_left);
    std::vector<int> chosen;
    const int count = max_points > 0 ? max_points : num_inliers;
    for (const int k : RandomSubset(num_inliers, count, options.random_seed + round)) {
      chosen.push_back(best.inliers[k]);
      start.points.push_back(best.points[k]);
    }
    const SeedBundleResult adjusted = AdjustSeed(start, PairObservations(matches, chosen), bundle);
    if (!adjusted.usable) break;
    TwoViewHypothesis refined =
        EvaluatePose(adjusted.geometry.views_from_left[1], matches, options);
    if (!(refined.cost < best.cost)) break;
    best = std::move(refined);
  }
  return best;
}

TwoViewAnalysis AnalysePair(const std::vector<RayMatch>& matches,
                            const HypothesisOptions& options) {
  TwoViewAnalysis analysis;
  const RansacResult fundamental = EstimateFundamental(matches, EpipolarRansac(options));
  analysis.num_f_inliers = static_cast<int>(fundamental.inliers.size());
  if (!fundamental.success || analysis.num_f_inliers < options.min_num_inliers) {
    analysis.problem =
        "only " + std::to_string(analysis.num_f_inliers) + " matches obey one epipolar geometry";
    return analysis;
  }
  const RansacResult rotation =
      EstimateRotation(matches, PositionRansac(options, kRotationSamples));
  if (rotation.inliers.size() >= kPureRotationShare * fundamental.inliers.size()) {
    analysis.pure_rotation = true;
    analysis.problem = "the camera only turned between the two photos";
  }
  // Thesis 6.1: a homography on what F left over.
  RansacResult homography =
      EstimateHomography(matches, fundamental.inliers, PositionRansac(options, kHomographySamples));
  analysis.num_h_inliers = static_cast<int>(homography.inliers.size());
  analysis.h_ratio = 1.0 * analysis.num_h_inliers / analysis.num_f_inliers;
  analysis.degenerate = analysis.h_ratio > options.degenerate_ratio;
  if (analysis.pure_rotation) return analysis;

  HypothesisMaker maker(matches, options, &analysis.hypotheses);
  maker.FromEssential(EstimateEssential(matches, EssentialRansac(options)));
  // On a plane F is arbitrary and its inliers a random choice: the hypotheses take the plane's own.
  std::vector<int> all(matches.size());
  std::iota(all.begin(), all.end(), 0);
  homography = EstimateHomography(matches, all, PositionRansac(options, kHomographySamples));
  if (homography.inliers.size() >= kMinPlaneShare * matches.size()) {
    maker.FromHomography(homography);
    maker.FromSamePose(homography);
  }
  std::vector<TwoViewHypothesis>& hypotheses = analysis.hypotheses;
  std::stable_sort(
      hypotheses.begin(), hypotheses.end(),
      [](const TwoViewHypothesis& a, const TwoViewHypothesis& b) { return a.cost < b.cost; });
  while (!hypotheses.empty() &&
         hypotheses.back().cost > kHopelessCostRatio * hypotheses.front().cost) {
    hypotheses.pop_back();
  }
  if (hypotheses.empty()) {
    analysis.problem = "no relative pose has enough points before both views";
  } else {
    analysis.num_off_plane =
        CountOffPlane(homography.model, matches, hypotheses.front().inliers, options);
  }
  return analysis;
}

}  // namespace roomtex
