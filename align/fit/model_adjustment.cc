#include "align/fit/model_adjustment.h"

#include <algorithm>
#include <memory>

namespace roomtex {
namespace {

// A scan is bent when straightening it lowers the cost of the photos in the adjusted model by this
// share, and by this much. Simulated rooms with a cost of 12 000 to 16 000: straight scans -24 to
// 35 (one of 17: 90), 0.2 % of the range 126, 0.3 % or 0.3 degrees 198 to 249, 1 % 1808.
constexpr double kMinBendShare = 0.008, kMinBendGain = 100;

// From one similarity, to a scan that is bent or not.
struct Trial {
  SparseModel start;
  PlaneBundleInput input;
  PlaneBundle bundle;

  Trial(const ModelAdjustmentInput& adjustment, const Similarity& scan_from_sparse,
        const ScanBend& bend, const PlaneBundleOptions& options)
      : start(adjustment.model),
        input{start,           adjustment.planes,        adjustment.patches,       adjustment.picks,
              adjustment.used, adjustment.pick_sigma_px, adjustment.clicked_image, bend} {
    input.pick_bend_px = adjustment.pick_bend_px;
    TransformModel(scan_from_sparse, &start);
    bundle = AdjustToSurface(input, options);
  }
};

// Keypoints are noisy, so that a sparse model is bent a little, too; adjusting its poses takes that
// away and costs nothing. A bent scan, however, contradicts the photos.
bool IsScanBent(const PlaneBundle& straight, const PlaneBundle& bent) {
  if (!bent.usable) return false;
  return !straight.usable || straight.image_cost - bent.image_cost >
                                 std::max(kMinBendGain, kMinBendShare * straight.image_cost);
}

// The straight scan again, from where the bent one has brought the model: what looks like a bend
// may only have been the better start (a large room, blurred photos, few of them), and then there
// is no cost left between the two.
bool IsStraightAfterAll(const ModelAdjustmentInput& adjustment, const PlaneBundle& bent,
                        const PlaneBundleOptions& options) {
  PlaneBundleInput input{
      bent.model,      adjustment.planes,        adjustment.patches,      adjustment.picks,
      adjustment.used, adjustment.pick_sigma_px, adjustment.clicked_image};
  input.sigma_px = bent.sigma_px;
  input.pick_bend_px = adjustment.pick_bend_px;
  return !IsScanBent(AdjustToSurface(input, options), bent);
}

}  // namespace

ModelAdjustment AdjustModel(const ModelAdjustmentInput& input, const Similarity& start,
                            const PlaneBundleOptions& options) {
  ModelAdjustment result;
  result.scan_from_sparse = start;
  auto trial = std::make_unique<Trial>(input, start, ScanBend(), options);
  const bool fixed = options.fix_clicked_view && !input.clicked_image.empty();
  if (options.bend && !fixed) {
    result.bend = FitScanBend(input.model, input.points, input.scans, input.patches, input.picks,
                              input.used, input.pick_sigma_px, start, options.min_bend);
  }
  if (result.bend) {
    const Similarity& scan_from_sparse = result.bend->scan_from_sparse;
    auto bent = std::make_unique<Trial>(input, scan_from_sparse, result.bend->bend, options);
    if (IsScanBent(trial->bundle, bent->bundle) &&
        !IsStraightAfterAll(input, bent->bundle, options)) {
      result.scan_from_sparse = scan_from_sparse;
      trial = std::move(bent);
    } else {
      result.bend.reset();
    }
  }
  result.bundle = std::move(trial->bundle);
  if (!result.bundle.usable) {
    result.bend.reset();
    result.scan_from_sparse = start;
    return result;
  }
  result.scan_from_sparse = result.bundle.adjusted_from_input * result.scan_from_sparse;
  result.covariances = FindPoseCovariances(trial->input, result.bundle, options);
  return result;
}

}  // namespace roomtex
