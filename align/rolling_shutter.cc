#include "align/rolling_shutter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "colmap_ext/photo_bundle.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Of the cost of the photos, by which motion has to lower it. Simulated rooms with 20 and 30 ms of
// rolling shutter: 0.4 to 0.6; without: 0.002 to 0.012; a drifting scan whose photos are in doubt
// (kitchen): 0.11.
constexpr double kMinGain = 0.25;
// The first look: so many rounds of so many steps. It has to promise half of that.
constexpr int kLookRounds = 1, kLookIterations = 6;
constexpr double kLookShare = 0.5;

double Gain(const PlaneBundle& still, const PlaneBundle& moving) {
  if (!still.usable || !moving.usable) return 0;
  return 1 - moving.image_cost / still.image_cost;
}

// Another focal length down the rows than across them, which a camera that is told wrong has, looks
// like a hand that nods alike in all photos: by so many times what the photos scatter.
constexpr double kMostAlike = 1.5;

bool AllNodAlike(const std::map<uint32_t, RowMotion>& motions) {
  double sum = 0, squares = 0;
  for (const auto& [id, motion] : motions) {
    sum += motion.turn.x();
    squares += motion.turn.x() * motion.turn.x();
  }
  const double count = static_cast<double>(motions.size()), mean = sum / count;
  return std::abs(mean) > kMostAlike * std::sqrt(std::max(0.0, squares / count - mean * mean));
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
                                                 const PlaneBundle& still,
                                                 const AlignmentOptions& options) {
  if (std::any_of(input.model.images.begin(), input.model.images.end(),
                  [](const auto& image) { return image.second.frame_id != kNoFrame; })) {
    return std::nullopt;
  }
  SparseModel in_scan = input.model;
  TransformModel(fit.scan_from_sparse, &in_scan);
  PlaneBundleInput bundle_input{in_scan,
                                input.surveyed.planes(),
                                input.surveyed.patches(),
                                input.picks,
                                start.UsedPicks(),
                                start.pick_sigma_px,
                                start.image_name,
                                ScanBend(),
                                lenses.lens_of_camera,
                                lenses.ToldCameras(input.model)};
  bundle_input.pick_bend_px = fit.pick_bend_px;
  PlaneBundleOptions standing = options.bundle;
  standing.fix_clicked_view = false;
  PlaneBundleOptions rolling = standing;
  rolling.row_motion = true;
  const auto glance = [&](PlaneBundleOptions bundle) {
    bundle.num_rounds = kLookRounds;
    bundle.max_iterations = kLookIterations;
    return AdjustToSurface(bundle_input, bundle);
  };
  const double look = Gain(glance(standing), glance(rolling));
  if (!(look > kLookShare * kMinGain)) return std::nullopt;
  PlaneBundle moving = AdjustToSurface(bundle_input, rolling);
  if (!(Gain(still, moving) > kMinGain)) return std::nullopt;

  RollingShutter found;
  if (options.refine_intrinsics != RefineIntrinsics::kNever) {
    rolling.refine_intrinsics = true;
    PlaneBundle freed = AdjustToSurface(bundle_input, rolling);
    found.freed = IsLensBetter(moving, freed);
    if (found.freed) moving = std::move(freed);
  }
  if (AllNodAlike(moving.motions)) return std::nullopt;
  found.cost_still = still.image_cost;
  found.cost_moving = moving.image_cost;
  found.picks = input.picks;
  for (Pick& pick : found.picks) {
    const SparseImage* const image = moving.model.FindImage(pick.image_name);
    if (image == nullptr || moving.motions.count(image->image_id) == 0) continue;
    const CameraProjection projection(moving.model.cameras.at(image->camera_id));
    pick.x_in_img = KeypointOfStillRows(projection, moving.motions.at(image->image_id),
                                        image->cam_from_model * pick.x_in_scan, pick.x_in_img);
  }
  found.motions = std::move(moving.motions);
  found.model = std::move(moving.model);
  TransformModel(fit.scan_from_sparse.Inverse(), &found.model);
  // As the photos have it: on the surface nothing would show how far the two differ.
  found.model = AdjustedByPhotos(found.model, KeypointNoise(found.model));
  return found;
}

}  // namespace roomtex
