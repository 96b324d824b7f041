#include "align/fit/model_adjustment.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "colmap_ext/photo_bundle.h"

namespace roomtex {
namespace {

// A scan is bent when straightening it lowers the cost of the photos in the adjusted model by this
// share, and by this much. Simulated rooms with a cost of 12 000 to 16 000: straight scans -24 to
// 35 (one of 17: 90), 0.2 % of the range 126, 0.3 % or 0.3 degrees 198 to 249, 1 % 1808.
constexpr double kMinBendShare = 0.008, kMinBendGain = 100;

// A lens is freed when that lowers the cost of the photos by this share, and by this much; told
// right it is a few.
constexpr double kMinLensShare = 0.004, kMinLensGain = 50;

// From one similarity, to a scan that is bent or not, with lenses that are held or not.
struct Trial {
  Similarity scan_from_sparse;
  std::optional<BendFit> bend;
  PlaneBundleOptions options;
  SparseModel start;
  PlaneBundleInput input;
  PlaneBundle bundle;

  Trial(const ModelAdjustmentInput& adjustment, const SparseModel& model,
        const Similarity& similarity, std::optional<BendFit> bend_fit, bool free,
        const PlaneBundleOptions& given)
      : scan_from_sparse(similarity),
        bend(std::move(bend_fit)),
        options(given),
        start(model),
        input{start,
              adjustment.planes,
              adjustment.patches,
              adjustment.picks,
              adjustment.used,
              adjustment.pick_sigma_px,
              adjustment.clicked_image,
              bend ? bend->bend : ScanBend(),
              adjustment.lens_of_camera,
              adjustment.told} {
    options.refine_intrinsics = free;
    TransformModel(scan_from_sparse, &start);
    bundle = AdjustToSurface(input, options);
  }
  Trial(const Trial&) = delete;
};
using TrialPointer = std::unique_ptr<Trial>;

// Of the photos' cost: b's is lower than a's by more than this share and this much.
bool IsBetter(const PlaneBundle& a, const PlaneBundle& b, double share, double gain) {
  if (!b.usable) return false;
  return !a.usable || a.image_cost - b.image_cost > std::max(gain, share * a.image_cost);
}

// Keypoints are noisy, so that a sparse model is bent a little, too; adjusting its poses takes that
// away and costs nothing. A bent scan, however, contradicts the photos.
bool IsScanBent(const PlaneBundle& straight, const PlaneBundle& bent) {
  return IsBetter(straight, bent, kMinBendShare, kMinBendGain);
}

class Adjuster {
 public:
  Adjuster(const ModelAdjustmentInput& input, const Similarity& start,
           const PlaneBundleOptions& options)
      : input_(input), start_(start), options_(options) {}

  TrialPointer Run() {
    const bool free = input_.lens == LensChoice::kFree;
    TrialPointer best = Try(input_.model, start_, std::nullopt, free);
    if (input_.lens != LensChoice::kByScan) return WithBend(std::move(best), input_.model);
    TrialPointer freed = Try(input_.model, start_, std::nullopt, true);
    if (!IsLensWrong(best->bundle, freed->bundle)) return WithBend(std::move(best), input_.model);
    const SparseModel model = ByPhotosAlone(*freed);
    freed = WithBend(std::move(freed), model);
    TrialPointer held = WithBend(std::move(best), input_.model);
    return held->bend && !IsLensWrong(held->bundle, freed->bundle) ? std::move(held)
                                                                   : std::move(freed);
  }

 private:
  static bool IsLensWrong(const PlaneBundle& held, const PlaneBundle& freed) {
    return IsBetter(held, freed, kMinLensShare, kMinLensGain);
  }

  TrialPointer Try(const SparseModel& model, const Similarity& start, std::optional<BendFit> bend,
                   bool free) const {
    return std::make_unique<Trial>(input_, model, start, std::move(bend), free, options_);
  }

  // The straight trial, or the one of the bent scan where the scan is bent. model: in its own
  // frame, what the photos alone make of the trial's lenses.
  TrialPointer WithBend(TrialPointer straight, const SparseModel& model) const {
    const bool fixed = options_.fix_clicked_view && !input_.clicked_image.empty();
    if (!options_.bend || fixed) return straight;
    const bool same = &model == &input_.model;
    const std::vector<SurfacePoint> own_points =
        same ? std::vector<SurfacePoint>()
             : FindSurfacePoints(model, options_.min_track, straight->bundle.sigma_px);
    std::optional<BendFit> bend = FitScanBend(
        model, same ? input_.points : own_points, input_.scans, input_.patches, input_.picks,
        input_.used, input_.pick_sigma_px, straight->scan_from_sparse, options_.min_bend);
    if (!bend) return straight;
    const Similarity start = bend->scan_from_sparse;
    TrialPointer bent = Try(model, start, std::move(bend), straight->options.refine_intrinsics);
    return IsScanBent(straight->bundle, bent->bundle) ? std::move(bent) : std::move(straight);
  }

  // The photos with the lens of an adjusted model, but not held on the surface; as it lay.
  SparseModel ByPhotosAlone(const Trial& freed) const {
    SparseModel model = input_.model;
    model.cameras = freed.bundle.model.cameras;
    return AdjustedByPhotos(model, freed.bundle.sigma_px);
  }

  const ModelAdjustmentInput& input_;
  const Similarity& start_;
  const PlaneBundleOptions& options_;
};

}  // namespace

ModelAdjustment AdjustModel(const ModelAdjustmentInput& input, const Similarity& start,
                            const PlaneBundleOptions& options) {
  ModelAdjustment result;
  result.scan_from_sparse = start;
  const TrialPointer trial = Adjuster(input, start, options).Run();
  result.bundle = std::move(trial->bundle);
  if (!result.bundle.usable) return result;
  result.bend = trial->bend;
  result.freed = trial->options.refine_intrinsics;
  result.scan_from_sparse = result.bundle.adjusted_from_input * trial->scan_from_sparse;
  BundleCovariances covariances = FindCovariances(trial->input, result.bundle, trial->options);
  result.covariances = std::move(covariances.poses);
  result.camera_covariances = std::move(covariances.cameras);
  return result;
}

}  // namespace roomtex
