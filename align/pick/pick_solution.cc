#include "align/pick/pick_solution.h"

#include <algorithm>
#include <cmath>

#include "align/clicks/pose_choice.h"
#include "align/fit/joint_picks.h"
#include "align/judgement.h"
#include "align/pick/few_picks.h"
#include "align/pick/pick_advice.h"

namespace roomtex {
namespace {

double MetresOff(const CameraProjection& projection, const Rigid& cam_from_scan,
                 const SessionPick& pick) {
  const Eigen::Vector3d x_in_cam = cam_from_scan * *pick.x_in_scan;
  const auto ray = projection.CamFromImg(*pick.x_in_img);
  if (!ray || !(x_in_cam.z() > 0)) return kNoNumber;
  return (x_in_cam.z() * ray->homogeneous() - x_in_cam).norm();
}

double WeightedRms(double sum, double sum_of_weights) {
  return sum_of_weights > 0 ? std::sqrt(sum / sum_of_weights) : kNoNumber;
}

bool Equal(const PointPairs& a, const PointPairs& b) {
  return a.size() == b.size() && a.x_in_img == b.x_in_img && a.x_in_scan == b.x_in_scan &&
         a.weight == b.weight;
}

PickReview ReviewOfPoses(std::vector<ViewPose> poses, int num_picks) {
  PickReview review;
  review.poses = std::move(poses);
  review.used.assign(num_picks, true);
  review.leave_one_out_px = Eigen::VectorXd::Constant(num_picks, kNoNumber);
  if (review.HasPose()) review.residual_px = review.pose().residual_px;
  return review;
}

}  // namespace

// The picks of one photo that are on, and their own pose.
struct PickSolver::View {
  const PickPhoto* photo = nullptr;
  std::vector<int> picks;  // indices
  PointPairs pairs;
  PickReview review;
  ScaleEstimate scale;
  Rigid cam_from_scan;
  bool has_pose = false;
};

PickReview PickSolver::Review(const std::string& name, const CameraProjection& projection,
                              const PointPairs& pairs) {
  const auto found = reviewed_.find(name);
  if (found != reviewed_.end() && Equal(found->second.pairs, pairs)) return found->second.review;
  PickReview review;
  const int n = pairs.size();
  if (n >= kMinPicksPerPhoto) {
    review = ReviewPicks(projection, pairs, options_.picks);
  } else if (n == 3) {
    review = ReviewOfPoses(SolveThreePicks(projection, pairs), n);
  } else {
    review = ReviewOfPoses(SolveFewPicks(projection, pairs), n);
    for (int i = 0; n == 5 && i < n && review.HasPose(); ++i) {
      const auto poses = SolveViewPoses(projection, pairs.Without(i), review.pose().cam_from_scan);
      if (poses.empty()) continue;
      review.leave_one_out_px[i] = PickResiduals(projection, pairs, poses[0].cam_from_scan)[i];
    }
  }
  reviewed_[name] = {pairs, review};
  return review;
}

void PickSolver::SolveView(const ScanRays* rays, View* view, PhotoState* photo) {
  const int n = view->pairs.size();
  const CameraProjection& projection = *view->photo->projection;
  if (n < 3) return;
  const std::string problem =
      n >= 4 ? FindLayoutProblem(view->pairs, projection.camera(), options_.picks)
             : LayoutProblemOfThree(view->pairs);
  if (!problem.empty()) {
    photo->warnings.push_back(AsSentence(problem));
    return;
  }
  view->review = Review(view->photo->name(), projection, view->pairs);
  const PickReview& review = view->review;
  for (std::string& warning : ReviewWarnings(review, view->picks, scene_.input().scan_reader)) {
    photo->warnings.push_back(std::move(warning));
  }
  if (!review.HasPose()) {
    photo->warnings.push_back(
        "No camera pose has all these picks in front of the camera. Check that they are of this "
        "photo.");
    return;
  }
  int chosen = 0;
  if (rays != nullptr) {
    const PoseChoice choice =
        ChoosePose(review.poses, options_.scale, options_.trust.min_scale_features,
                   [&](const Rigid& cam_from_scan, const ScaleOptions& options) {
                     return EstimateScale(scene_.model(), *view->photo->image, cam_from_scan,
                                          rays->caster(), options, scene_.input().num_threads);
                   });
    chosen = choice.index;
    view->scale = choice.scale;
    photo->ambiguous = choice.ambiguous;
  } else {
    photo->ambiguous = n < kMinPicksPerPhoto && review.poses.size() > 1;
  }
  if (n == 3 && view->scale.num_features < options_.trust.min_scale_features) {
    if (rays != nullptr) {
      photo->warnings.push_back(
          "Three picks fit several poses, and too few sparse points of this photo lie on the scan "
          "to "
          "tell which.");
    }
    return;
  }
  view->has_pose = true;
  view->cam_from_scan = review.poses[chosen].cam_from_scan;
  photo->cam_from_scan = view->cam_from_scan;
  photo->by = n == 3 ? PhotoState::By::kSparseModel : PhotoState::By::kPicks;
  const double sigma = review.poses[chosen].PositionSigma();
  if (n >= 4 && std::isfinite(sigma)) photo->position_sigma = sigma;
}

// One similarity for the model (thesis 7.1.3), as AlignToScan() finds it from the picks.
void PickSolver::FitModel(const std::vector<SessionPick>& picks, const std::vector<View>& views,
                          PickSolution* solution) const {
  const View* best = nullptr;
  for (const View& view : views) {
    if (!view.has_pose || view.scale.num_features == 0) continue;
    const auto is_better = [](const View& a, const View& b) {
      const bool a_is_whole = a.pairs.size() >= kMinPicksPerPhoto;
      const bool b_is_whole = b.pairs.size() >= kMinPicksPerPhoto;
      if (a_is_whole != b_is_whole) return a_is_whole;
      if (!a_is_whole && a.pairs.size() != b.pairs.size()) return a.pairs.size() > b.pairs.size();
      return a.review.pose().PositionSigma() < b.review.pose().PositionSigma();
    };
    if (best == nullptr || is_better(view, *best)) best = &view;
  }
  if (best == nullptr) return;
  solution->scale = best->scale;
  Similarity scan_from_sparse =
      ScanFromSparse(best->cam_from_scan, best->photo->image->cam_from_model, best->scale.scale);
  std::vector<int> on;
  std::vector<Pick> complete;
  std::vector<bool> used;
  for (size_t i = 0; i < picks.size(); ++i) {
    if (!picks[i].complete() || !(picks[i].weight > 0)) continue;
    on.push_back(static_cast<int>(i));
    complete.push_back(
        {picks[i].image_name, *picks[i].x_in_img, *picks[i].x_in_scan, 0, picks[i].weight});
    used.push_back(solution->picks[i].status != PickState::Status::kBad);
  }
  if (complete.size() > best->picks.size()) {
    const double sigma_px = std::max(0.5, best->review.pose().sigma_px);
    const JointPickFit joint =
        FitPicksJointly(scene_.model(), complete, used, sigma_px, scan_from_sparse, options_.fit,
                        options_.picks.min_bad_pick_px);
    scan_from_sparse = joint.scan_from_sparse;
    for (size_t k = 0; k < on.size(); ++k) {
      if (!joint.used[k]) solution->picks[on[k]].status = PickState::Status::kBad;
    }
  }
  solution->scan_from_sparse = scan_from_sparse;
  for (const PickPhoto& photo : scene_.photos()) {
    PhotoState& state = solution->photos[photo.name()];
    state.cam_from_scan = CamFromScan(photo.image->cam_from_model, scan_from_sparse);
    if (!state.solved()) state.by = PhotoState::By::kSparseModel;
  }
}

// Residuals of all complete picks, and what they add up to.
void PickSolver::Measure(const std::vector<SessionPick>& picks, PickSolution* solution) const {
  struct Sums {
    double px2 = 0, metres2 = 0, weights = 0;
    int worst = -1;
    void Add(const PickState& state, double weight) {
      px2 += std::pow(weight * state.residual_px, 2);
      metres2 += std::pow(weight * state.residual, 2);
      weights += weight * weight;
    }
  };
  Sums all;
  std::map<std::string, Sums> of_photo;
  for (size_t i = 0; i < picks.size(); ++i) {
    const SessionPick& pick = picks[i];
    PickState& state = solution->picks[i];
    PhotoState& photo = solution->photos[pick.image_name];
    if (!pick.complete()) continue;
    if (!photo.solved()) {
      if (state.status == PickState::Status::kUsed) state.status = PickState::Status::kWaiting;
      continue;
    }
    const CameraProjection& projection = *scene_.FindPhoto(pick.image_name)->projection;
    const auto x_in_img = projection.ImgFromCam(photo.cam_from_scan * *pick.x_in_scan);
    if (x_in_img) state.error_px = *x_in_img - *pick.x_in_img;
    state.residual_px = state.error_px.norm();
    state.residual = MetresOff(projection, photo.cam_from_scan, pick);
    if (state.status != PickState::Status::kUsed) continue;
    ++photo.num_used;
    all.Add(state, pick.weight);
    Sums& sums = of_photo[pick.image_name];
    sums.Add(state, pick.weight);
    if (sums.worst < 0 || state.residual_px > solution->picks[sums.worst].residual_px) {
      sums.worst = static_cast<int>(i);
    }
  }
  for (const auto& [name, sums] : of_photo) {
    PhotoState& photo = solution->photos[name];
    photo.rms_px = WeightedRms(sums.px2, sums.weights);
    photo.rms = WeightedRms(sums.metres2, sums.weights);
    // Of three picks that fit exactly none is worse than another.
    if (solution->picks[sums.worst].residual_px > 0.01) solution->picks[sums.worst].worst = true;
  }
  solution->rms_px = WeightedRms(all.px2, all.weights);
  solution->num_clicked_photos = static_cast<int>(of_photo.size());
}

// The other side of half-finished pairs.
void PickSolver::Predict(const std::vector<SessionPick>& picks, const ScanRays* rays,
                         PickSolution* solution) const {
  for (size_t i = 0; i < picks.size(); ++i) {
    const SessionPick& pick = picks[i];
    const PhotoState& photo = solution->photos[pick.image_name];
    if (pick.complete() || !photo.solved()) continue;
    PickState& state = solution->picks[i];
    const CameraProjection& projection = *scene_.FindPhoto(pick.image_name)->projection;
    if (pick.x_in_scan) {
      const auto x_in_img = projection.ImgFromCam(photo.cam_from_scan * *pick.x_in_scan);
      if (x_in_img && projection.InImage(*x_in_img)) state.predicted_img = x_in_img;
    }
    if (!pick.x_in_img || rays == nullptr) continue;
    const auto ray = projection.CamFromImg(*pick.x_in_img);
    if (!ray) continue;
    const Eigen::Vector3d direction =
        photo.cam_from_scan.rotation.conjugate() * ray->homogeneous().normalized();
    const auto hit = rays->caster().Cast(photo.cam_from_scan.TargetOriginInSource(), direction);
    if (!hit) continue;
    const int scan = rays->ScanOf(hit->triangle);
    const auto place = scene_.places(scan).PlaceOf(hit->point);
    if (!place) continue;
    state.predicted_spot = ScanSpot{scan, *place};
    state.predicted_point = hit->point;
  }
}

PickSolution PickSolver::Solve(const std::vector<SessionPick>& picks) {
  const ScanRays* rays = scene_.rays();
  PickSolution solution;
  solution.with_rays = rays != nullptr;
  solution.picks.resize(picks.size());
  for (const PickPhoto& photo : scene_.photos()) solution.photos[photo.name()];
  std::map<std::string, View> by_name;
  for (size_t i = 0; i < picks.size(); ++i) {
    if (!picks[i].complete()) continue;
    ++solution.photos[picks[i].image_name].num_complete;
    const bool on = picks[i].weight > 0;
    solution.picks[i].status = on ? PickState::Status::kUsed : PickState::Status::kOff;
    if (on) by_name[picks[i].image_name].picks.push_back(static_cast<int>(i));
  }
  std::vector<View> views;
  for (auto& [name, view] : by_name) {
    view.photo = scene_.FindPhoto(name);
    const int n = static_cast<int>(view.picks.size());
    view.pairs = {Eigen::Matrix2Xd(2, n), Eigen::Matrix3Xd(3, n), Eigen::VectorXd(n)};
    for (int k = 0; k < n; ++k) {
      const SessionPick& pick = picks[view.picks[k]];
      view.pairs.x_in_img.col(k) = *pick.x_in_img;
      view.pairs.x_in_scan.col(k) = *pick.x_in_scan;
      view.pairs.weight[k] = pick.weight;
    }
    solution.photos[name].warnings = SurfaceWarnings(picks, view.picks, scene_);
    SolveView(rays, &view, &solution.photos[name]);
    for (int k = 0; k < n && view.has_pose; ++k) {
      PickState& state = solution.picks[view.picks[k]];
      state.leave_one_out_px = view.review.leave_one_out_px[k];
      if (!view.review.used[k]) state.status = PickState::Status::kBad;
    }
    views.push_back(std::move(view));
  }
  FitModel(picks, views, &solution);
  Measure(picks, &solution);
  for (const View& view : views) {
    if (!view.has_pose) continue;
    PhotoState& photo = solution.photos[view.photo->name()];
    for (std::string& warning : SpreadWarnings(view.pairs, view.photo->projection->camera())) {
      photo.warnings.push_back(std::move(warning));
    }
    const std::string warning = ModelWarning(view.review, photo);
    if (!warning.empty()) photo.warnings.push_back(warning);
  }
  Predict(picks, rays, &solution);
  solution.next = NextStep(picks, solution, scene_);
  return solution;
}

}  // namespace roomtex
