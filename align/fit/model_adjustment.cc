#include "align/fit/model_adjustment.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "core/parallel.h"

namespace roomtex {
namespace {

// A scan is bent when straightening it lowers the cost of the photos in the adjusted model by this
// share, and by this much. Simulated rooms with a cost of 12 000 to 16 000: straight scans -24 to
// 35 (one of 17: 90), 0.2 % of the range 126, 0.3 % or 0.3 degrees 198 to 249, 1 % 1808.
constexpr double kMinBendShare = 0.008, kMinBendGain = 100;

// A bend that is larger than any scanner's and explains less than this share of its own square is
// the drift of a scan put together of parts. Simulated rooms with ranges wrong by 0.8 and 3 %: 0.35
// and 0.33; desk 0.92; kitchen 0.08. Photos put onto it lie where the scan shows what they see, but
// no longer agree with each other; followed by half, both errors are at half and their squares at a
// fourth. docs/texture.md has what each share does to poses and colours.
constexpr double kMinExplained = 0.17, kFollowedOfDrift = 0.5;

// A lens is freed when that lowers the cost of the photos by this share, and by this much; told
// right it is a few.
constexpr double kMinLensShare = 0.004, kMinLensGain = 50;

// What of the lenses is adjusted; the centre is principal point and tangential distortion.
enum class Freed { kNothing, kNotCentre, kAll };

// From one similarity, to a scan that is bent or not, with lenses that are held or not.
struct Trial {
  Similarity scan_from_sparse;
  std::optional<BendFit> bend;
  PlaneBundleOptions options;
  SparseModel start;
  PlaneBundleInput input;
  PlaneBundle bundle;

  Trial(const ModelAdjustmentInput& adjustment, const Similarity& similarity,
        std::optional<BendFit> bend_fit, Freed freed, const PlaneBundleOptions& given)
      : scan_from_sparse(similarity),
        bend(std::move(bend_fit)),
        options(given),
        start(adjustment.model),
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
    input.pick_bend_px = adjustment.pick_bend_px;
    input.row_motions = adjustment.row_motions;
    options.refine_intrinsics = freed != Freed::kNothing;
    options.hold_centre = freed == Freed::kNotCentre;
    TransformModel(scan_from_sparse, &start);
    bundle = AdjustToSurface(input, options);
  }
  Trial(const Trial&) = delete;
};
using TrialPointer = std::unique_ptr<Trial>;

// Of the photos' cost: b's is lower than a's by more than this share and this much.
bool IsBetter(const PlaneBundle& a, const PlaneBundle& b, double share, double gain) {
  if (!b.usable) return false;
  if (!a.usable) return true;
  const double before = SharedImageCost(a, b), after = SharedImageCost(b, a);
  return before - after > std::max(gain, share * before);
}

// Keypoints are noisy, so that a sparse model is bent a little, too; adjusting its poses takes that
// away and costs nothing. A bent scan, however, contradicts the photos.
bool IsScanBent(const PlaneBundle& straight, const PlaneBundle& bent) {
  return IsBetter(straight, bent, kMinBendShare, kMinBendGain);
}

// What a wrong lens explains is no bend, and a bent scan calibrates no lens: the lens is freed
// first, and a bend must explain the photos better with the lens as it came.
class Adjuster {
 public:
  Adjuster(const ModelAdjustmentInput& input, const Similarity& start,
           const PlaneBundleOptions& options)
      : input_(input), start_(start), options_(options) {}

  TrialPointer Run(int num_threads, std::optional<PlaneBundle>* of_straight) {
    TrialPointer straight, bent;
    ParallelFor(num_threads, 0, 2, [&](int task) {
      task == 0 ? straight = AdjustStraight() : bent = AdjustBent(FindBend(), 1);
    });
    if (!bent || !IsScanBent(straight->bundle, bent->bundle) || IsStraightAfterAll(*bent)) {
      return straight;
    }
    *of_straight = std::move(straight->bundle);
    if (bent->bend->bend_rms <= kMaxScannerBend || bent->bend->Explained() >= kMinExplained) {
      return bent;
    }
    TrialPointer followed = AdjustBent(bent->bend, kFollowedOfDrift);
    return followed->bundle.usable ? std::move(followed) : std::move(bent);
  }

  TrialPointer RunLike(const ModelAdjustment& like) {
    TrialPointer bent;
    if (like.bend) bent = AdjustBent(FindBend(), like.bend->followed);
    return bent && bent->bundle.usable ? std::move(bent) : AdjustStraight();
  }

 private:
  // More of the lens where that explains the photos better. The centre comes last: a scan that
  // leaves a direction open takes a shift along it for one of the centre.
  TrialPointer AdjustStraight() const {
    const Freed first = input_.lens == LensChoice::kFree            ? Freed::kAll
                        : input_.lens == LensChoice::kFreeButCentre ? Freed::kNotCentre
                                                                    : Freed::kNothing;
    TrialPointer best = Try(start_, std::nullopt, first);
    if (input_.lens == LensChoice::kByScan || input_.lens == LensChoice::kFreeButCentre) {
      TrialPointer freed = Try(start_, std::nullopt, Freed::kAll);
      if (IsLensBetter(best->bundle, freed->bundle)) best = std::move(freed);
    }
    return best;
  }

  // The scan's bend; none if it is not asked for or there is none.
  std::optional<BendFit> FindBend() const {
    const bool fixed = options_.fix_clicked_view && !input_.clicked_image.empty();
    if (!options_.bend || fixed) return std::nullopt;
    return FitScanBend(input_.model, input_.points, input_.scans, input_.patches, input_.picks,
                       input_.used, input_.pick_sigma_px, start_, options_.min_bend);
  }

  // To a scan that is bent by this share of what was found; null without a bend.
  TrialPointer AdjustBent(std::optional<BendFit> bend, double followed) const {
    if (!bend) return nullptr;
    const Similarity start = bend->scan_from_sparse;
    bend->followed = followed;
    bend->bend.coefficients *= followed;
    return Try(start, std::move(bend), Freed::kNothing);
  }

  TrialPointer Try(const Similarity& start, std::optional<BendFit> bend, Freed freed) const {
    return std::make_unique<Trial>(input_, start, std::move(bend), freed, options_);
  }

  // The straight scan again, from where the bent one has brought the model: what looks like a bend
  // may only have been the better start (a large room, blurred photos, few of them), and then there
  // is no cost left between the two.
  bool IsStraightAfterAll(const Trial& bent) const {
    PlaneBundleInput again{bent.bundle.model,    input_.planes, input_.patches,
                           input_.picks,         input_.used,   input_.pick_sigma_px,
                           input_.clicked_image, ScanBend(),    input_.lens_of_camera,
                           input_.told};
    again.sigma_px = bent.bundle.sigma_px;
    again.pick_bend_px = input_.pick_bend_px;
    return !IsScanBent(AdjustToSurface(again, bent.options), bent.bundle);
  }

  const ModelAdjustmentInput& input_;
  const Similarity& start_;
  const PlaneBundleOptions& options_;
};

}  // namespace

bool IsLensBetter(const PlaneBundle& held, const PlaneBundle& freed) {
  return IsBetter(held, freed, kMinLensShare, kMinLensGain);
}

namespace {

ModelAdjustment ResultOf(TrialPointer trial, const ModelAdjustmentInput& input,
                         const Similarity& start) {
  ModelAdjustment result;
  result.scan_from_sparse = start;
  result.bundle = std::move(trial->bundle);
  if (!result.bundle.usable) return result;
  result.bend = trial->bend;
  result.freed = trial->options.refine_intrinsics;
  result.scan_from_sparse = result.bundle.adjusted_from_input * trial->scan_from_sparse;
  PlaneBundleOptions open = trial->options;
  open.refine_intrinsics |= input.freed_with_rows;
  BundleCovariances covariances = FindCovariances(trial->input, result.bundle, open);
  result.covariances = std::move(covariances.poses);
  result.camera_covariances = std::move(covariances.cameras);
  return result;
}

}  // namespace

ModelAdjustment AdjustModel(const ModelAdjustmentInput& input, const Similarity& start,
                            const PlaneBundleOptions& options, int num_threads) {
  std::optional<PlaneBundle> straight;
  TrialPointer trial = Adjuster(input, start, options).Run(num_threads, &straight);
  ModelAdjustment result = ResultOf(std::move(trial), input, start);
  result.straight = std::move(straight);
  return result;
}

ModelAdjustment AdjustModelLike(const ModelAdjustment& like, const ModelAdjustmentInput& input,
                                const Similarity& start, const PlaneBundleOptions& options) {
  return ResultOf(Adjuster(input, start, options).RunLike(like), input, start);
}

}  // namespace roomtex
