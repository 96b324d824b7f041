#include "align/rolling_shutter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "colmap_ext/photo_bundle.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Of the cost of the photos, by which motion has to lower it. Simulated rooms with 20 and 30 ms of
// rolling shutter: 0.2 to 0.75; without: 0.002 to 0.012; a drifting scan whose photos are in doubt
// (kitchen): 0.10.
constexpr double kMinGain = 0.25;
// The first look: so many rounds of so many steps. It has to promise half of what is asked for.
constexpr int kLookRounds = 1, kLookIterations = 6;
constexpr double kLookShare = 0.5;

// This much is enough where without its shutter the model has the shape of the scan (kSameShape):
// 10 to 20 ms (random captures 129, 130, 203: 0.21, 0.075, 0.08), or 30 ms of bare walls (185:
// 0.13). Drift that motion takes up (kitchen: 0.10) leaves the two different in shape. Where the
// scan is taken for bent it must also be so many times what the bend lowers the cost by: a shutter
// bends the sparse model, too.
constexpr double kMinGainOfOneShape = 0.05, kMuchMore = 2;
// What promises less than that at the first look and is then so many times as far from the shape of
// the scan no better motion or lens brings to it: 26 mm, in the end 24 (kitchen); 7 and 7 (130), 6
// and 6 (203).
constexpr double kFarFromShape = 2;

double Gain(const PlaneBundle& still, const PlaneBundle& moving) {
  if (!still.usable || !moving.usable) return 0;
  return 1 - SharedImageCost(moving, still) / SharedImageCost(still, moving);
}

// Another focal length down the rows than across them, which a camera that is told wrong has, looks
// like a hand that nods alike in all photos: by so many times what the photos scatter. Then motion
// has to explain what a lens does not.
constexpr double kMostAlike = 1.5;

bool AllNodAlike(const SparseModel& model, const RowMotions& motions) {
  double sum = 0, squares = 0;
  for (const auto& [id, motion] : motions) {
    const bool upright = RowsAreUpright(model.cameras.at(model.images.at(id).camera_id));
    // Down the rows: about x, of upright ones the other way about y.
    const double nod = upright ? -motion.turn.y() : motion.turn.x();
    sum += nod;
    squares += nod * nod;
  }
  const double count = static_cast<double>(motions.size()), mean = sum / count;
  return std::abs(mean) > kMostAlike * std::sqrt(std::max(0.0, squares / count - mean * mean));
}

bool HasRigs(const SparseModel& model) {
  return std::any_of(model.images.begin(), model.images.end(),
                     [](const auto& image) { return image.second.frame_id != kNoFrame; });
}

// The fit's model, to be adjusted to the scan as it is.
class StraightAdjustment {
 public:
  StraightAdjustment(const AlignmentInput& input, const AlignmentStart& start,
                     const AlignmentFit& fit, const LensCheck& lenses,
                     const AlignmentOptions& options)
      : options_(options.bundle),
        in_scan_(input.model),
        input_{in_scan_,
               input.surveyed.planes(),
               input.surveyed.patches(),
               input.picks,
               start.UsedPicks(),
               start.pick_sigma_px,
               start.image_name,
               ScanBend(),
               lenses.lens_of_camera,
               lenses.ToldCameras(input.model)} {
    TransformModel(fit.scan_from_sparse, &in_scan_);
    input_.pick_bend_px = fit.pick_bend_px;
    options_.fix_clicked_view = false;
  }
  StraightAdjustment(const StraightAdjustment&) = delete;

  PlaneBundleOptions Options(bool row_motion) const {
    PlaneBundleOptions options = options_;
    options.row_motion = options.rolled = row_motion;
    return options;
  }
  PlaneBundle Adjust(const PlaneBundleOptions& options) const {
    return AdjustToSurface(input_, options);
  }

 private:
  PlaneBundleOptions options_;
  SparseModel in_scan_;
  PlaneBundleInput input_;
};

// What the photos would show if their cameras stood still.
RollingShutter WithStillRows(const AlignmentInput& input, const AlignmentFit& fit,
                             const PlaneBundle& moving) {
  RollingShutter still;
  still.picks = input.picks;
  for (Pick& pick : still.picks) {
    const SparseImage* const image = moving.model.FindImage(pick.image_name);
    if (image == nullptr || moving.motions.count(image->image_id) == 0) continue;
    const CameraProjection projection(moving.model.cameras.at(image->camera_id));
    pick.x_in_img = KeypointOfStillRows(projection, moving.motions.at(image->image_id),
                                        image->cam_from_model * pick.x_in_scan, pick.x_in_img);
  }
  still.motions = moving.motions;
  still.model = moving.model;
  TransformModel(fit.scan_from_sparse.Inverse(), &still.model);
  // As the photos have it: on the surface nothing would show how far the two differ.
  still.model = AdjustedByPhotos(still.model, KeypointNoise(still.model));
  return still;
}

// AlignmentFit::ShapeDifference() of what the photos then show.
double ShapeDifference(const AlignmentInput& input, const AlignmentStart& start,
                       const RollingShutter& rolling, const AlignmentOptions& options) {
  const AlignmentFit fit = FitAlignment(input.With(rolling.model, input.surveyed, rolling.picks),
                                        start, KeypointSigma(rolling.model), options);
  return fit.ShapeDifference();
}

}  // namespace

double RollingShutter::MedianTurn() const {
  std::vector<double> turns;
  for (const auto& [id, motion] : motions) turns.push_back(motion.turn.norm());
  return Median(&turns);
}

double RollingShutter::MedianMove() const {
  std::vector<double> moves;
  for (const auto& [id, motion] : motions) moves.push_back(motion.move.norm());
  return Median(&moves);
}

std::optional<RollingShutter> FindRollingShutter(const AlignmentInput& input,
                                                 const AlignmentStart& start,
                                                 const AlignmentFit& fit, const LensCheck& lenses,
                                                 const ModelAdjustment& still,
                                                 const AlignmentOptions& options) {
  if (HasRigs(input.model)) return std::nullopt;
  const StraightAdjustment straight(input, start, fit, lenses, options);
  const PlaneBundleOptions standing = straight.Options(false);
  PlaneBundleOptions rolling = straight.Options(true);
  const auto glance = [&](PlaneBundleOptions bundle) {
    bundle.num_rounds = kLookRounds;
    bundle.max_iterations = kLookIterations;
    return straight.Adjust(bundle);
  };
  PlaneBundle glances[2];
  ParallelFor(input.num_threads, 0, 2,
              [&](int k) { glances[k] = glance(k == 0 ? standing : rolling); });
  const double look = Gain(glances[0], glances[1]);
  if (!(look > kLookShare * kMinGainOfOneShape)) return std::nullopt;
  const auto shape_with = [&](const RollingShutter& found) {
    return ShapeDifference(input, start, found, options);
  };
  if (look < kLookShare * kMinGain &&
      !(shape_with(WithStillRows(input, fit, glances[1])) <= kFarFromShape * kSameShape)) {
    return std::nullopt;
  }
  const PlaneBundle& unbent = still.straight ? *still.straight : still.bundle;
  PlaneBundle moving = straight.Adjust(rolling);
  const double gain = Gain(unbent, moving);
  if (!(gain > kMinGainOfOneShape)) return std::nullopt;
  if (still.bend && !(gain > kMuchMore * Gain(unbent, still.bundle))) return std::nullopt;

  bool is_freed = false;
  if (options.refine_intrinsics != RefineIntrinsics::kNever) {
    rolling.refine_intrinsics = true;
    PlaneBundle freed = straight.Adjust(rolling);
    is_freed = IsLensBetter(moving, freed);
    if (is_freed) moving = std::move(freed);
  }
  if (AllNodAlike(moving.model, moving.motions)) {
    PlaneBundleOptions lens_alone = standing;
    lens_alone.refine_intrinsics = lens_alone.rolled = true;
    const double beyond_lens = Gain(straight.Adjust(lens_alone), moving);
    if (!(beyond_lens > kMinGain)) return std::nullopt;
  }
  RollingShutter found = WithStillRows(input, fit, moving);
  if (!(gain > kMinGain) && !(shape_with(found) <= kSameShape)) return std::nullopt;
  found.freed = is_freed;
  found.cost_still = SharedImageCost(unbent, moving);
  found.cost_moving = SharedImageCost(moving, unbent);
  return found;
}

}  // namespace roomtex
