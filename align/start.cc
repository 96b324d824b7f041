#include "align/start.h"

#include <algorithm>
#include <cmath>

#include "align/trust/expected_error.h"

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
  start.image_name = start.scale_image_name = view.image_name;
  start.scale = choice.scale;
  start.position_sigma = view.review.pose().PositionSigma();
  start.pick_sigma_px = std::max(kLeastClickNoise, view.review.pose().sigma_px);
  start.scan_from_sparse = ScanFromSparse(view.review.poses[choice.index].cam_from_scan,
                                          view.image->cam_from_model, start.scale.scale);
  return start;
}

// Of the photos with picks that count, the one with most sparse points: its features tell which of
// several similarities is right, and check the scale.
const SparseImage& FeaturePhotoOf(const SparseModel& model, const std::vector<Pick>& picks) {
  const SparseImage* best = nullptr;
  long most = -1;
  for (const Pick& pick : picks) {
    const SparseImage* image = model.FindImage(pick.image_name);
    if (!(pick.weight > 0) || image == best) continue;
    const long count = std::count_if(image->point3d_ids.begin(), image->point3d_ids.end(),
                                     [](uint64_t id) { return id != kInvalidPoint3dId; });
    if (count <= most) continue;
    most = count;
    best = image;
  }
  return *best;
}

// How exactly the picks fix the cameras of the photos that they were made in: the worst of them.
double SpreadPositionSigma(const SparseModel& model, const std::vector<Pick>& picks,
                           const SimilarityFit& fit) {
  double sigma = 0;
  for (const Pick& pick : picks) {
    if (!(pick.weight > 0)) continue;
    const Rigid& cam_from_sparse = model.FindImage(pick.image_name)->cam_from_model;
    sigma = std::max(
        sigma, PositionSigmaAt(fit, fit.scan_from_sparse * cam_from_sparse.TargetOriginInSource()));
  }
  return sigma;
}

// By picks of several photos none of which has enough; none if they fix nothing.
std::optional<AlignmentStart> StartFromSpread(
    const SparseModel& model, const std::vector<Pick>& picks, const SpreadPickFit& spread,
    const AlignmentOptions& options, const ScaleOfPhoto& scale_of_photo, PoseChoice* choice) {
  if (!spread.HasFit()) return std::nullopt;
  const SparseImage& photo = FeaturePhotoOf(model, picks);
  std::vector<ViewPose> poses;
  for (size_t i = 0; i < spread.fits.size(); ++i) {
    ViewPose pose;
    pose.cam_from_scan = CamFromScan(photo.cam_from_model, spread.fits[i].scan_from_sparse);
    pose.rms_px = spread.rms_px[i];
    poses.push_back(pose);
  }
  *choice = ChoosePose(poses, options.scale, options.trust.min_scale_features,
                       [&](const Rigid& cam_from_scan, const ScaleOptions& scale_options) {
                         return scale_of_photo(photo, cam_from_scan, scale_options);
                       });
  const SimilarityFit& fit = spread.fits[choice->index];
  AlignmentStart start;
  start.source = AlignmentStart::Source::kPicks;
  start.scale = choice->scale;
  start.scale_image_name = photo.name;
  start.position_sigma = SpreadPositionSigma(model, picks, fit);
  start.pick_sigma_px = spread.sigma_px;
  start.scan_from_sparse = fit.scan_from_sparse;
  start.scale_sigma = std::sqrt(std::max(0.0, fit.covariance(6, 6)));
  start.picks = OutcomesOf(picks);
  for (size_t i = 0; i < picks.size(); ++i) {
    start.picks[i].used = spread.used[i];
    start.picks[i].leave_one_out_px = spread.leave_one_out_px[i];
  }
  if (start.scale.num_features >= options.trust.min_scale_features) {
    start.scale_off = std::abs(std::log(start.scale.scale / fit.scan_from_sparse.scale));
  }
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
  const bool is_whole = found.view >= 0 && views[found.view].pairs.size() >= kMinPicksPerPhoto;
  if (!is_whole && AreSpreadPicks(picks)) {
    found.view = -1;
    found.spread = FitSpreadPicks(model, picks, options.picks, options.fit);
    found.start =
        StartFromSpread(model, picks, *found.spread, options, scale_of_photo, &found.choice);
    if (found.start) MeasurePicks(model, picks, &*found.start);
    return found;
  }
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
