#include "align/fit/plane_bundle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "align/fit/bent_model.h"
#include "align/fit/plane_bundle_costs.h"
#include "align/fit/plane_bundle_round.h"
#include "colmap_ext/photo_bundle.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/projections.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Fewer points on the surface than this make no adjustment.
constexpr size_t kMinConstraints = 30;
// Gates of the rounds, in standard deviations; the last one stays.
constexpr double kGates[] = {6, 5, 4, 3.5};
// Metres; a point nearer to a camera that sees it is none of the room.
constexpr double kNearest = 0.01;
// A photo with fewer observations takes no part: its pose follows the others.
constexpr int kMinObservations = 12;
// The adjusted model may differ from the input by a similarity of this much ...
constexpr double kMaxScaleChange = 0.10, kMaxMove = 0.5;  // share; metres, of the middle camera
// ... and a photo may move against the others by this share of the model's extent, at least 5 cm,
// and turn by 3 degrees: a scan bent by 1 % asks for a third of it. A photo that goes farther takes
// no part; if more than this share of the photos do, the adjustment is not used.
constexpr double kMaxBending = 0.04, kMinBendingLimit = 0.05, kMaxTurn_deg = 3;
constexpr double kMaxShareRunaway = 0.05;
// ... times this where a rolling shutter has bent the model that comes.
constexpr double kMoreRolled = 4;
// The rms reprojection error may grow by this factor, or by these pixels if that is more ...
constexpr double kMaxReprojectionGrowth = 4, kMaxReprojectionRise_px = 4;
// ... and the picks may miss by so many standard deviations (rms), or this share of the photo's
// diagonal if that is more (as TrustOptions::PickRmsLimit).
constexpr double kMaxPickDeviations = 6, kMaxPickShare = 0.004;
// ... or this many times what model and scan disagree in anyway.
constexpr double kMaxBendDeviations = 3;

// By image_id.
std::map<uint32_t, double> PhotoCosts(const SparseModel& model, double sigma_px) {
  const auto projections = ProjectionsOf(model.cameras);
  std::map<uint32_t, double> costs;
  for (const auto& [id, point] : model.points) {
    for (const TrackElement& element : point.track) {
      const SparseImage& image = model.images.at(element.image_id);
      const auto error = projections.at(image.camera_id)
                             .ImgError(image.cam_from_model * point.x_in_model,
                                       image.points2d[element.point2d_index]);
      if (error) costs[image.image_id] += HuberCost(error->norm() / sigma_px, kReprojectionHuber);
    }
  }
  return costs;
}

bool IsSettled(const SparseModel& before, const SparseModel& after) {
  for (const auto& [id, image] : after.images) {
    if (HasMoved(before.images.at(id).cam_from_model, image.cam_from_model, 1)) return false;
  }
  return true;
}

double SurfaceRms(const SparseModel& model, const std::vector<SurfaceConstraint>& constraints) {
  double sum = 0;
  for (const SurfaceConstraint& c : constraints) {
    sum += std::pow(c.Distance(model.points.at(c.point3d_id).x_in_model), 2);
  }
  return constraints.empty() ? 0 : std::sqrt(sum / static_cast<double>(constraints.size()));
}

// The similarity between two states of a model: cameras and points on the surface. The points
// that nothing holds would outvote them by their distance.
Similarity FitModels(const SparseModel& from, const SparseModel& to,
                     const std::vector<SurfaceConstraint>& constraints,
                     const std::set<uint32_t>& idle_images) {
  const int num_cameras = static_cast<int>(from.images.size() - idle_images.size());
  const int n = num_cameras + static_cast<int>(constraints.size());
  Eigen::Matrix3Xd source(3, n), target(3, n);
  int i = 0;
  for (const auto& [id, image] : from.images) {
    if (idle_images.count(id) > 0) continue;
    source.col(i) = image.cam_from_model.TargetOriginInSource();
    target.col(i++) = to.images.at(id).cam_from_model.TargetOriginInSource();
  }
  for (const SurfaceConstraint& c : constraints) {
    source.col(i) = from.points.at(c.point3d_id).x_in_model;
    target.col(i++) = to.points.at(c.point3d_id).x_in_model;
  }
  return FitSimilarity(source, target);
}

// RMS distance of cameras and constrained points from their middle, metres.
double Extent(const SparseModel& model, const std::vector<SurfaceConstraint>& constraints) {
  std::vector<Eigen::Vector3d> places;
  for (const auto& [id, image] : model.images) {
    places.push_back(image.cam_from_model.TargetOriginInSource());
  }
  for (const SurfaceConstraint& c : constraints) {
    places.push_back(model.points.at(c.point3d_id).x_in_model);
  }
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& x : places) middle += x / static_cast<double>(places.size());
  double sum = 0;
  for (const Eigen::Vector3d& x : places) sum += (x - middle).squaredNorm();
  return std::sqrt(sum / static_cast<double>(places.size()));
}

// Rays of photos that were taken at one place, as the faces of a panorama, meet in the cameras.
// Such a point has no derivatives, and where the cameras move by a millimetre its error is that of
// another half of the picture.
void RemovePointsInCameras(SparseModel* model) {
  const auto is_in_camera = [&](const SparsePoint& point) {
    return std::any_of(point.track.begin(), point.track.end(), [&](const TrackElement& element) {
      const Rigid& cam_from_model = model->images.at(element.image_id).cam_from_model;
      return (cam_from_model * point.x_in_model).norm() < kNearest;
    });
  };
  for (auto it = model->points.begin(); it != model->points.end();) {
    if (!is_in_camera(it->second)) {
      ++it;
      continue;
    }
    for (const TrackElement& element : it->second.track) {
      model->images.at(element.image_id).point3d_ids[element.point2d_index] = kInvalidPoint3dId;
    }
    it = model->points.erase(it);
  }
}

// Photos that took no part get the pose of the similarity between input and adjusted model, and
// points that did not follow it, too; also those that an earlier round moved before their photos
// ran away.
void MoveIdle(const PlaneBundleInput& input, PlaneBundle* result) {
  const Similarity& moved = result->adjusted_from_input;
  for (const uint32_t id : result->idle_images) {
    result->model.images.at(id).cam_from_model =
        CamFromScan(input.model.images.at(id).cam_from_model, moved);
  }
  for (auto& [id, point] : result->model.points) {
    const Eigen::Vector3d& before = input.model.points.at(id).x_in_model;
    const auto num_seen =
        std::count_if(point.track.begin(), point.track.end(), [&](const TrackElement& element) {
          return result->idle_images.count(element.image_id) == 0;
        });
    if (num_seen < 2 || point.x_in_model == before || !point.x_in_model.allFinite()) {
      point.x_in_model = moved * before;
    }
  }
}

// Tells photos that move by themselves from those of one frame of a rig, which move as one.
uint64_t FrameOf(const SparseImage& image) {
  constexpr uint64_t kFrames = uint64_t{1} << 32;
  return image.frame_id == kNoFrame ? image.image_id : kFrames + image.frame_id;
}

// Compares the adjusted model with the input; a sentence if it went farther than a correction can.
// Single photos that did are put back and take no part from then on.
std::string StopRunaway(const PlaneBundleInput& input, const PlaneBundleOptions& options,
                        PlaneBundle* result) {
  result->adjusted_from_input =
      FitModels(input.model, result->model, result->constraints, result->idle_images);
  const Similarity& moved = result->adjusted_from_input;
  const double limit =
      (options.rolled ? kMoreRolled : 1) *
      std::max(kMinBendingLimit, kMaxBending * Extent(input.model, result->constraints));
  std::vector<double> moves;
  double widest_turn = 0;
  std::vector<uint32_t> runaway;
  result->max_bending = 0;
  for (const auto& [id, image] : input.model.images) {
    if (result->idle_images.count(id) > 0) continue;
    const Rigid& adjusted = result->model.images.at(id).cam_from_model;
    const Rigid expected = CamFromScan(image.cam_from_model, moved);
    const Eigen::Vector3d centre = adjusted.TargetOriginInSource();
    const double bending = (centre - expected.TargetOriginInSource()).norm();
    const double turn = RotationAngle(adjusted.rotation, expected.rotation);
    moves.push_back((centre - image.cam_from_model.TargetOriginInSource()).norm());
    const bool held = options.fix_clicked_view && image.name == input.clicked_image;
    if (!held && !(bending <= limit && turn <= RadFromDeg(kMaxTurn_deg))) {
      runaway.push_back(id);
    } else {
      result->max_bending = std::max(result->max_bending, bending);
      widest_turn = std::max(widest_turn, turn);
    }
  }
  if (!(std::abs(moved.scale - 1) <= kMaxScaleChange) || !(Median(moves) <= kMaxMove)) {
    return "The adjustment to the scan's surface ran away: it moves half of the photos by more "
           "than " +
           Number(Median(moves), 2) + " m and changes the scale by " +
           Number(100 * (moved.scale - 1), 1) + " %.";
  }
  // The cameras of a rig move as one.
  std::set<uint64_t> frames, frames_away;
  for (const auto& [id, image] : input.model.images) {
    if (result->idle_images.count(id) == 0) frames.insert(FrameOf(image));
  }
  for (const uint32_t id : runaway) frames_away.insert(FrameOf(input.model.images.at(id)));
  const double share = static_cast<double>(frames_away.size()) / static_cast<double>(frames.size());
  if (frames_away.size() > 1 && share > kMaxShareRunaway) {
    return "The adjustment to the scan's surface bends the model: it moves " +
           std::to_string(runaway.size()) + " of " + std::to_string(moves.size()) +
           " photos against the others by more than " + Number(limit, 3) + " m or " +
           Number(kMaxTurn_deg, 0) + " degrees.";
  }
  for (const uint32_t id : runaway) {
    const uint32_t frame_id = input.model.images.at(id).frame_id;
    result->ran_away.insert(id);
    for (const auto& [other, image] : input.model.images) {
      if (frame_id != kNoFrame && image.frame_id == frame_id) result->ran_away.insert(other);
    }
  }
  result->idle_images.insert(result->ran_away.begin(), result->ran_away.end());
  if (!runaway.empty()) {
    result->adjusted_from_input =
        FitModels(input.model, result->model, result->constraints, result->idle_images);
    MoveIdle(input, result);
  }
  return "";
}

// RMS error of the used picks, by their weights, over its limit.
double PickExcess(const PlaneBundleInput& input, const SparseModel& model) {
  const auto projections = ProjectionsOf(model.cameras);
  double sum = 0, sum_of_weights = 0, diagonal = 0;
  for (size_t i = 0; i < input.picks.size(); ++i) {
    const SparseImage* const image = model.FindImage(input.picks[i].image_name);
    if (!input.used[i] || image == nullptr) continue;
    const CameraProjection& projection = projections.at(image->camera_id);
    const Camera& camera = projection.camera();
    const auto error = projection.ImgError(image->cam_from_model * input.picks[i].x_in_scan,
                                           input.picks[i].x_in_img);
    diagonal = std::max(diagonal, std::hypot(camera.width, camera.height));
    const double weight = input.picks[i].weight * input.picks[i].weight;
    sum += weight * (error ? error->squaredNorm() : diagonal * diagonal);
    sum_of_weights += weight;
  }
  const double limit = std::max({kMaxPickDeviations * input.pick_sigma_px, kMaxPickShare * diagonal,
                                 kMaxBendDeviations * input.pick_bend_px});
  return sum_of_weights > 0 ? std::sqrt(sum / sum_of_weights) / limit : 0;
}

// What is wrong with the result as a whole; empty if nothing is.
std::string FindFault(const PlaneBundleInput& input, const PlaneBundle& result) {
  for (const auto& [id, camera] : result.model.cameras) {
    const std::vector<std::string> problems = camera.Problems();
    if (!problems.empty()) {
      return "The adjustment to the scan's surface spoiled a camera: " + problems[0] + ".";
    }
  }
  if (!(result.plane_rms_after <= result.plane_rms_before * 1.01 + 1e-4)) {
    return "The adjustment to the scan's surface did not bring the points nearer to it (rms " +
           Number(1000 * result.plane_rms_before, 1) + " mm before, " +
           Number(1000 * result.plane_rms_after, 1) + " mm after).";
  }
  const double limit = std::max(kMaxReprojectionGrowth * result.reprojection_rms_before,
                                result.reprojection_rms_before + kMaxReprojectionRise_px);
  if (!(result.reprojection_rms_after <= limit)) {
    return "Photos and scan contradict each other: on the scan's surface the reprojection errors "
           "grow from " +
           Number(result.reprojection_rms_before, 2) + " to " +
           Number(result.reprojection_rms_after, 2) + " pixels (rms).";
  }
  const double pick_excess = PickExcess(input, result.model);
  if (!(pick_excess <= 1)) {
    return "Picks and surface contradict each other: adjusted to the scan's surface, the photos "
           "miss the picks by " +
           Number(pick_excess, 1) + " times what is allowed.";
  }
  return "";
}

// The points that lie on the surface of the scan as it is.
std::vector<SurfaceConstraint> FindConstraints(const PlaneBundleInput& input, int min_track,
                                               const PlaneAssociationOptions& association,
                                               const PlaneBundle& state) {
  std::vector<SurfacePoint> points =
      FindSurfacePoints(state.model, TrackThatCounts(state.model, min_track), state.sigma_px,
                        std::numeric_limits<size_t>::max());
  for (SurfacePoint& point : points) point.x_in_sparse = input.bend.Bend(point.x_in_sparse);
  return AssociateWithSurface(points, input.planes, input.patches, association);
}

// The same for the room as it is: every surface moved back by the bend at its point.
std::vector<SurfaceConstraint> Straightened(std::vector<SurfaceConstraint> constraints,
                                            const SparseModel& model, const ScanBend& bend) {
  if (bend.IsNone()) return constraints;
  for (SurfaceConstraint& c : constraints) {
    const Eigen::Vector3d& x_in_scan = model.points.at(c.point3d_id).x_in_model;
    c.point -= bend.Bend(x_in_scan) - x_in_scan;
  }
  return constraints;
}

// Photos that the sparse points do not hold, those of one frame together.
void FindIdleImages(const PlaneBundleInput& input, const PlaneBundleOptions& options,
                    PlaneBundle* result) {
  std::map<uint32_t, long> seen_by_frame;
  for (const auto& [id, image] : input.model.images) {
    const auto seen =
        std::count_if(image.point3d_ids.begin(), image.point3d_ids.end(), [&](uint64_t point_id) {
          return point_id != kInvalidPoint3dId && input.model.points.at(point_id).track.size() >= 2;
        });
    seen_by_frame[FrameOf(image)] += seen;
  }
  for (const auto& [id, image] : input.model.images) {
    if (options.fix_clicked_view && image.name == input.clicked_image) continue;
    if (seen_by_frame.at(FrameOf(image)) < kMinObservations) result->idle_images.insert(id);
  }
}

// Keypoints where they would be had all rows been read with the middle one. Photos that ran away
// keep theirs: nothing is known of their motion.
void StopRows(PlaneBundle* result) {
  SparseModel& model = result->model;
  for (const uint32_t id : result->idle_images) result->motions.erase(id);
  const auto projections = ProjectionsOf(model.cameras);
  for (const auto& [id, motion] : result->motions) {
    SparseImage& image = model.images.at(id);
    const CameraProjection& projection = projections.at(image.camera_id);
    for (size_t k = 0; k < image.points2d.size(); ++k) {
      if (image.point3d_ids[k] == kInvalidPoint3dId) continue;
      const auto point = model.points.find(image.point3d_ids[k]);
      if (point == model.points.end()) continue;
      image.points2d[k] = KeypointOfStillRows(
          projection, motion, image.cam_from_model * point->second.x_in_model, image.points2d[k]);
    }
  }
}

// Runs the rounds; a sentence if one of them fails.
std::string RunRounds(const PlaneBundleInput& input, const PlaneBundleOptions& options,
                      PlaneBundle* result) {
  PlaneAssociationOptions association = options.association;
  FindIdleImages(input, options, result);
  for (const auto& [id, image] : input.model.images) {
    const bool alone = image.frame_id == kNoFrame && result->idle_images.count(id) == 0;
    if (options.row_motion && alone) result->motions[id] = RowMotion();
  }
  for (int round = 0; round < options.num_rounds; ++round) {
    association.gate = kGates[std::min<size_t>(round, std::size(kGates) - 1)];
    result->constraints = FindConstraints(input, options.min_track, association, *result);
    if (result->constraints.size() < kMinConstraints) {
      return "Only " + std::to_string(result->constraints.size()) +
             " sparse points lie on the scan's planes" +
             (options.association.surface ? " or flat patches" : "") +
             ", too few to adjust the poses to them.";
    }
    const SparseModel before = result->model;
    const auto straight = Straightened(result->constraints, result->model, input.bend);
    const BundleRound problem_of_round{input, options, result->sigma_px, result->idle_images,
                                       straight};
    if (!SolveRound(problem_of_round, &result->model, &result->motions)) {
      return "The adjustment to the scan's surface found no solution.";
    }
    result->num_rounds = round + 1;
    const std::string problem = StopRunaway(input, options, result);
    if (!problem.empty()) return problem;
    if (association.gate <= kGates[std::size(kGates) - 1] && IsSettled(before, result->model)) {
      break;
    }
  }
  return "";
}

}  // namespace

void PlaneBundleOptions::Declare(OptionFields* fields) {
  fields
      ->Number("PlaneBA.beta", &beta,
               "Pixels per metre; weight of a point's distance from its plane against its "
               "reprojection errors, the thesis' beta; larger = nearer to the scan; 0 = from "
               "the ratio of image noise and scan noise.")
      .NotNegative()
      .Finite();
  fields
      ->Number("PlaneBA.max_distance", &association.max_distance,
               "Metres; a sparse point farther from a surface never belongs to it; larger = "
               "more tolerant.")
      .Positive();
  fields->Bool("PlaneBA.surface", &association.surface,
               "Points on no plane are held by flat patches of the scan; 0 = planes alone.");
  fields
      ->Number("PlaneBA.surface_noise", &association.surface_noise,
               "Metres; what stays unknown of a surface however many samples show it; larger "
               "= farther from the scan.")
      .Positive();
  fields
      ->Int("PlaneBA.min_track", &min_track,
            "Observations that a sparse point needs to be held on a surface; one of two must be "
            "known to a centimetre. A model with fewer than " +
                std::to_string(kFewPoints) + " such points uses those of two, too.")
      .AtLeast(2);
  fields->Bool("PlaneBA.fix_clicked_view", &fix_clicked_view,
               "The photo of the picks keeps the pose that they give, as in the thesis (and no "
               "bend of the scan is looked for); 0 = its picks hold it as far as their noise "
               "allows.");
  fields->Bool("PlaneBA.bend", &bend,
               "Look for a smooth bend of the scan (ranges, azimuths; one scan with a grid) and "
               "fit the photos to the bent scan.");
  fields
      ->Number("PlaneBA.min_bend", &min_bend,
               "Metres, rms over the sparse points; a smaller bend counts as none.")
      .NotNegative();
  fields->Bool(
      "PlaneBA.rolling_shutter", &rolling_shutter,
      "Look for a rolling shutter (a camera that moves while the rows of a photo are read) "
      "and place photos that have one by their middle row; 0 = all rows at once.");
  fields
      ->Int("PlaneBA.num_rounds", &num_rounds,
            "Rounds in which points are given to surfaces anew; fewer if nothing changes.")
      .Within(1, 100);
  fields
      ->Int("PlaneBA.max_iterations", &max_iterations,
            "Steps of each round, at most; larger = slower.")
      .Positive();
}

std::vector<std::string> PlaneBundleOptions::Problems() const { return ProblemsOf(*this); }

double SharedImageCost(const PlaneBundle& bundle, const PlaneBundle& other) {
  double cost = 0;
  for (const auto& [id, of_photo] : bundle.photo_costs) {
    if (bundle.idle_images.count(id) == 0 && other.idle_images.count(id) == 0) cost += of_photo;
  }
  return cost;
}

PlaneBundle AdjustToSurface(const PlaneBundleInput& input, const PlaneBundleOptions& options) {
  PlaneBundle result;
  result.model = input.model;
  RemovePointsInCameras(&result.model);
  result.reprojection_rms_before = UpdateReprojectionErrors(&result.model).rms_px;
  result.sigma_px = input.sigma_px > 0 ? input.sigma_px : KeypointNoise(result.model);
  result.reason = RunRounds(input, options, &result);
  if (result.reason.empty()) {
    MoveIdle(input, &result);
    StopRows(&result);
    result.plane_rms_before = SurfaceRms(input.model, result.constraints);
    result.photo_costs = PhotoCosts(result.model, result.sigma_px);
    result.model = BendModel(result.model, input.bend);
    result.plane_rms_after = SurfaceRms(result.model, result.constraints);
    result.reprojection_rms_after = UpdateReprojectionErrors(&result.model).rms_px;
    result.num_points_of_plane.assign(input.planes.size(), 0);
    for (const SurfaceConstraint& c : result.constraints) {
      if (c.plane >= 0) ++result.num_points_of_plane[c.plane];
    }
    result.reason = FindFault(input, result);
  }
  result.usable = result.reason.empty();
  if (!result.usable) {
    result.model = input.model;
    result.reprojection_rms_after = UpdateReprojectionErrors(&result.model).rms_px;
  }
  return result;
}

}  // namespace roomtex
