#include "align/corner_adjustment.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "align/start_photos.h"
#include "align/trust/photo_comparison.h"
#include "align/trust/photo_corners.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr int kPhotosForCorners = 100;  // that are asked
constexpr size_t kFewestHolding = 40;   // fewer say nothing
constexpr size_t kMostHolding = 10000;  // more say nothing new
// Held-out corners must come nearer by this factor, and the reprojection errors of the sparse model
// may grow by this one (where all else spoke for them: 0.46 to 0.83, and 0.66 to 1.11).
// Where photos show the scan less alike than before, they were nearer to their places on it, and
// colours get worse: by 0.4 and 1.3 dB in two sets; in four others they got better by 0.3 to 2 dB.
constexpr double kHeldOutNearer = 0.9, kMostGrowth = 1.15;

// The adjustment by the surface again, with these corners as picks that are as exact as they turn
// out to be.
ModelAdjustment AdjustByThese(const std::vector<Pick>& corners, double sigma_px,
                              const AlignmentInput& input, const AlignmentStart& start,
                              const AlignmentFit& fit, const LensCheck& lenses,
                              const AlignmentOptions& options, const ModelAdjustment& by_surface) {
  AlignmentStart held = start;
  std::vector<Pick> picks = input.picks;
  for (Pick corner : corners) {
    corner.weight = start.pick_sigma_px / sigma_px;
    PickOutcome outcome;
    outcome.pick = corner;
    held.picks.push_back(outcome);
    picks.push_back(std::move(corner));
  }
  // Each photo goes where its corners are: model and scan no longer disagree there.
  AlignmentFit unbent = fit;
  unbent.pick_bend_px = 0;
  return AdjustAlignment(input.With(input.model, input.surveyed, picks), held, unbent, lenses,
                         options, &by_surface);
}

double MedianPickDistance(const std::vector<Pick>& corners, const SparseModel& aligned) {
  std::vector<double> distances = PickDistances(aligned, corners, Similarity());
  return Median(&distances);
}

}  // namespace

CornerAdjustment AdjustByCorners(const AlignmentInput& input, const AlignmentStart& start,
                                 const AlignmentFit& fit, const LensCheck& lenses,
                                 const AlignmentOptions& options, ModelAdjustment* adjustment) {
  CornerAdjustment result;
  if (input.image_path.empty() || options.bundle.fix_clicked_view) return result;
  const SparseModel& aligned = adjustment->bundle.model;
  const PhotoCorners found =
      FindPhotoCorners({aligned, input.image_path, input.row_motions}, input.surveyed.viewer(),
                       kPhotosForCorners, input.num_threads);
  const std::vector<Pick> corners = PicksOf(found.corners, aligned, Similarity(), kMostHolding);
  result.num_corners = static_cast<int>(corners.size());
  result.num_photos = found.num_photos;
  if (corners.size() < kFewestHolding) return result;
  const double sigma_px = CornerSigma(corners, aligned, Similarity());
  const auto adjust_by = [&](const std::vector<Pick>& some) {
    return AdjustByThese(some, sigma_px, input, start, fit, lenses, options, *adjustment);
  };
  std::vector<Pick> holding, held_out;
  for (size_t i = 0; i < corners.size(); ++i) {
    (i % 2 == 0 ? holding : held_out).push_back(corners[i]);
  }
  const ModelAdjustment by_half = adjust_by(holding);
  if (!by_half.bundle.usable) return result;
  result.held_out_before_px = MedianPickDistance(held_out, aligned);
  result.held_out_after_px = MedianPickDistance(held_out, by_half.bundle.model);
  if (!(result.held_out_after_px < kHeldOutNearer * result.held_out_before_px)) return result;
  ModelAdjustment by_all = adjust_by(corners);
  const double errors_before = adjustment->bundle.reprojection_rms_after;
  if (!by_all.bundle.usable || by_all.bundle.reprojection_rms_after > kMostGrowth * errors_before) {
    return result;
  }
  const auto correlation_at = [&input](const SparseModel& model) {
    return ComparePhotosOnScan({model, input.image_path, input.row_motions},
                               input.surveyed.viewer(), PhotoComparisonOptions(), input.num_threads)
        .MedianCorrelation();
  };
  result.correlation_before = correlation_at(aligned);
  result.correlation_after = correlation_at(by_all.bundle.model);
  if (!(result.correlation_after >= result.correlation_before)) return result;
  result.used = true;
  *adjustment = std::move(by_all);
  return result;
}

}  // namespace roomtex
