#include "colmap_ext/model_check.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "colmap_ext/match_support.h"
#include "colmap_ext/third_view.h"
#include "colmap_ext/two_view_geometry.h"
#include "core/frames.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

struct TestedPair {
  const DatabasePair* pair = nullptr;
  std::vector<RayMatch> matches;
  std::vector<ThirdView> views;
  TwoViewHypothesis model_motion;
  bool decided = false, contradicts = false;
};

// For photos spread evenly over the model, the pair with most matches that is not taken yet.
std::vector<const DatabasePair*> ChoosePairs(const MatchedImages& images, const SparseModel& model,
                                             const std::pair<uint32_t, uint32_t>& without,
                                             const ModelCheckOptions& options) {
  std::map<uint32_t, std::vector<const DatabasePair*>> pairs_of_image;
  for (const DatabasePair& pair : images.pairs()) {
    if (static_cast<int>(pair.matches.size()) < options.pair.min_num_inliers) continue;
    if (model.images.count(pair.image_id1) == 0 || model.images.count(pair.image_id2) == 0) {
      continue;
    }
    if (std::minmax(without.first, without.second) == std::minmax(pair.image_id1, pair.image_id2)) {
      continue;
    }
    pairs_of_image[pair.image_id1].push_back(&pair);
    pairs_of_image[pair.image_id2].push_back(&pair);
  }
  std::vector<std::vector<const DatabasePair*>> lists;
  for (auto& [image_id, pairs] : pairs_of_image) {
    std::stable_sort(pairs.begin(), pairs.end(), [](const DatabasePair* a, const DatabasePair* b) {
      return a->matches.size() > b->matches.size();
    });
    lists.push_back(std::move(pairs));
  }
  std::vector<const DatabasePair*> chosen;
  std::set<const DatabasePair*> taken;
  const size_t count = std::min(lists.size(), static_cast<size_t>(options.max_pairs));
  for (size_t k = 0; k < count; ++k) {
    for (const DatabasePair* pair : lists[k * lists.size() / count]) {
      if (!taken.insert(pair).second) continue;
      chosen.push_back(pair);
      break;
    }
  }
  return chosen;
}

// Turned by more, or its baseline.
bool Differs(const Rigid& a, const Rigid& b, double rotation_deg, double baseline_deg) {
  return RotationAngle(a.rotation, b.rotation) > RadFromDeg(rotation_deg) ||
         a.translation.dot(b.translation) < std::cos(RadFromDeg(baseline_deg));
}

// Whether another motion explains the third views clearly better than the model's own, both
// refined from where they are.
void TestPair(const ModelCheckOptions& options, TestedPair* tested) {
  HypothesisOptions pair_options = options.pair;
  pair_options.random_seed += PairIdFromImages(tested->pair->image_id1, tested->pair->image_id2);
  const TwoViewAnalysis analysis = AnalysePair(tested->matches, pair_options);
  // By the motion found anew: under a wrong one the rays meet anywhere.
  if (analysis.hypotheses.empty() ||
      !(analysis.hypotheses.front().median_angle_deg >= options.min_tri_angle_deg)) {
    return;
  }
  std::vector<TwoViewHypothesis> hypotheses = {tested->model_motion};
  hypotheses.insert(hypotheses.end(), analysis.hypotheses.begin(), analysis.hypotheses.end());
  ThirdViewOptions third;
  third.pair = pair_options;
  const ThirdViewDecision decision =
      DecideByThirdViews(tested->matches, hypotheses, tested->views, third);
  if (decision.num_views == 0) return;
  tested->decided = true;
  const Rigid& model_motion = tested->model_motion.right_from_left;
  const HypothesisVerdict& own = decision.verdicts[0];
  // Left to itself the model's motion goes to another one, farther away than noise takes it.
  tested->contradicts = Differs(own.right_from_left, model_motion, 3, 25);
  // The same motion with other mismatches among its inliers may cost much less: only one that would
  // put the camera elsewhere contradicts. A wall's second solution is farther away than this.
  for (const HypothesisVerdict& rival : decision.verdicts) {
    tested->contradicts |= own.cost > options.min_confidence * rival.cost &&
                           Differs(own.right_from_left, rival.right_from_left, 1.5, 10);
  }
}

}  // namespace

ModelCheck CheckModel(MatchedImages* images, const SparseModel& model,
                      const std::pair<uint32_t, uint32_t>& without,
                      const ModelCheckOptions& options, int num_threads) {
  std::vector<TestedPair> pairs;
  const int min_sightings = ThirdViewOptions().min_sightings;
  for (const DatabasePair* pair : ChoosePairs(*images, model, without, options)) {
    TestedPair tested;
    tested.pair = pair;
    tested.matches = images->Matches(*pair);
    tested.model_motion = EvaluatePose(ModelMotion(model, *pair), tested.matches, options.pair);
    const int all = static_cast<int>(images->images().size());
    for (ThirdView& view : images->FindThirdViews(*pair, tested.matches, min_sightings, all)) {
      if (model.images.count(view.image_id) == 0) continue;
      if (static_cast<int>(tested.views.size()) == options.max_third_views) break;
      tested.views.push_back(std::move(view));
    }
    if (!tested.views.empty()) pairs.push_back(std::move(tested));
  }
  ParallelFor(num_threads, 0, static_cast<int>(pairs.size()),
              [&](int i) { TestPair(options, &pairs[i]); });
  ModelCheck check;
  std::map<uint32_t, size_t> num_disobeying;
  for (const auto& [image_id, count] : CountObeyingMatches(images, model, options.pair)) {
    check.support[image_id] = count.Share();
    num_disobeying[image_id] = count.num_matches - count.num_obeying;
  }
  const double limit = SupportLimit(check.support, options.min_support);
  for (const auto& [image_id, share] : check.support) {
    if (share < limit) check.doubtful.push_back(image_id);
  }
  std::stable_sort(check.doubtful.begin(), check.doubtful.end(), [&](uint32_t a, uint32_t b) {
    return num_disobeying.at(a) > num_disobeying.at(b);
  });
  for (const TestedPair& tested : pairs) {
    if (!tested.decided) continue;
    ++check.num_pairs;
    if (!tested.contradicts) continue;
    check.contradicting.emplace_back(tested.pair->image_id1, tested.pair->image_id2);
  }
  check.trusted = check.doubtful.empty() && static_cast<double>(check.contradicting.size()) <=
                                                options.max_contradicting * check.num_pairs;
  return check;
}

}  // namespace roomtex
