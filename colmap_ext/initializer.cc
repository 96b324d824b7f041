#include "colmap_ext/initializer.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include <fmt/core.h>

#include "colmap_ext/seed_model.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

// Where more parallax no longer makes a pair better, for the quick guess and for solved pairs.
// COLMAP asks for 16 degrees first and then halves; a soft limit needs no second attempt.
constexpr double kEnoughParallaxDeg = 3, kEnoughAngleDeg = 8;
// Matches off the dominant plane that make two views sure of their motion without a third.
constexpr int kMinOffPlane = 20;
constexpr double kMinShareOffPlane = 0.1;
// Matches used to guess a pair's parallax.
constexpr int kMatchesForParallax = 100;
// Solved before the best of them is decided: a good pair is mostly among the first, and solving is
// what costs.
constexpr int kPairsPerBatch = 4;
// Pairs, by number of matches, whose parallax is guessed at all.
constexpr size_t kMaxRankedPairs = 2000;

struct RankedPair {
  const DatabasePair* pair = nullptr;
  double score = 0;
};

double Saturated(double value, double enough) { return std::min(1.0, value / enough); }

// A solved pair that may become a seed.
struct SolvedPair {
  PairTrial trial;
  const DatabasePair* pair = nullptr;
  std::vector<RayMatch> matches;
  double score = 0;
};

}  // namespace

void InitOptions::Declare(OptionFields* fields) {
  fields
      ->Int("Init.min_num_inliers", &min_num_inliers,
            "Verified matches a pair must have, and points it must keep; larger = stricter.")
      .AtLeast(8);
  fields
      ->Number("Init.keypoint_noise_px", &keypoint_noise_px,
               "Standard deviation of a keypoint's coordinates in pixels; larger = more tolerant.")
      .Positive();
  fields
      ->Number(
          "Init.max_error_px", &max_error_px,
          "Largest reprojection error of an inlier in pixels; larger = more tolerant. 0 = 3.03 "
          "times --Init.keypoint_noise_px, which one true match in a hundred exceeds.")
      .NotNegative()
      .Says("must be 0 (automatic) or positive");
  fields
      ->Number("Init.min_tri_angle_deg", &min_tri_angle_deg,
               "Smallest median angle between a pair's rays in degrees; larger = stricter.")
      .Between(0, 90);
  fields
      ->Number("Init.degenerate_ratio", &degenerate_ratio,
               "Share of the inliers of F on one homography above which the structure is reported "
               "as degenerate. Changes the report only: a third view decides.")
      .Above(0)
      .AtMost(1);
  fields
      ->Number("Init.min_confidence", &min_confidence,
               "How many times better than its rival a solution of the pair must explain the third "
               "views to be believed; larger = stricter.")
      .AtLeast(1);
  fields
      ->Int("Init.max_third_views", &max_third_views,
            "Further photos that check a pair and start the model with it; 0 = none.")
      .NotNegative();
  fields
      ->Int("Init.max_candidates", &max_candidates,
            "Pairs that are solved in search of one that third photos confirm, before the "
            "most confident of the others is taken; larger = slower.")
      .AtLeast(1);
  fields
      ->Int("Init.max_pairs", &max_pairs,
            "Pairs handed to COLMAP, one after the other, while fewer than half of the photos "
            "register.")
      .AtLeast(1);
  fields->Text("Init.image_name1", &image_name1,
               "Photo to start from, as named in the database; empty = chosen.");
  fields->Text("Init.image_name2", &image_name2, "The photo to pair it with; empty = chosen.");
  fields->Require(image_name1.empty() || image_name1 != image_name2,
                  "--Init.image_name1 and --Init.image_name2 must be two different images");
}

std::vector<std::string> InitOptions::Problems() const { return ProblemsOf(*this); }

struct Initializer::Impl {
  MatchedImages* images;
  InitOptions options;
  int num_threads;
  uint64_t random_seed;

  std::deque<RankedPair> ranked;  // not solved yet, best first
  std::deque<SolvedPair> solved;  // best first, not yet decided
  struct Doubtful {
    Seed seed;
    double confidence = 0;
  };
  std::vector<Doubtful> doubtful;  // solved, but no third view could decide
  int num_solved = 0;              // since the last seed
  std::vector<PairTrial> rejected;

  HypothesisOptions PairOptions(const DatabasePair& pair) const {
    HypothesisOptions result;
    result.keypoint_noise_px = options.keypoint_noise_px;
    result.max_error_px = options.max_error_px;
    result.degenerate_ratio = options.degenerate_ratio;
    result.min_num_inliers = options.min_num_inliers;
    result.random_seed = random_seed * 1000003u + PairIdFromImages(pair.image_id1, pair.image_id2);
    return result;
  }

  bool Wanted(const DatabasePair& pair) const {
    if (static_cast<int>(pair.matches.size()) < options.min_num_inliers) return false;
    for (const std::string* name : {&options.image_name1, &options.image_name2}) {
      if (name->empty()) continue;
      if (images->images().at(pair.image_id1).name != *name &&
          images->images().at(pair.image_id2).name != *name) {
        return false;
      }
    }
    return true;
  }

  void RankPairs();
  void SolveNextPairs();
  std::optional<Seed> Decide(SolvedPair solved_pair);
  Seed MakeSeed(const SolvedPair& solved_pair, const std::vector<ThirdView>& views);
};

// How sure two views are that no third view sees enough of. Before a wall not at all, even if only
// one hypothesis is left: noise decides which one that is. What stands off the wall decides.
double ConfidenceOfTwoViews(const TwoViewAnalysis& analysis) {
  const std::vector<TwoViewHypothesis>& hypotheses = analysis.hypotheses;
  const double num_inliers = static_cast<double>(hypotheses.front().inliers.size());
  if (analysis.num_off_plane < std::max(1.0 * kMinOffPlane, kMinShareOffPlane * num_inliers)) {
    return 1;
  }
  if (hypotheses.size() == 1) return std::numeric_limits<double>::infinity();
  return hypotheses[1].cost / hypotheses[0].cost;
}

// Most matches first, weighed down where there is little parallax to build on.
void Initializer::Impl::RankPairs() {
  std::vector<const DatabasePair*> wanted;
  for (const DatabasePair& pair : images->pairs()) {
    if (Wanted(pair)) wanted.push_back(&pair);
  }
  std::stable_sort(wanted.begin(), wanted.end(), [](const DatabasePair* a, const DatabasePair* b) {
    return a->matches.size() > b->matches.size();
  });
  if (wanted.size() > kMaxRankedPairs) wanted.resize(kMaxRankedPairs);
  for (const DatabasePair* pair : wanted) {
    const int stride = std::max(1, static_cast<int>(pair->matches.size()) / kMatchesForParallax);
    const double parallax = MedianParallax(images->Matches(*pair, stride));
    ranked.push_back({pair, static_cast<double>(pair->matches.size()) *
                                Saturated(parallax, RadFromDeg(kEnoughParallaxDeg))});
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const RankedPair& a, const RankedPair& b) { return a.score > b.score; });
}

void Initializer::Impl::SolveNextPairs() {
  std::vector<SolvedPair> batch;
  while (!ranked.empty() && static_cast<int>(batch.size()) < kPairsPerBatch) {
    SolvedPair next;
    next.pair = ranked.front().pair;
    next.matches = images->Matches(*next.pair);
    next.trial.image_id1 = next.pair->image_id1;
    next.trial.image_id2 = next.pair->image_id2;
    next.trial.num_matches = static_cast<int>(next.pair->matches.size());
    batch.push_back(std::move(next));
    ranked.pop_front();
  }
  ParallelFor(num_threads, 0, static_cast<int>(batch.size()), [&](int i) {
    batch[i].trial.analysis = AnalysePair(batch[i].matches, PairOptions(*batch[i].pair));
  });
  num_solved += static_cast<int>(batch.size());
  for (SolvedPair& pair : batch) {
    pair.trial.problem = pair.trial.analysis.problem;
    if (pair.trial.problem.empty()) {
      const TwoViewHypothesis& best = pair.trial.analysis.hypotheses.front();
      pair.score = static_cast<double>(best.inliers.size()) *
                   Saturated(best.median_angle_deg, kEnoughAngleDeg);
      solved.push_back(std::move(pair));
    } else {
      rejected.push_back(pair.trial);
    }
  }
  std::stable_sort(solved.begin(), solved.end(),
                   [](const SolvedPair& a, const SolvedPair& b) { return a.score > b.score; });
}

Seed Initializer::Impl::MakeSeed(const SolvedPair& solved_pair,
                                 const std::vector<ThirdView>& views) {
  const HypothesisOptions pair_options = PairOptions(*solved_pair.pair);
  const ThirdViewDecision& decision = solved_pair.trial.decision;
  const HypothesisVerdict& verdict = decision.verdicts[decision.best];
  TwoViewHypothesis solution;
  if (decision.num_views > 0) {
    solution = EvaluatePose(verdict.right_from_left, solved_pair.matches, pair_options);
  } else {
    solution = RefineHypothesis(verdict.right_from_left, solved_pair.matches, 0, pair_options);
  }
  Seed seed;
  seed.trial = solved_pair.trial;
  seed.trial.analysis.hypotheses[decision.best].median_angle_deg = solution.median_angle_deg;
  seed.pair_model = MakePairModel(images, *solved_pair.pair, solved_pair.matches, solution);
  std::map<uint32_t, Rigid> poses = {{solved_pair.pair->image_id1, Rigid()},
                                     {solved_pair.pair->image_id2, solution.right_from_left}};
  for (size_t k = 0; k < verdict.views_from_left.size(); ++k) {
    if (verdict.views_from_left[k]) poses[views[k].image_id] = *verdict.views_from_left[k];
  }
  seed.poses = MakePoseModel(*images, poses);
  seed.ambiguous = decision.confidence < options.min_confidence;
  return seed;
}

// A seed if the pair is fit for it; doubtful ones are put aside.
std::optional<Seed> Initializer::Impl::Decide(SolvedPair solved_pair) {
  PairTrial& trial = solved_pair.trial;
  ThirdViewOptions third;
  third.pair = PairOptions(*solved_pair.pair);
  const std::vector<ThirdView> views = images->FindThirdViews(
      *solved_pair.pair, solved_pair.matches, third.min_sightings, options.max_third_views);
  trial.decision = DecideByThirdViews(solved_pair.matches, trial.analysis.hypotheses, views, third);
  if (trial.decision.num_views == 0)
    trial.decision.confidence = ConfidenceOfTwoViews(trial.analysis);
  Seed seed = MakeSeed(solved_pair, views);
  const double angle = seed.trial.analysis.hypotheses[trial.decision.best].median_angle_deg;
  if (!(angle >= options.min_tri_angle_deg)) {
    trial.problem = fmt::format("the rays meet at {:.2f} degrees only, wanted {:.2f}", angle,
                                options.min_tri_angle_deg);
  } else if (static_cast<int>(seed.pair_model.points.size()) < options.min_num_inliers) {
    trial.problem = "only " + std::to_string(seed.pair_model.points.size()) +
                    " points could be triangulated well";
  }
  if (!trial.problem.empty()) {
    rejected.push_back(trial);
    return std::nullopt;
  }
  if (!seed.ambiguous) return seed;
  doubtful.push_back({std::move(seed), trial.decision.confidence});
  return std::nullopt;
}

Initializer::Initializer(MatchedImages* images, const InitOptions& options, int num_threads,
                         uint64_t random_seed)
    : impl_(std::make_unique<Impl>()) {
  impl_->images = images;
  impl_->options = options;
  impl_->num_threads = num_threads;
  impl_->random_seed = random_seed;
  impl_->RankPairs();
}

Initializer::~Initializer() = default;

std::optional<Seed> Initializer::Next() {
  impl_->num_solved = 0;
  while (!impl_->solved.empty() || !impl_->ranked.empty()) {
    if (impl_->solved.empty()) {
      // Many pairs of a wall may stay undecided: at some point the most confident is good enough.
      if (impl_->num_solved >= impl_->options.max_candidates && !impl_->doubtful.empty()) break;
      impl_->SolveNextPairs();
      continue;
    }
    SolvedPair next = std::move(impl_->solved.front());
    impl_->solved.pop_front();
    if (auto seed = impl_->Decide(std::move(next))) return seed;
  }
  if (impl_->doubtful.empty()) return std::nullopt;
  const auto best =
      std::max_element(impl_->doubtful.begin(), impl_->doubtful.end(),
                       [](const auto& a, const auto& b) { return a.confidence < b.confidence; });
  Seed seed = std::move(best->seed);
  impl_->doubtful.erase(best);
  return seed;
}

std::vector<PairTrial> Initializer::Rejected() const { return impl_->rejected; }

}  // namespace roomtex
