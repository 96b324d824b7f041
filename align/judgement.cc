#include "align/judgement.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace roomtex {
namespace {

double Weighted(const PickOutcome& outcome) {
  return outcome.pick.weight * outcome.refined_residual_px;
}

// The refined pose is far more exact than the clicks: a used pick that is off shows there even
// among six.
void JudgePicksAgainstSurface(double rms_limit, Alignment* result) {
  std::vector<double> residuals;
  const PickOutcome* farthest = nullptr;
  for (const PickOutcome& outcome : result->picks) {
    if (!outcome.used) continue;
    residuals.push_back(Weighted(outcome));
    if (farthest == nullptr || Weighted(outcome) > Weighted(*farthest)) {
      farthest = &outcome;
    }
  }
  std::nth_element(residuals.begin(), residuals.begin() + residuals.size() / 2, residuals.end());
  const double median = residuals[residuals.size() / 2];
  const std::string place = "where the sparse points lie on the scan's surface, ";
  if (Weighted(*farthest) > std::max(1.5 * rms_limit, 5 * median)) {
    result->reasons.push_back(
        "The pick on " + LineOf(farthest->pick) + " (" + farthest->pick.image_name +
        ") is far off: " + place + "it misses by " + Number(farthest->refined_residual_px, 1) +
        " pixels, half of the picks by less than " + Number(median, 1) + ". Correct or remove it.");
  } else if (!(result->refined_pick_rms_px <= std::max(1.5 * rms_limit, 2 * result->pick_rms_px))) {
    result->reasons.push_back("Picks and surface contradict each other: " + place +
                              "the picks miss by " + Number(result->refined_pick_rms_px, 1) +
                              " pixels (rms), the one on " + LineOf(farthest->pick) + " by " +
                              Number(farthest->refined_residual_px, 1) + " pixels.");
  }
}

void JudgePicks(const AlignmentInput& input, const TrustOptions& trust, Alignment* result) {
  const SparseImage* image = input.model.FindImage(result->clicked_image);
  const double limit = trust.PickRmsLimit(input.model.cameras.at(image->camera_id));
  const auto worst = std::max_element(
      result->picks.begin(), result->picks.end(), [](const PickOutcome& a, const PickOutcome& b) {
        return (a.used ? a.residual_px : -1) < (b.used ? b.residual_px : -1);
      });
  if (!(result->pick_rms_px <= limit)) {
    result->reasons.push_back("The picks miss by " + Number(result->pick_rms_px, 1) +
                              " pixels (rms), more than the limit of " + Number(limit, 1) +
                              "; the worst is on " + LineOf(worst->pick) + " with " +
                              Number(worst->residual_px, 1) +
                              " pixels. Pick again, or pick more points so that a bad one shows.");
  }
  if (!(result->position_sigma <= trust.max_position_sigma)) {
    result->reasons.push_back(
        "The picks leave the camera's position open by " + Number(result->position_sigma, 2) +
        " m (one standard deviation). Spread them more over the photo and in depth.");
  }
  if (result->surface_fit.converged && result->reasons.empty()) {
    JudgePicksAgainstSurface(limit, result);
  }
}

void JudgeScale(const TrustOptions& trust, Alignment* result) {
  const ScaleEstimate& scale = result->scale;
  if (scale.num_features < trust.min_scale_features) {
    result->reasons.push_back("The scale rests on " + std::to_string(scale.num_features) +
                              " features of " + result->clicked_image + ", fewer than " +
                              std::to_string(trust.min_scale_features) + ".");
  }
  if (!(scale.relative_mad <= trust.max_scale_mad)) {
    result->reasons.push_back("The scale differs from feature to feature by " +
                              Number(100 * scale.relative_mad, 0) + " % (limit " +
                              Number(100 * trust.max_scale_mad, 0) + " %): the pose of " +
                              result->clicked_image +
                              " in the scan does not agree with its pose in the sparse model. "
                              "Check that the picks name the right photo.");
  }
}

void JudgePlacement(const TrustOptions& trust, Alignment* result) {
  const Placement& placement = result->placement;
  const int judged = placement.num_on_surface + placement.num_floating + placement.num_hidden;
  if (judged < 20) {
    result->reasons.push_back("Only " + std::to_string(judged) +
                              " sparse points lie where the scanner saw something, too few to "
                              "tell whether the alignment is right.");
  } else if (!(placement.SurfaceShare() >= trust.min_surface_share)) {
    result->reasons.push_back(
        "Only " + Number(100 * placement.SurfaceShare(), 0) +
        " % of the sparse points that the scanner could see lie within " +
        Number(trust.surface_tolerance, 3) + " m of the scan's surface (expected at least " +
        Number(100 * trust.min_surface_share, 0) + " %); the others float in empty space.");
  } else if (!(placement.ChangedShare() <= trust.max_changed_share)) {
    const double percent = 100.0 / judged;
    result->reasons.push_back(
        Number(percent * placement.num_floating, 0) +
        " % of the sparse points float in space that the scanner saw to be empty, and " +
        Number(percent * placement.num_hidden, 0) + " % lie behind its surface (at most " +
        Number(100 * trust.max_changed_share, 0) +
        " % of each): the scan is of another room, or much was moved between scan and photos.");
  }
  if (!(placement.CameraShare() >= trust.min_camera_share)) {
    result->reasons.push_back(std::to_string(placement.num_cameras - placement.num_cameras_free) +
                              " of " + std::to_string(placement.num_cameras) +
                              " photos would have been taken from behind the surface that the "
                              "scanner saw.");
  }
}

}  // namespace

std::string Number(double value, int digits) {
  std::ostringstream text;
  text.setf(std::ios::fixed);
  text.precision(digits);
  text << value;
  return text.str();
}

std::string LineOf(const Pick& pick) {
  return pick.line > 0 ? "line " + std::to_string(pick.line) : "a pick of " + pick.image_name;
}

void JudgeAlignment(const AlignmentInput& input, const TrustOptions& trust, Alignment* result) {
  JudgePicks(input, trust, result);
  JudgeScale(trust, result);
  JudgePlacement(trust, result);
}

void JudgePicksLeftOut(double rms_limit_px, Alignment* result) {
  int num_used = 0;
  const PickOutcome* worst = nullptr;
  for (const PickOutcome& outcome : result->picks) {
    num_used += outcome.used;
    if (outcome.used || !(outcome.pick.weight > 0)) continue;
    if (worst == nullptr || Weighted(outcome) > Weighted(*worst)) worst = &outcome;
  }
  if (worst == nullptr || num_used >= kMinPicksPerPhoto) return;
  if (Weighted(*worst) < rms_limit_px) return;
  result->reasons.push_back(
      "The pick on " + LineOf(worst->pick) + " (" + worst->pick.image_name + ") is " +
      Number(worst->leave_one_out_px, 0) + " pixels away from where the other picks put it, and " +
      "without it only " + std::to_string(num_used) + " are left, fewer than " +
      std::to_string(kMinPicksPerPhoto) +
      ". The alignment was made from those. Correct or remove the pick, or add others.");
}

}  // namespace roomtex
