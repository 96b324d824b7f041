#include "align/alignment.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <sstream>

#include "align/clicks/pose_choice.h"
#include "align/fit/joint_picks.h"
#include "align/judgement.h"
#include "core/error.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

// Metres from the nearest sample of the scan up to which a pick counts as being on the scan.
constexpr double kPickReach = 0.06;
constexpr double kSurfaceSpacing = 0.02;  // metres; of a mesh without a grid
// A scan is bent when straightening it lowers the cost of the photos in the adjusted model by this
// share, and by this much. Simulated rooms with a cost of 12 000 to 16 000: straight scans -24 to
// 35 (one of 17: 90), 0.2 % of the range 126, 0.3 % or 0.3 degrees 198 to 249, 1 % 1808.
constexpr double kMinBendShare = 0.008, kMinBendGain = 100;
// Metres, rms; a scanner that measures 1 % wrong (the worst that the thesis speaks of) at 2 to 3 m.
constexpr double kMaxLaserBend = 0.025;
constexpr size_t kMaxPicksOnScan =
    100;  // more are not needed to tell whether picks and scan belong together

std::string MirrorRemedy(const AlignmentInput& input) {
  const bool is_rtpi = std::any_of(input.scans.begin(), input.scans.end(),
                                   [](const Scan& scan) { return scan.is_rtpi; });
  if (!is_rtpi) return "Check the axes of the scan file: its coordinates seem to be left-handed";
  const std::string other = input.azimuth == "clockwise" ? "counterclockwise" : "clockwise";
  return "Read it with --azimuth " + other +
         " (in every command, and for picking: picks made on the mirrored scan have the wrong x)";
}

// The picks of one photo, and what they say.
struct View {
  std::string name;
  const SparseImage* image = nullptr;
  std::vector<int> picks;  // indices into AlignmentInput::picks
  PickReview review;
  ScaleEstimate scale;
  Rigid cam_from_scan;  // the pose that was chosen among those of the review
};

PointPairs PairsOf(const std::vector<Pick>& picks, const std::vector<int>& indices) {
  const int n = static_cast<int>(indices.size());
  PointPairs pairs{Eigen::Matrix2Xd(2, n), Eigen::Matrix3Xd(3, n), Eigen::VectorXd(n)};
  for (int i = 0; i < n; ++i) {
    pairs.x_in_img.col(i) = picks[indices[i]].x_in_img;
    pairs.x_in_scan.col(i) = picks[indices[i]].x_in_scan;
    pairs.weight[i] = picks[indices[i]].weight;
  }
  return pairs;
}

std::string Miss(double rms_px) {
  if (!std::isfinite(rms_px)) return "fit no camera pose that has all of them in front";
  return "miss by " + Number(rms_px, 1) + " pixels (rms)";
}

// Picks that say what is wrong with them are refused: nothing that follows from them means
// anything.
void RefuseMirroredOrExchanged(const AlignmentInput& input, const View& view) {
  const PickReview& review = view.review;
  if (review.mirrored && !(review.exchanged && review.exchanged_rms_px < review.mirrored_rms_px)) {
    throw Contradiction(input.scans[0].path, "",
                        "the scan is a mirror image of the room: the picks in " + view.name + " " +
                            Miss(review.RmsPx()) + ", but " + Miss(review.mirrored_rms_px) +
                            " when the scan is reflected",
                        MirrorRemedy(input));
  }
  if (!review.exchanged) return;
  const Pick& a = input.picks[view.picks[review.exchanged->first]];
  const Pick& b = input.picks[view.picks[review.exchanged->second]];
  throw Contradiction(input.picks_path, LinePosition(a.line),
                      "this pick and the one on line " + std::to_string(b.line) +
                          " look exchanged: the picks in " + view.name + " " +
                          Miss(review.RmsPx()) + ", but " + Miss(review.exchanged_rms_px) +
                          " when these two change places in the photo",
                      "Exchange their x,y, or pick them again");
}

// Distance of each point from the nearest point of the scans' surface, metres.
std::vector<double> DistancesFromScan(const std::vector<Scan>& scans,
                                      const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> distance2(points.size(), std::numeric_limits<double>::infinity());
  for (const Scan& scan : scans) {
    VisitSurface(scan, kSurfaceSpacing, [&](const Eigen::Vector3d& x_in_scan) {
      for (size_t i = 0; i < points.size(); ++i) {
        distance2[i] = std::min(distance2[i], (points[i] - x_in_scan).squaredNorm());
      }
    });
  }
  for (double& value : distance2) value = std::sqrt(value);
  return distance2;
}

// The picks lie on the surface of the scan that was read; if they lie on its mirror image instead,
// the file was read with the other azimuth sense than the one they were made with.
void CheckPicksOnScan(const AlignmentInput& input, std::vector<std::string>* warnings) {
  const Rigid& scan_from_station = input.scans[0].scan_from_station;
  std::vector<const Pick*> picks;
  for (const Pick& pick : input.picks) {
    if (pick.weight > 0 && picks.size() < kMaxPicksOnScan) picks.push_back(&pick);
  }
  const size_t n = picks.size();
  std::vector<Eigen::Vector3d> points(2 * n);
  for (size_t i = 0; i < n; ++i) {
    points[i] = picks[i]->x_in_scan;
    Eigen::Vector3d x_in_station = scan_from_station.Inverse() * points[i];
    x_in_station.x() *= -1;
    points[n + i] = scan_from_station * x_in_station;
  }
  const std::vector<double> distance = DistancesFromScan(input.scans, points);
  if (!std::isfinite(distance[0])) {
    throw InputError(input.scans[0].path, "", "holds no measured sample",
                     "Check the file with roomtex-import");
  }
  size_t off = 0, off_mirrored = 0, farthest = 0;
  for (size_t i = 0; i < n; ++i) {
    off += distance[i] > kPickReach;
    off_mirrored += distance[n + i] > kPickReach;
    if (distance[i] > distance[farthest]) farthest = i;
  }
  const std::string of_all = " of " + std::to_string(n) + " picks";
  if (off >= 2 && 3 * off_mirrored <= off) {
    throw Contradiction(input.scans[0].path, "",
                        "the scan is a mirror image of the one that the picks were made on: " +
                            std::to_string(off) + of_all + " lie more than " +
                            Number(kPickReach, 2) + " m off its surface, up to " +
                            Number(distance[farthest], 2) + " m, but " +
                            std::to_string(off_mirrored) + " when the scan is reflected",
                        MirrorRemedy(input));
  }
  for (size_t i = 0; i < n && 2 * off < n; ++i) {
    if (!(distance[i] > kPickReach)) continue;
    warnings->push_back("The pick on " + LineOf(*picks[i]) + " lies " + Number(distance[i], 2) +
                        " m off every surface of the scan.");
  }
  if (2 * off < n) return;
  throw Contradiction(input.picks_path, LinePosition(picks[farthest]->line),
                      std::to_string(off) + of_all + " lie more than " + Number(kPickReach, 2) +
                          " m off every surface of the scan, this one by " +
                          Number(distance[farthest], 2) + " m",
                      "Pick on this scan, and give scan_x, scan_y, scan_z in metres in its frame");
}

// Photos with enough picks, each with its review. Throws InputError if none of them fixes a pose.
std::vector<View> ReviewViews(const AlignmentInput& input, const AlignmentOptions& options,
                              std::vector<std::string>* warnings) {
  std::map<std::string, std::vector<int>> by_name;
  for (size_t i = 0; i < input.picks.size(); ++i) {
    if (!(input.picks[i].weight > 0)) continue;
    by_name[input.picks[i].image_name].push_back(static_cast<int>(i));
  }
  std::vector<View> views;
  std::string problem;
  bool layout_problem = false;
  for (const auto& [name, indices] : by_name) {
    if (static_cast<int>(indices.size()) < kMinPicksPerPhoto) continue;
    View view{name, input.model.FindImage(name), indices, {}, {}, {}};
    const Camera& camera = input.model.cameras.at(view.image->camera_id);
    const PointPairs pairs = PairsOf(input.picks, indices);
    std::string own_problem = FindLayoutProblem(pairs, camera, options.picks);
    layout_problem |= !own_problem.empty();
    if (own_problem.empty()) {
      view.review = ReviewPicks(CameraProjection(camera), pairs, options.picks);
      RefuseMirroredOrExchanged(input, view);
      if (view.review.HasPose()) {
        views.push_back(std::move(view));
        continue;
      }
      own_problem =
          "no camera pose has all picks in front of the camera and inside its lens' field";
    }
    own_problem = "in " + name + " " + own_problem;
    if (problem.empty()) problem = own_problem;
    warnings->push_back(
        "The picks of this photo are used with those of the others only: " + own_problem + ".");
  }
  if (views.empty() && layout_problem) {
    throw InputError(input.picks_path, "", problem,
                     "Pick points that are spread over the photo, in depth, and not on one line");
  }
  if (views.empty()) {
    throw Contradiction(input.picks_path, "", problem,
                        "Check that the picks name the right photo, and pick again");
  }
  return views;
}

View ChooseView(const AlignmentInput& input, std::vector<View> views,
                const AlignmentOptions& options) {
  const auto best = std::min_element(views.begin(), views.end(), [](const View& a, const View& b) {
    return a.review.pose().PositionSigma() < b.review.pose().PositionSigma();
  });
  View view = std::move(*best);
  std::vector<std::vector<Triangle>> meshes;
  for (const Scan& scan : input.scans) meshes.push_back(BuildScanMesh(scan, options.mesh));
  const PoseChoice choice =
      ChoosePose(view.review.poses, options.scale, options.trust.min_scale_features,
                 [&](const Rigid& cam_from_scan, const ScaleOptions& scale_options) {
                   return EstimateScale(input.model, *view.image, cam_from_scan, input.scans,
                                        meshes, scale_options);
                 });
  view.scale = choice.scale;
  view.cam_from_scan = view.review.poses[choice.index].cam_from_scan;
  if (view.scale.num_features == 0) {
    throw Contradiction(
        input.picks_path, "",
        "the picks in " + view.name + " " + Miss(view.review.RmsPx()) +
            ", and with the pose that they give, none of the photo's features with a "
            "sparse point (" +
            std::to_string(view.scale.num_candidates) +
            " of them have the scan behind them) lies on smooth surface; so the scale "
            "between model and scan cannot be found",
        "Check the picks, or pick in a photo with more sparse points");
  }
  return view;
}

void ReportBadPicks(const View& view, Alignment* result) {
  const PickReview& review = view.review;
  for (size_t i = 0; i < view.picks.size(); ++i) {
    PickOutcome& outcome = result->picks[view.picks[i]];
    outcome.used = review.used[i];
    outcome.leave_one_out_px = review.leave_one_out_px[static_cast<int>(i)];
    if (outcome.used) continue;
    result->warnings.push_back(
        "The pick on " + LineOf(outcome.pick) + " (" + outcome.pick.image_name + " at " +
        Number(outcome.pick.x_in_img.x(), 1) + ", " + Number(outcome.pick.x_in_img.y(), 1) +
        ") was left out: it is " + Number(outcome.leave_one_out_px, 1) +
        " pixels away from where the other picks put it.");
  }
}

std::vector<bool> UsedPicks(const Alignment& result) {
  std::vector<bool> used;
  for (const PickOutcome& outcome : result.picks) used.push_back(outcome.used);
  return used;
}

// Weighted root mean square over the used picks.
double PickRms(const Alignment& result, double PickOutcome::*residual) {
  double sum = 0, sum_of_weights = 0;
  for (const PickOutcome& outcome : result.picks) {
    if (!outcome.used) continue;
    sum += std::pow(outcome.pick.weight * outcome.*residual, 2);
    sum_of_weights += std::pow(outcome.pick.weight, 2);
  }
  return sum_of_weights > 0 ? std::sqrt(sum / sum_of_weights) : 0;
}

void SetResiduals(const AlignmentInput& input, const Similarity& scan_from_sparse,
                  double PickOutcome::*residual, Alignment* result) {
  const Eigen::Matrix2Xd errors = PickErrors(input.model, input.picks, scan_from_sparse);
  for (size_t i = 0; i < result->picks.size(); ++i) {
    result->picks[i].*residual = errors.col(static_cast<int>(i)).norm();
  }
}

// Picks of several photos as one answer; the ones that then stand far off are left out and named.
void FitAllPicks(const AlignmentInput& input, double sigma_px, const AlignmentOptions& options,
                 Alignment* result) {
  const JointPickFit joint =
      FitPicksJointly(input.model, input.picks, UsedPicks(*result), sigma_px,
                      result->scan_from_sparse, options.fit, options.picks.min_bad_pick_px);
  if (!joint.converged) {
    result->warnings.push_back("The picks of all photos together gave no solution; those of " +
                               result->clicked_image + " alone are used.");
  }
  result->scan_from_sparse = joint.scan_from_sparse;
  SetResiduals(input, joint.scan_from_sparse, &PickOutcome::residual_px, result);
  for (size_t i = 0; i < result->picks.size(); ++i) {
    PickOutcome& outcome = result->picks[i];
    if (joint.used[i] == outcome.used) continue;
    outcome.used = false;
    result->warnings.push_back("The pick on " + LineOf(outcome.pick) + " (" +
                               outcome.pick.image_name + ") was left out: it is " +
                               Number(joint.left_out_px[i], 1) +
                               " pixels away from where the other picks put it.");
  }
}

void FitOnSurface(const AlignmentInput& input, double pick_sigma_px,
                  const std::vector<SurfacePoint>& points, const ScanPatches& surface,
                  const AlignmentOptions& options, Alignment* result) {
  const double gate = std::clamp(5 * result->position_sigma, 0.1, options.fit.max_gate);
  result->surface_fit = FitToSurface(input.model, points, surface, input.picks, UsedPicks(*result),
                                     pick_sigma_px, gate, result->scan_from_sparse, options.fit);
  if (!result->surface_fit.converged) {
    result->reasons.push_back(
        "The sparse points do not settle on the scan's surface: too few of the " +
        std::to_string(points.size()) +
        " are near it, or they pull the scale away from what the picks give.");
    return;
  }
  SetResiduals(input, result->surface_fit.scan_from_sparse, &PickOutcome::refined_residual_px,
               result);
  result->refined_pick_rms_px = PickRms(*result, &PickOutcome::refined_residual_px);
  if (!options.plane_constrained) return;
  result->refined = true;
  result->scan_from_sparse = result->surface_fit.scan_from_sparse;
}

// Thesis 7.2 from one start, for a scan that is bent or not.
struct Adjustment {
  SparseModel start;
  PlaneBundleInput input;
  PlaneBundle bundle;

  Adjustment(const AlignmentInput& alignment, double pick_sigma_px, const ScanPatches& surface,
             const Alignment& result, const Similarity& scan_from_sparse, const ScanBend& bend,
             const PlaneBundleOptions& options)
      : start(alignment.model),
        input{start,         alignment.planes,     surface, alignment.picks, UsedPicks(result),
              pick_sigma_px, result.clicked_image, bend} {
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

// Thesis 7.2. What speaks against the result is a warning: the similarity remains.
void AdjustPoses(const AlignmentInput& input, double pick_sigma_px,
                 const std::vector<SurfacePoint>& points, const ScanPatches& surface,
                 const AlignmentOptions& options, Alignment* result) {
  const bool fixed = options.bundle.fix_clicked_view;
  // The clicked view keeps the pose of its clicks, so that the model starts there, too.
  Similarity start = fixed ? result->scan_from_sparse_from_picks : result->scan_from_sparse;
  auto adjustment = std::make_unique<Adjustment>(input, pick_sigma_px, surface, *result, start,
                                                 ScanBend(), options.bundle);
  if (options.bundle.bend && !fixed) {
    result->bend = FitScanBend(input.model, points, input.scans, surface, input.picks,
                               UsedPicks(*result), pick_sigma_px, start, options.bundle.min_bend);
  }
  if (result->bend) {
    const Similarity& scan_from_sparse = result->bend->scan_from_sparse;
    auto bent = std::make_unique<Adjustment>(input, pick_sigma_px, surface, *result,
                                             scan_from_sparse, result->bend->bend, options.bundle);
    if (IsScanBent(adjustment->bundle, bent->bundle)) {
      start = scan_from_sparse;
      adjustment = std::move(bent);
    } else {
      result->bend.reset();
    }
  }
  result->bundle = std::move(adjustment->bundle);
  if (!result->bundle.usable) {
    result->bend.reset();
    result->warnings.push_back(result->bundle.reason + " One similarity for all photos is used.");
    return;
  }
  result->adjusted = true;
  result->scan_from_sparse = result->bundle.adjusted_from_input * start;
  result->photo_sigmas =
      FindPhotoSigmas(FindPoseCovariances(adjustment->input, result->bundle, options.bundle),
                      result->bundle.model, result->surface_fit);
  SetExpectedErrorAtCameras(result->photo_sigmas, &result->expected_error);
  const Eigen::Matrix2Xd errors = PickErrors(result->bundle.model, input.picks, Similarity());
  for (size_t i = 0; i < result->picks.size(); ++i) {
    result->picks[i].refined_residual_px = errors.col(static_cast<int>(i)).norm();
  }
  result->refined_pick_rms_px = PickRms(*result, &PickOutcome::refined_residual_px);
  if (result->bend) {
    std::string warning =
        "The scan is bent by " + Number(1000 * result->bend->bend_rms, 1) +
        " mm (rms over the sparse points): the photos were fitted to it as it is, so that their "
        "reprojection errors grow.";
    if (result->bend->bend_rms > kMaxLaserBend) {
      warning +=
          " That is more than a laser scanner does: the sparse model may be bent instead. Look at "
          "the overlays (--overlays), and compare with --PlaneBA.bend 0.";
    }
    result->warnings.push_back(warning);
  }
  for (const uint32_t id : result->bundle.idle_images) {
    result->warnings.push_back(input.model.images.at(id).name +
                               " was not adjusted to the scan's surface: too few sparse points "
                               "hold it. It follows the other photos.");
  }
}

// Middle of the photos, and what the similarity leaves open there.
void JudgeAccuracy(const AlignmentInput& input, double pick_sigma_px,
                   const AlignmentOptions& options, Alignment* result) {
  const SimilarityFit by_picks =
      result->refined ? SimilarityFit()
                      : FitToPicks(input.model, input.picks, UsedPicks(*result), pick_sigma_px,
                                   result->scan_from_sparse, options.fit);
  std::vector<Eigen::Vector3d> centres;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& [image_id, image] : input.model.images) {
    centres.push_back(result->scan_from_sparse * image.cam_from_model.TargetOriginInSource());
    middle += centres.back() / static_cast<double>(input.model.images.size());
  }
  result->expected_error =
      PropagateError(result->refined ? result->surface_fit : by_picks, centres, input.scans);
  if (!result->refined) return;
  result->open = FindOpenDirections(result->surface_fit, middle);
  if (!result->open.None()) result->warnings.push_back(result->open.Sentence());
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

Alignment AlignToScan(const AlignmentInput& input, double sigma_px, const FreeSpace& free_space,
                      const AlignmentOptions& options, Progress* progress) {
  CheckPicksAgainstModel(input.picks_path, input.picks, input.model);
  progress->Stage("scan surface");
  Alignment result;
  CheckPicksOnScan(input, &result.warnings);
  const ScanPatches surface(input.scans, options.surface);

  progress->Stage("pose from picks");
  for (const Pick& pick : input.picks) result.picks.push_back({pick, pick.weight > 0});
  std::vector<View> views = ReviewViews(input, options, &result.warnings);
  for (const View& view : views) ReportBadPicks(view, &result);

  progress->Stage("scale");
  const View view = ChooseView(input, std::move(views), options);
  const ViewPose& pose = view.review.pose();
  result.clicked_image = view.name;
  result.position_sigma = pose.PositionSigma();
  result.scale = view.scale;
  result.scan_from_sparse =
      ScanFromSparse(view.cam_from_scan, view.image->cam_from_model, view.scale.scale);
  SetResiduals(input, result.scan_from_sparse, &PickOutcome::residual_px, &result);
  const double pick_sigma_px = std::max(0.5, pose.sigma_px);
  const auto num_on = std::count_if(input.picks.begin(), input.picks.end(),
                                    [](const Pick& pick) { return pick.weight > 0; });
  if (num_on > static_cast<long>(view.picks.size())) {
    FitAllPicks(input, pick_sigma_px, options, &result);
  }
  result.scan_from_sparse_from_picks = result.scan_from_sparse;
  result.pick_rms_px = PickRms(result, &PickOutcome::residual_px);
  for (const PickOutcome& outcome : result.picks) {
    if (outcome.pick.weight > 0) {
      result.pick_max_px = std::max(result.pick_max_px, outcome.residual_px);
    }
  }

  progress->Stage("surface refinement");
  const std::vector<SurfacePoint> points =
      FindSurfacePoints(input.model, options.fit.min_track, sigma_px);
  FitOnSurface(input, pick_sigma_px, points, surface, options, &result);

  progress->Stage("trust");
  JudgeAccuracy(input, pick_sigma_px, options, &result);
  TrustOptions trust = options.trust;
  if (!result.refined) {
    // Clicks alone are rough, and say themselves how rough.
    trust.surface_tolerance =
        std::max(trust.surface_tolerance, std::min(2 * result.position_sigma, 0.2));
  }
  result.placement =
      CheckPlacement(input.model, points, result.scan_from_sparse, surface, free_space, trust);
  JudgeAlignment(input, trust, &result);
  // After the checks: an adjustment brings points to the surface that do not belong there, too.
  if (result.refined && result.reasons.empty()) {
    progress->Stage("bundle adjustment");
    AdjustPoses(input, pick_sigma_px, points, surface, options, &result);
  }
  JudgePicksLeftOut(options.trust.PickRmsLimit(input.model.cameras.at(view.image->camera_id)),
                    &result);
  return result;
}

}  // namespace roomtex
