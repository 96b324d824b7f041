#include "align/alignment_fit.h"

#include <algorithm>
#include <cmath>

#include "colmap_ext/photo_bundle.h"
#include "core/camera_formulas.h"

namespace roomtex {
namespace {

// Pixels per photo with picks, the largest.
double PickBend(const AlignmentInput& input, const ShapeDisagreement& disagreement) {
  double bend_px = 0;
  for (const Pick& pick : input.picks) {
    const SparseImage* const image = input.model.FindImage(pick.image_name);
    if (image == nullptr || !(pick.weight > 0)) continue;
    const auto seen = disagreement.photos.find(image->image_id);
    if (seen == disagreement.photos.end()) continue;
    const Camera& camera = input.model.cameras.at(image->camera_id);
    bend_px = std::max(bend_px, seen->second.rotation * camera.MeanFocalLength());
  }
  return bend_px;
}

}  // namespace

double KeypointSigma(const SparseModel& model) {
  // Pixels; keypoints are not exacter than that, even where a small model fits them.
  constexpr double kLeastKeypointNoise = 0.3;
  return std::max(kLeastKeypointNoise, KeypointNoise(model));
}

AlignmentFit FitAlignment(const AlignmentInput& input, const AlignmentStart& start, double sigma_px,
                          const AlignmentOptions& options) {
  AlignmentFit fit;
  fit.scan_from_sparse = start.scan_from_sparse;
  fit.points =
      FindSurfacePoints(input.model, TrackThatCounts(input.model, options.fit.min_track), sigma_px);
  const double gate = std::clamp(5 * start.position_sigma, 0.1, options.fit.max_gate);
  fit.surface = FitToSurface(input.model, fit.points, input.surveyed.patches(), input.picks,
                             start.UsedPicks(), start.pick_sigma_px, gate, start.scan_from_sparse,
                             options.fit);
  fit.pick_px.assign(input.picks.size(), std::numeric_limits<double>::quiet_NaN());
  if (!fit.surface.converged) return fit;
  fit.pick_px = PickDistances(input.model, input.picks, fit.surface.scan_from_sparse);
  fit.pick_rms_px = PickRms(start.picks, fit.pick_px);
  fit.refined = options.plane_constrained;
  if (fit.refined) fit.scan_from_sparse = fit.surface.scan_from_sparse;
  fit.disagreement = FindDisagreement(input.model, fit.points, input.surveyed.patches(),
                                      fit.surface.scan_from_sparse, ScanBend());
  fit.pick_bend_px = PickBend(input, fit.disagreement);
  return fit;
}

namespace {

// Photos that leave a focal length open by more than this share leave it to the scan: half of it is
// as much as the rest of an alignment has.
constexpr double kMaxOpenFocal = 0.001;
// Metres; a scan that differs in shape from the photos by more (rms) calibrates no lens.
constexpr double kMaxCalibratingScan = 0.01;

// A principal point in the very middle of the photos is nobody's measurement.
bool IsCentreCalibrated(const LensCheck& lenses) {
  return std::all_of(lenses.lenses.begin(), lenses.lenses.end(), [](const LensFinding& lens) {
    const Camera& told = lens.told;
    const size_t first = camera_formulas::HasOneFocalLength(told.model) ? 1 : 2;
    const bool in_the_middle =
        told.params[first] == told.width / 2.0 && told.params[first + 1] == told.height / 2.0;
    return lens.told_alike && !in_the_middle;
  });
}

LensChoice ChooseLens(const AlignmentInput& input, const AlignmentFit& fit, const LensCheck& lenses,
                      RefineIntrinsics refine) {
  if (refine == RefineIntrinsics::kNever) return LensChoice::kHeld;
  // What nobody could mend before may be why model and scan differ in shape.
  const bool is_wrong = lenses.only_looked_at &&
                        std::any_of(lenses.lenses.begin(), lenses.lenses.end(),
                                    [](const LensFinding& lens) { return lens.Contradicts(); });
  if (refine == RefineIntrinsics::kAuto && !is_wrong &&
      fit.disagreement.rms > kMaxCalibratingScan) {
    return LensChoice::kHeld;
  }
  if (refine == RefineIntrinsics::kAlways || lenses.mended || is_wrong || input.lenses_refined) {
    return !input.lenses_refined && IsCentreCalibrated(lenses) ? LensChoice::kFreeButCentre
                                                               : LensChoice::kFree;
  }
  const bool open =
      std::any_of(lenses.lenses.begin(), lenses.lenses.end(), [](const LensFinding& lens) {
        return !(lens.focal_sigma < kMaxOpenFocal * lens.told.MeanFocalLength());
      });
  return open ? LensChoice::kByScan : LensChoice::kHeld;
}

}  // namespace

ModelAdjustment AdjustAlignment(const AlignmentInput& input, const AlignmentStart& start,
                                const AlignmentFit& fit, const LensCheck& lenses,
                                const AlignmentOptions& options, const ModelAdjustment* like) {
  const SurveyedScans& surveyed = input.surveyed;
  const ModelAdjustmentInput adjusted{
      input.model,           fit.points,
      surveyed.scans(),      surveyed.planes(),
      surveyed.patches(),    input.picks,
      start.UsedPicks(),     start.pick_sigma_px,
      start.image_name,      ChooseLens(input, fit, lenses, options.refine_intrinsics),
      lenses.lens_of_camera, lenses.ToldCameras(input.model),
      fit.pick_bend_px,      input.row_motions,
      input.freed_with_rows};
  // The clicked view keeps the pose of its clicks, so that the model starts there, too.
  const bool fixed = options.bundle.fix_clicked_view && !start.image_name.empty();
  const Similarity& similarity = fixed ? start.scan_from_sparse : fit.scan_from_sparse;
  return like == nullptr ? AdjustModel(adjusted, similarity, options.bundle, input.num_threads)
                         : AdjustModelLike(*like, adjusted, similarity, options.bundle);
}

}  // namespace roomtex
