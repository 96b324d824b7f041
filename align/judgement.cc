#include "align/judgement.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "align/clicks/picks.h"
#include "align/trust/agreement.h"
#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr double kMaxRoughness = 0.2;  // metres; what the uncertainty of clicks may excuse
constexpr int kMinJudged = 20;         // sparse points
// A point is on the surface within this many times the scan's noise.
constexpr double kNoiseReach = 4;
// Picks may be off by this many times what model and scan disagree in anyway.
constexpr double kBendDeviations = 2;

double Weighted(const PickOutcome& outcome, double residual_px) {
  return outcome.pick.weight * residual_px;
}

// The refined pose is far more exact than the clicks: a used pick that is off shows there even
// among six.
std::string ContradictionOnSurface(const AlignmentStart& start, const AlignmentFit& fit,
                                   double rms_limit) {
  std::vector<double> residuals;
  int farthest = -1;
  const auto weighted = [&](int i) { return Weighted(start.picks[i], fit.pick_px[i]); };
  for (int i = 0; i < static_cast<int>(start.picks.size()); ++i) {
    if (!start.picks[i].used) continue;
    residuals.push_back(weighted(i));
    if (farthest < 0 || weighted(i) > weighted(farthest)) farthest = i;
  }
  if (farthest < 0) return "";
  const double median = Median(&residuals);
  const Pick& pick = start.picks[farthest].pick;
  const std::string place = "where the sparse points lie on the scan's surface, ";
  if (weighted(farthest) > std::max(1.5 * rms_limit, 5 * median)) {
    return "The pick on " + LineOf(pick) + " (" + pick.image_name + ") is far off: " + place +
           "it misses by " + Number(fit.pick_px[farthest], 1) +
           " pixels, half of the picks by less than " + Number(median, 1) +
           ". Correct or remove it.";
  }
  if (fit.pick_rms_px <= std::max(1.5 * rms_limit, 2 * start.pick_rms_px)) return "";
  return "Picks and surface contradict each other: " + place + "the picks miss by " +
         Number(fit.pick_rms_px, 1) + " pixels (rms), the one on " + LineOf(pick) + " by " +
         Number(fit.pick_px[farthest], 1) + " pixels.";
}

double PickRmsLimit(const AlignmentInput& input, const AlignmentStart& start,
                    const TrustOptions& trust) {
  const SparseImage* image = input.model.FindImage(start.scale_image_name);
  return trust.PickRmsLimit(input.model.cameras.at(image->camera_id));
}

void JudgePicks(const AlignmentStart& start, double limit, const TrustOptions& trust,
                std::vector<std::string>* reasons) {
  const auto worst = std::max_element(
      start.picks.begin(), start.picks.end(), [](const PickOutcome& a, const PickOutcome& b) {
        return (a.used ? a.residual_px : -1) < (b.used ? b.residual_px : -1);
      });
  if (!(start.pick_rms_px <= limit)) {
    reasons->push_back("The picks miss by " + Number(start.pick_rms_px, 1) +
                       " pixels (rms), more than the limit of " + Number(limit, 1) +
                       "; the worst is on " + LineOf(worst->pick) + " with " +
                       Number(worst->residual_px, 1) +
                       " pixels. Pick again, or pick more points so that a bad one shows.");
  }
  if (!(start.position_sigma <= trust.max_position_sigma)) {
    reasons->push_back(
        "The picks leave the camera's position open by " + Number(start.position_sigma, 2) +
        " m (one standard deviation). Spread them more over the photo and in depth.");
  }
}

// Spread picks know the scale themselves, as exactly as scale_sigma says: features are a check, not
// a need.
void JudgeScale(const AlignmentStart& start, const TrustOptions& trust,
                std::vector<std::string>* reasons) {
  const ScaleEstimate& scale = start.scale;
  const bool is_spread = std::isfinite(start.scale_sigma);
  if (scale.num_features < trust.min_scale_features) {
    if (is_spread) return;
    reasons->push_back("The scale rests on " + std::to_string(scale.num_features) +
                       " features of " + start.image_name + ", fewer than " +
                       std::to_string(trust.min_scale_features) + ".");
  }
  if (is_spread && start.scale_off > std::max(trust.max_scale_mad, 3 * start.scale_sigma)) {
    reasons->push_back("The picks give a scale " + Number(100 * start.scale_off, 0) +
                       " % off from that of the features of " + start.scale_image_name +
                       " (limit " +
                       Number(100 * std::max(trust.max_scale_mad, 3 * start.scale_sigma), 0) +
                       " %). Check that the picks name the right photos.");
  }
  if (!(scale.relative_mad <= trust.max_scale_mad)) {
    reasons->push_back("The scale differs from feature to feature by " +
                       Number(100 * scale.relative_mad, 0) + " % (limit " +
                       Number(100 * trust.max_scale_mad, 0) + " %): the pose of " +
                       start.scale_image_name +
                       " in the scan does not agree with its pose in the sparse model. "
                       "Check that the picks name the right photo.");
  }
}

// Fewer points on the surface cannot be excused by a coarse scan.
constexpr double kLeastSurfaceShare = 0.3;

void JudgePlacement(const Placement& placement, const TrustOptions& trust,
                    std::vector<std::string>* reasons, Judgement::Doubt* doubt) {
  const int judged = placement.num_on_surface + placement.num_floating + placement.num_hidden;
  if (judged < kMinJudged) {
    reasons->push_back("Only " + std::to_string(judged) +
                       " sparse points lie where the scanner saw something, too few to "
                       "tell whether the alignment is right.");
  } else if (!(placement.SurfaceShare() >= trust.min_surface_share)) {
    const std::string reason =
        "Only " + Number(100 * placement.SurfaceShare(), 0) +
        " % of the sparse points that the scanner could see lie within " +
        Number(trust.surface_tolerance, 3) + " m of the scan's surface (expected at least " +
        Number(100 * trust.min_surface_share, 0) + " %); the others float in empty space.";
    *doubt = {reason, placement.SurfaceShare() < kLeastSurfaceShare};
  } else if (!(placement.ChangedShare() <= trust.max_changed_share)) {
    const double percent = 100.0 / judged;
    *doubt = {
        Number(percent * placement.num_floating, 0) +
            " % of the sparse points float in space that the scanner saw to be empty, and " +
            Number(percent * placement.num_hidden, 0) + " % lie behind its surface (at most " +
            Number(100 * trust.max_changed_share, 0) +
            " % of each): the scan is of another room, or much was moved between scan and photos.",
        true};
  }
  if (!(placement.CameraShare() >= trust.min_camera_share)) {
    reasons->push_back(std::to_string(placement.num_cameras - placement.num_cameras_free) + " of " +
                       std::to_string(placement.num_cameras) +
                       " photos would have been taken from behind the surface that the "
                       "scanner saw.");
  }
}

// Of the seven numbers of the similarity those that the surface leaves open.
int NumOpen(const Judgement& judgement, bool has_covariance) {
  const OpenDirections& open = judgement.open;
  if (!has_covariance) return 7;
  return static_cast<int>(open.slides.size() + open.turns.size()) + (open.scale ? 1 : 0);
}

// What the similarity leaves open, as numbers.
void FindAccuracy(const AlignmentInput& input, const AlignmentStart& start, const AlignmentFit& fit,
                  const AlignmentOptions& options, Judgement* judgement) {
  const SimilarityFit by_picks =
      fit.refined ? SimilarityFit()
                  : FitToPicks(input.model, input.picks, start.UsedPicks(), start.pick_sigma_px,
                               fit.scan_from_sparse, options.fit);
  const SimilarityFit& placed = fit.refined ? fit.surface : by_picks;
  const CameraCentres centres = FindCameraCentres(input.model, fit.scan_from_sparse);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& [image_id, centre] : centres) {
    middle += centre / static_cast<double>(centres.size());
  }
  judgement->expected_error = PropagateError(placed, centres, input.surveyed.scans());
  judgement->disagreement =
      fit.refined ? fit.disagreement
                  : FindDisagreement(input.model, fit.points, input.surveyed.patches(),
                                     fit.scan_from_sparse, ScanBend());
  judgement->photo_sigmas = FindPhotoSigmas({}, centres, placed, judgement->disagreement);
  SetExpectedErrorAtCameras(judgement->photo_sigmas, judgement->disagreement,
                            &judgement->expected_error);
  if (!fit.refined) return;
  judgement->open = FindOpenDirections(fit.surface, middle);
  const std::vector<bool> used = start.UsedPicks();
  const auto num_used = std::count(used.begin(), used.end(), true);
  const bool by_photos = start.num_corners > 0;
  const bool is_finite = fit.surface.covariance.allFinite();  // not where it is wholly open
  // Hints may be hurried: what they alone hold must leave one of them over to say so.
  const bool are_hints = !by_photos && start.source != AlignmentStart::Source::kPicks;
  const bool held =
      num_used > 0 && (!are_hints || 2 * num_used >= NumOpen(*judgement, is_finite) + 2);
  if (held && !judgement->open.None()) {
    // In front of one wall corners that are off together, as by a lens, move, turn and scale all:
    // there they must hold the model well.
    constexpr double kHeldWell = 0.0025;  // metres
    // What only they hold, and no better than this, is no alignment.
    constexpr double kHeldAtAll = 0.1;
    const bool is_too_much =
        by_photos &&
        ((judgement->open.num_facings < 2 && judgement->open.slide_sigma > kHeldWell) ||
         judgement->expected_error.at_cameras > kHeldAtAll);
    (is_too_much ? judgement->reasons : judgement->warnings)
        .push_back(judgement->open.Sentence(by_photos ? OpenDirections::HeldBy::kPhotos
                                                      : OpenDirections::HeldBy::kPicks));
  }
  if (!held && !(judgement->open.None() && is_finite)) {
    judgement->reasons.push_back(
        std::string("The scan's surface leaves open where the model lies, how it is turned or how "
                    "large it is, and ") +
        (num_used > 0 ? "so few picks hold it there that none of them checks the others. Give six."
                      : "there are no picks to hold it there."));
  }
}

void JudgeStart(const AlignmentInput& input, const AlignmentStart& start, const AlignmentFit& fit,
                const TrustOptions& trust, std::vector<std::string>* reasons) {
  const double limit = PickRmsLimit(input, start, trust);
  JudgePicks(start, limit, trust, reasons);
  if (fit.surface.converged && reasons->empty()) {
    const std::string reason =
        ContradictionOnSurface(start, fit, std::max(limit, kBendDeviations * fit.pick_bend_px));
    if (!reason.empty()) reasons->push_back(reason);
  }
  JudgeScale(start, trust, reasons);
}

}  // namespace

double SurfaceTolerance(const TrustOptions& trust, const ScanPatches& surface) {
  // A coarse scan is not a laser's.
  return std::max(trust.surface_tolerance, kNoiseReach * surface.TypicalThickness());
}

Judgement JudgeFit(const AlignmentInput& input, const AlignmentStart& start,
                   const AlignmentFit& fit, const AlignmentOptions& options) {
  Judgement judgement;
  const bool by_picks = start.source == AlignmentStart::Source::kPicks;
  if (!fit.surface.converged) {
    judgement.reasons.push_back(
        "The sparse points do not settle on the scan's surface: too few of the " +
        std::to_string(fit.points.size()) +
        " are near it, or they pull the scale away from what the " +
        (by_picks ? "picks give." : "start gives."));
  }
  FindAccuracy(input, start, fit, options, &judgement);
  TrustOptions trust = options.trust;
  trust.surface_tolerance = SurfaceTolerance(trust, input.surveyed.patches());
  if (!fit.refined) {
    // Clicks alone are rough, and say themselves how rough.
    trust.surface_tolerance =
        std::max(trust.surface_tolerance, std::min(2 * start.position_sigma, kMaxRoughness));
  }
  judgement.placement =
      CheckPlacement(input.model, fit.points, fit.scan_from_sparse, input.surveyed.patches(),
                     input.surveyed.free_space(), trust);
  if (by_picks) JudgeStart(input, start, fit, trust, &judgement.reasons);
  JudgePlacement(judgement.placement, trust, &judgement.reasons, &judgement.doubt);
  return judgement;
}

// In rooms of one plan and furniture corners are alike, so that photos of one support the scan of
// another; but they show 0 to 21 % of its corners, those of the right one 59 % and more where a
// depth camera's scan drifts by 4 cm (docs/real-rooms.md). Real rooms have 21 % and more: enough
// where points are merely few.
bool Overrules(const GradientAgreement& photos, bool differs, const TrustOptions& trust) {
  constexpr double kClearlyShown = 0.4;
  // Where photos show too few corners to say how far they are off, those in place must do, beyond
  // chance. In a coarse scan they are of frames and furniture: of 65 to 82 another room of the plan
  // had up to 56 % in place, the right one 63 % (docs/automatic.md); of a depth camera's 91 and
  // more others 15 %, right ones 73 % (docs/real-rooms.md).
  constexpr double kClearlyInPlace = 0.6;
  const GradientShifts& shifts = photos.shifts;
  const std::optional<double> shown = shifts.ShownShare();
  if (!differs) return photos.supports && (!shown || *shown >= trust.min_shown_share);
  if (shown) return *shown >= kClearlyShown;
  return photos.supports && shifts.at_pose.Share() - shifts.elsewhere.Share() >= kClearlyInPlace;
}

void OverruleByPhotos(const AlignmentInput& input, const AlignmentFit& fit,
                      const TrustOptions& trust, Judgement* judgement) {
  if (judgement->doubt.reason.empty()) return;
  const auto [reason, differs] = std::exchange(judgement->doubt, {});
  if (!input.image_path.empty() && judgement->reasons.empty()) {
    SparseModel aligned = input.model;
    TransformModel(fit.scan_from_sparse, &aligned);
    std::vector<std::string> ignored;  // comes again when the result is compared
    const Agreement agreement =
        MeasureAgreement({aligned, input.image_path, input.row_motions}, input.surveyed.viewer(),
                         AgreementOptions(), input.num_threads, &ignored);
    if (Overrules(agreement.gradient, differs, trust)) {
      judgement->follows_surface = !differs;
      judgement->warnings.push_back(
          reason +
          " It is believed all the same: the photos show the scan's intensity where it is. " +
          (differs ? "A scan that drifts, or things that were moved: one similarity for all photos "
                     "is used, they are not adjusted to the surface."
                   : "A coarse scan, or things that it does not show."));
      return;
    }
  }
  std::string remedy;
  if (!differs) remedy = " If the scan is coarse, say how coarse (--Trust.surface_tolerance).";
  if (input.image_path.empty()) {
    remedy +=
        " Give --image_path: photos that show the scan's intensity where it is speak for the "
        "alignment.";
  }
  judgement->reasons.push_back(reason + remedy);
}

std::vector<std::string> AdjustmentWarnings(const ModelAdjustment& adjustment,
                                            const ShapeDisagreement& disagreement,
                                            const SparseModel& model) {
  const PlaneBundle& bundle = adjustment.bundle;
  if (!bundle.usable) return {bundle.reason + " One similarity for all photos is used."};
  std::vector<std::string> warnings;
  if (adjustment.bend && adjustment.bend->bend_rms <= kMaxScannerBend) {
    warnings.push_back(
        "The scan is bent by " + Number(1000 * adjustment.bend->bend_rms, 1) +
        " mm (rms over the sparse points): the photos were fitted to it as it is, so that their "
        "reprojection errors grow.");
  } else if (adjustment.bend) {
    warnings.push_back(
        "Sparse model and scan differ in shape by more than a scanner's errors explain (" +
        Number(1000 * disagreement.rms, 0) +
        " mm over the room): a scan put together of drifting parts, or a sparse model bent by few "
        "photos or a wrong lens. The scan was followed" +
        (adjustment.bend->followed < 1
             ? " by " + Percent(adjustment.bend->followed) + ", so that the photos still agree"
             : "") +
        ", and the expected error holds the difference. Look at the overlays (--overlays).");
  }
  for (const uint32_t id : bundle.idle_images) {
    if (bundle.ran_away.count(id) > 0) continue;  // doubted, and named there
    warnings.push_back(model.images.at(id).name +
                       " was not adjusted to the scan's surface: too few sparse points "
                       "hold it. It follows the other photos.");
  }
  return warnings;
}

std::string JudgePicksLeftOut(const AlignmentInput& input, const AlignmentStart& start,
                              const std::vector<double>& surface_px, const TrustOptions& trust) {
  if (start.source != AlignmentStart::Source::kPicks) return "";
  int num_used = 0, worst = -1;
  const auto weighted = [&](int i) { return Weighted(start.picks[i], surface_px[i]); };
  for (int i = 0; i < static_cast<int>(start.picks.size()); ++i) {
    const PickOutcome& outcome = start.picks[i];
    num_used += outcome.used;
    if (outcome.used || !(outcome.pick.weight > 0)) continue;
    if (worst < 0 || weighted(i) > weighted(worst)) worst = i;
  }
  if (worst < 0 || num_used >= kMinPicksPerPhoto) return "";
  if (weighted(worst) < PickRmsLimit(input, start, trust)) return "";
  const PickOutcome& outcome = start.picks[worst];
  return "The pick on " + LineOf(outcome.pick) + " (" + outcome.pick.image_name + ") is " +
         Number(outcome.leave_one_out_px, 0) +
         " pixels away from where the other picks put it, and without it only " +
         std::to_string(num_used) + " are left, fewer than " + std::to_string(kMinPicksPerPhoto) +
         ". The alignment was made from those. Correct or remove the pick, or add others.";
}

std::vector<std::string> PicksOffWarnings(const AlignmentStart& start,
                                          const std::vector<double>& surface_px,
                                          double min_bad_pick_px) {
  std::vector<double> residuals;
  for (size_t i = 0; i < start.picks.size(); ++i) {
    if (start.picks[i].used) residuals.push_back(Weighted(start.picks[i], surface_px[i]));
  }
  const double median = Median(&residuals);
  const double limit = std::max(min_bad_pick_px, 5 * median);
  std::vector<std::string> warnings;
  for (size_t i = 0; i + start.num_corners < start.picks.size(); ++i) {
    const Pick& pick = start.picks[i].pick;
    if (!start.picks[i].used || !(Weighted(start.picks[i], surface_px[i]) > limit)) continue;
    warnings.push_back("The pick on " + LineOf(pick) + " (" + pick.image_name + ") is " +
                       Number(surface_px[i], 1) +
                       " pixels away from where the aligned model puts it, half of the picks less "
                       "than " +
                       Number(median, 1) + ": correct or remove it.");
  }
  return warnings;
}

}  // namespace roomtex
