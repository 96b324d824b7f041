#include "align/alignment.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include <fmt/core.h>

#include "core/frames.h"

namespace roomtex {
namespace {

void Append(std::vector<std::string> more, std::vector<std::string>* all) {
  std::move(more.begin(), more.end(), std::back_inserter(*all));
}

// Where model and scan differ in shape, another lens has to differ from the one as told in its
// focal length by so many standard deviations: distortion alone is too little to go by there. And
// it has to bring them nearer by this factor, ...
constexpr double kSameFocalDeviations = 2.5, kClearlyNearer = 0.95;
// ... or the photos have to be this sure of its focal length. A scan that is itself off by
// centimetres may lie a few per cent nearer to the wrong lens; it has to lie far nearer then.
constexpr double kSureFocalDeviations = 3.5, kFarNearer = 0.6;

// RMS over all observations, pixels.
double ReprojectionRms(SparseModel model) { return UpdateReprojectionErrors(&model).rms_px; }

// By the picks alone: where the model starts, and what there is to say about the picks.
AlignmentStart FindStart(const AlignmentInput& input, const AlignmentOptions& options,
                         Progress* progress, std::vector<std::string>* warnings) {
  progress->Stage("pose from picks");
  const std::vector<PickView> views = ReviewViews(input.model, input.picks, options.picks);
  Append(CheckViews(input, views), warnings);
  progress->Stage("scale");
  const PickStart found = StartFromPicks(
      input.model, input.picks, views, {}, options,
      [&](const SparseImage& image, const Rigid& cam_from_scan, const ScaleOptions& scale) {
        return EstimateScale(input.model, image, cam_from_scan, input.surveyed.scans(),
                             input.surveyed.meshes(), scale);
      });
  Append(CheckStart(input, views, found), warnings);
  return *found.start;
}

// Takes over what the adjustment says better than the fit.
void TakeAdjustment(const AlignmentInput& input, Alignment* result) {
  const ModelAdjustment& adjustment = result->adjustment;
  Append(AdjustmentWarnings(adjustment, result->disagreement, input.model), &result->warnings);
  if (!result->adjusted()) return;
  result->scan_from_sparse = adjustment.scan_from_sparse;
  const CameraCentres centres = FindCameraCentres(adjustment.bundle.model, Similarity());
  if (adjustment.bend && adjustment.bend->bend_rms <= kMaxScannerBend) {
    result->disagreement =
        FindDisagreement(input.model, result->fit.points, input.surveyed.patches(),
                         adjustment.bend->scan_from_sparse, adjustment.bend->bend);
  }
  result->expected_error = PropagateError(result->fit.surface, centres, input.surveyed.scans());
  result->photo_sigmas =
      FindPhotoSigmas(adjustment.covariances, centres, result->fit.surface, result->disagreement);
  for (const uint32_t id : adjustment.bundle.ran_away) result->photo_sigmas.erase(id);
  SetExpectedErrorAtCameras(result->photo_sigmas, result->disagreement, &result->expected_error);
  result->refined_pick_px = PickDistances(adjustment.bundle.model, input.picks, Similarity());
  result->refined_pick_rms_px = PickRms(result->start.picks, result->refined_pick_px);
}

std::string CornerWarning(const Alignment& alignment) {
  const CornerAdjustment& corners = alignment.corners;
  return fmt::format(
      "{} corners of the scan's intensity that {} photos show hold these photos, too, since sparse "
      "model and scan differ in shape: half of them came from {:.1f} to {:.1f} pixels by the other "
      "half.",
      corners.num_corners, corners.num_photos, corners.held_out_before_px,
      corners.held_out_after_px);
}

// The input with its lenses as the photos have them.
AlignmentInput WithLensesOf(const LensCheck& lenses, const AlignmentInput& input) {
  return input.With(lenses.mended ? *lenses.mended : input.model, input.surveyed, input.picks);
}

LensCheck FindLenses(const AlignmentInput& input, const AlignmentOptions& options,
                     Progress* progress) {
  progress->Stage("lenses");
  return CheckLenses(input.model, input.photo_labels, options.refine_intrinsics);
}

// Lenses that stay as told although the photos contradict them: said, and not trusted where that
// moves photos by more than an alignment is off. Those of models with panoramas or rigs can be
// mended by the adjustment to the scan only.
void JudgeLenses(const LensCheck& lenses, RefineIntrinsics refine, Alignment* result) {
  constexpr double kHarmlessShare = 0.003;  // of the focal length; 1 cm at 3 m
  const bool is_held = refine == RefineIntrinsics::kNever;
  if (!is_held && !lenses.only_looked_at) return;
  for (LensFinding lens : lenses.lenses) {
    if (!lens.Contradicts()) continue;
    lens.used = result->adjusted() && result->adjustment.freed;
    const double told_px = lens.told.MeanFocalLength();
    const bool harmful =
        !lens.used && lens.FocalDeviations() > kSureFocalDeviations &&
        std::abs(lens.found.MeanFocalLength() - told_px) > kHarmlessShare * told_px;
    std::string text = lens.Sentence();
    if (is_held) {
      text += " --refine_intrinsics auto uses the lens found.";
    } else if (!lens.used) {
      text +=
          " Of a model with rigs or panoramas the adjustment to the scan could mend it, and there "
          "was none: map the photos with the focal length found.";
    }
    (harmful ? result->reasons : result->warnings).push_back(text);
  }
}

// rolling: null, or what is found of a rolling shutter; then the result ends there, for it comes
// again with still rows.
Alignment FitAndJudge(const AlignmentInput& input, const LensCheck& lenses,
                      const AlignmentStart& start, const AlignmentOptions& options,
                      Progress* progress, std::optional<RollingShutter>* rolling) {
  progress->Stage("surface refinement");
  Alignment result;
  result.start = start;
  result.told_cameras = lenses.ToldCameras(input.model);
  for (const LensFinding& lens : lenses.lenses) {
    if (lens.used) result.warnings.push_back(lens.Sentence());
  }
  result.reprojection_rms_px = ReprojectionRms(input.model);
  const double sigma_px = KeypointSigma(input.model);
  result.fit = FitAlignment(input, start, sigma_px, options);
  result.scan_from_sparse = result.fit.scan_from_sparse;
  result.refined_pick_px = result.fit.pick_px;
  result.refined_pick_rms_px = result.fit.pick_rms_px;

  progress->Stage("trust");
  Judgement judgement = JudgeFit(input, start, result.fit, options);
  OverruleByPhotos(input, result.fit, options.trust, &judgement);
  result.expected_error = judgement.expected_error;
  result.photo_sigmas = std::move(judgement.photo_sigmas);
  result.disagreement = std::move(judgement.disagreement);
  result.open = std::move(judgement.open);
  result.placement = judgement.placement;
  Append(std::move(judgement.warnings), &result.warnings);
  result.reasons = std::move(judgement.reasons);

  if (result.fit.refined && result.reasons.empty() && judgement.follows_surface) {
    progress->Stage("bundle adjustment");
    result.adjustment = AdjustAlignment(input, start, result.fit, lenses, options);
    if (rolling != nullptr && result.adjusted()) {
      progress->Stage("rolling shutter");
      *rolling = FindRollingShutter(input, start, result.fit, lenses, result.adjustment, options);
      if (*rolling) return result;
    }
    result.adjustment.straight.reset();  // as large as the model
    if (result.adjusted() && result.disagreement.rms > kSameShape) {
      progress->Stage("corners");
      result.corners =
          AdjustByCorners(input, start, result.fit, lenses, options, &result.adjustment);
    }
    TakeAdjustment(input, &result);
    if (result.corners.used) result.warnings.push_back(CornerWarning(result));
  }
  const std::string reason = JudgePicksLeftOut(input, start, result.refined_pick_px, options.trust);
  if (!reason.empty()) result.reasons.push_back(reason);
  JudgeLenses(lenses, options.refine_intrinsics, &result);
  if (result.reasons.empty() && result.fit.refined) {
    Append(PicksOffWarnings(start, result.refined_pick_px, options.picks.min_bad_pick_px),
           &result.warnings);
  }
  return result;
}

std::string RollingShutterWarning(const RollingShutter& rolling) {
  return fmt::format(
      "The photos have a rolling shutter: from the first row to the last their camera turned by "
      "{:.2f} degrees and moved by {:.0f} mm (medians), which explains {:.0f} % of what they "
      "disagreed by. Poses are those of the middle row.",
      DegFromRad(rolling.MedianTurn()), 1000 * rolling.MedianMove(),
      100 * (1 - rolling.cost_moving / rolling.cost_still));
}

// Of what a rolling shutter had the photos off by, this share may stay when it is taken out: its
// motion and the lens are told apart by each other (docs/commands.md: 7 to 27 % in five captures).
void AddWhatStays(const Alignment& rolled, Alignment* still) {
  constexpr double kStays = 0.25;
  const auto add = [](double with_shutter, double* without) {
    const double taken_out = std::max(0.0, with_shutter * with_shutter - *without * *without);
    *without = std::hypot(*without, kStays * std::sqrt(taken_out));
  };
  for (auto& [id, sigma] : still->photo_sigmas) {
    const auto before = rolled.photo_sigmas.find(id);
    if (before == rolled.photo_sigmas.end()) continue;
    add(before->second.position, &sigma.position);
    add(before->second.rotation, &sigma.rotation);
  }
  SetExpectedErrorAtCameras(still->photo_sigmas, ShapeDisagreement(), &still->expected_error);
  add(rolled.expected_error.at_far_corner, &still->expected_error.at_far_corner);
}

// The same; of photos that turn out to have a rolling shutter with what they would show without it.
Alignment FitWithStillRows(const AlignmentInput& input, const LensCheck& lenses,
                           const AlignmentStart& start, const AlignmentOptions& options,
                           Progress* progress) {
  std::optional<RollingShutter> rolling;
  Alignment rolled = FitAndJudge(input, lenses, start, options, progress,
                                 options.bundle.rolling_shutter ? &rolling : nullptr);
  if (!rolling) return rolled;
  AlignmentStart still_start = start;
  for (size_t i = 0; i < start.picks.size(); ++i) still_start.picks[i].pick = rolling->picks[i];
  AlignmentInput still_input = input.With(rolling->model, input.surveyed, rolling->picks);
  still_input.row_motions = rolling->motions;
  still_input.freed_with_rows = rolling->freed;
  Alignment still = FitAndJudge(still_input, lenses, still_start, options, progress, nullptr);
  still.warnings.push_back(RollingShutterWarning(*rolling));
  still.start = start;  // picks as they were made
  if (!still.adjusted()) {
    // What is not to be trusted without the shutter is not so with it, either.
    if (!still.reasons.empty()) return still;
    return FitAndJudge(input, lenses, start, options, progress, nullptr);
  }
  still.adjustment.freed |= rolling->freed;
  AddWhatStays(rolled, &still);
  still.rolling_shutter = std::move(rolling);
  return still;
}

// How far model and scan differ in shape, metres; infinite where the picks lead nowhere.
double ShapeDifference(const AlignmentInput& input, const AlignmentOptions& options,
                       Progress* progress) {
  constexpr double kNowhere = std::numeric_limits<double>::infinity();
  try {
    std::vector<std::string> ignored;  // comes again for the lenses that are chosen
    const AlignmentStart start = FindStart(input, options, progress, &ignored);
    const AlignmentFit fit = FitAlignment(input, start, KeypointSigma(input.model), options);
    return fit.ShapeDifference();
  } catch (const InputError&) {
    return kNowhere;
  }
}

// Photos that hardly move, or a camera model that lacks a term of the lens, let the photos find a
// lens that is no better than the one they contradict. Where model and scan differ in shape the
// scan has a say then: the better lens brings the model nearer to it.
bool ScanSpeaksForTold(const AlignmentInput& told, const LensCheck& lenses,
                       const AlignmentOptions& options, Progress* progress) {
  const double difference = ShapeDifference(WithLensesOf(lenses, told), options, progress);
  if (!(difference > kSameShape)) return false;
  bool same_focal = true, sure_focal = false;
  for (const LensFinding& lens : lenses.lenses) {
    if (!lens.used) continue;
    const bool told_otherwise = lens.told_alike && !lens.apart;
    const double deviations = lens.FocalDeviations();
    same_focal = same_focal && told_otherwise && deviations < kSameFocalDeviations;
    sure_focal = sure_focal || (told_otherwise && deviations > kSureFocalDeviations);
  }
  if (same_focal) return true;
  const double told_difference = ShapeDifference(told, options, progress);
  return sure_focal ? told_difference < kFarNearer * difference
                    : kClearlyNearer * told_difference < difference;
}

std::string KeepTold(LensCheck* lenses) {
  std::string text;
  for (LensFinding& lens : lenses->lenses) {
    if (!std::exchange(lens.used, false)) continue;
    text += lens.Sentence() + " ";
  }
  lenses->mended.reset();
  return text + "With it the sparse model lies nearer to the scan.";
}

}  // namespace

std::vector<std::string> AlignmentOptions::Problems() const {
  std::vector<std::string> all;
  for (const auto& some : {picks.Problems(), scale.Problems(), surface.Problems(), fit.Problems(),
                           bundle.Problems(), trust.Problems(), mesh.Problems()}) {
    all.insert(all.end(), some.begin(), some.end());
  }
  return all;
}

Alignment AlignToScan(const AlignmentInput& input, const AlignmentOptions& options,
                      Progress* progress) {
  CheckPicksAgainstModel(input.picks_path, input.picks, input.model);
  progress->Stage("scan surface");
  std::vector<std::string> warnings = CheckPicksOnScan(input);
  input.surveyed.patches();
  LensCheck lenses = FindLenses(input, options, progress);
  if (lenses.mended && options.refine_intrinsics == RefineIntrinsics::kAuto &&
      ScanSpeaksForTold(input, lenses, options, progress)) {
    warnings.push_back(KeepTold(&lenses));
  }
  const AlignmentInput aligned = WithLensesOf(lenses, input);
  const AlignmentStart start = FindStart(aligned, options, progress, &warnings);
  Alignment result = FitWithStillRows(aligned, lenses, start, options, progress);
  result.lenses = std::move(lenses);
  Append(std::move(result.warnings), &warnings);
  result.warnings = std::move(warnings);
  return result;
}

Alignment AlignToScan(const AlignmentInput& input, const AlignmentStart& start,
                      const AlignmentOptions& options, Progress* progress) {
  progress->Stage("scan surface");
  input.surveyed.patches();
  LensCheck lenses = FindLenses(input, options, progress);
  const AlignmentInput aligned = WithLensesOf(lenses, input);
  Alignment result = FitWithStillRows(aligned, lenses, start, options, progress);
  result.lenses = std::move(lenses);
  return result;
}

}  // namespace roomtex
