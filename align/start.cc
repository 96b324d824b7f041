#include "align/start.h"

#include <algorithm>
#include <cmath>

namespace roomtex {
namespace {

constexpr double kLeastClickNoise = 0.5;  // pixels; exact picks are luck

bool IsBetter(const PickView& a, const PickView& b) {
  const bool a_is_whole = a.pairs.size() >= kMinPicksPerPhoto;
  const bool b_is_whole = b.pairs.size() >= kMinPicksPerPhoto;
  if (a_is_whole != b_is_whole) return a_is_whole;
  if (!a_is_whole && a.pairs.size() != b.pairs.size()) return a.pairs.size() > b.pairs.size();
  return a.review.pose().PositionSigma() < b.review.pose().PositionSigma();
}

int ChooseView(const std::vector<PickView>& views,
               const std::vector<std::optional<PoseChoice>>& choices) {
  int best = -1;
  for (size_t i = 0; i < views.size(); ++i) {
    if (!views[i].HasPose()) continue;
    if (!choices.empty() && choices[i] && choices[i]->scale.num_features == 0) continue;
    if (best < 0 || IsBetter(views[i], views[best])) best = static_cast<int>(i);
  }
  return best;
}

std::vector<PickOutcome> OutcomesOf(const std::vector<Pick>& picks) {
  std::vector<PickOutcome> outcomes;
  for (const Pick& pick : picks) outcomes.push_back({pick, pick.weight > 0});
  return outcomes;
}

void MeasurePicks(const SparseModel& model, const std::vector<Pick>& picks, AlignmentStart* start) {
  const std::vector<double> residuals = PickDistances(model, picks, start->scan_from_sparse);
  for (size_t i = 0; i < picks.size(); ++i) {
    start->picks[i].residual_px = residuals[i];
    if (picks[i].weight > 0) start->pick_max_px = std::fmax(start->pick_max_px, residuals[i]);
  }
  start->pick_rms_px = PickRms(start->picks, residuals);
}

// What the reviews of the photos say about their picks.
void SetReviewed(const std::vector<PickView>& views, std::vector<PickOutcome>* outcomes) {
  for (const PickView& view : views) {
    for (size_t k = 0; view.HasPose() && k < view.picks.size(); ++k) {
      PickOutcome& outcome = (*outcomes)[view.picks[k]];
      outcome.used = view.review.used[k];
      outcome.leave_one_out_px = view.review.leave_one_out_px[static_cast<int>(k)];
    }
  }
}

// By the pose of one photo.
AlignmentStart StartFromView(const PickView& view, const PoseChoice& choice) {
  AlignmentStart start;
  start.source = AlignmentStart::Source::kPicks;
  start.image_name = view.image_name;
  start.scale = choice.scale;
  start.position_sigma = view.review.pose().PositionSigma();
  start.pick_sigma_px = std::max(kLeastClickNoise, view.review.pose().sigma_px);
  start.scan_from_sparse = ScanFromSparse(view.review.poses[choice.index].cam_from_scan,
                                          view.image->cam_from_model, start.scale.scale);
  return start;
}

}  // namespace

std::vector<bool> AlignmentStart::UsedPicks() const {
  std::vector<bool> used;
  for (const PickOutcome& outcome : picks) used.push_back(outcome.used);
  return used;
}

double PickRms(const std::vector<PickOutcome>& picks, const std::vector<double>& residuals_px) {
  if (picks.empty()) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0, sum_of_weights = 0;
  for (size_t i = 0; i < picks.size(); ++i) {
    if (!picks[i].used) continue;
    sum += std::pow(picks[i].pick.weight * residuals_px[i], 2);
    sum_of_weights += std::pow(picks[i].pick.weight, 2);
  }
  return sum_of_weights > 0 ? std::sqrt(sum / sum_of_weights) : 0;
}

std::vector<double> PickDistances(const SparseModel& model, const std::vector<Pick>& picks,
                                  const Similarity& scan_from_sparse) {
  const Eigen::Matrix2Xd errors = PickErrors(model, picks, scan_from_sparse);
  std::vector<double> distances(picks.size());
  for (size_t i = 0; i < picks.size(); ++i) {
    distances[i] = errors.col(static_cast<int>(i)).norm();
  }
  return distances;
}

PickStart StartFromPicks(const SparseModel& model, const std::vector<Pick>& picks,
                         const std::vector<PickView>& views,
                         const std::vector<std::optional<PoseChoice>>& choices,
                         const AlignmentOptions& options, const ScaleOfPhoto& scale_of_photo) {
  PickStart found;
  found.view = ChooseView(views, choices);
  if (found.view < 0) return found;
  const PickView& view = views[found.view];
  const bool is_chosen = !choices.empty() && choices[found.view];
  found.choice = is_chosen ? *choices[found.view]
                           : ChoosePoseOf(view, options.scale, options.trust.min_scale_features,
                                          scale_of_photo);
  if (found.choice.scale.num_features == 0) return found;

  AlignmentStart start = StartFromView(view, found.choice);
  start.picks = OutcomesOf(picks);
  SetReviewed(views, &start.picks);
  const auto num_on =
      std::count_if(picks.begin(), picks.end(), [](const Pick& pick) { return pick.weight > 0; });
  if (num_on > static_cast<long>(view.picks.size())) {
    found.joint =
        FitPicksJointly(model, picks, start.UsedPicks(), start.pick_sigma_px,
                        start.scan_from_sparse, options.fit, options.picks.min_bad_pick_px);
    start.scan_from_sparse = found.joint->scan_from_sparse;
    for (size_t i = 0; i < picks.size(); ++i) start.picks[i].used = found.joint->used[i];
  }
  MeasurePicks(model, picks, &start);
  found.start = std::move(start);
  return found;
}

AlignmentStart StartFromSimilarity(const SparseModel& model, const std::vector<Pick>& picks,
                                   const Similarity& scan_from_sparse, double position_sigma) {
  AlignmentStart start;
  start.scan_from_sparse = scan_from_sparse;
  start.position_sigma = position_sigma;
  start.picks = OutcomesOf(picks);
  MeasurePicks(model, picks, &start);
  return start;
}

}  // namespace roomtex
