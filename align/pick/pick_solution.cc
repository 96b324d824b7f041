#include "align/pick/pick_solution.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "align/pick/few_picks.h"
#include "align/pick/pick_advice.h"

namespace roomtex {
namespace {

constexpr int kMinPicks = 3;  // in one photo, that can say something about its pose

double MetresOff(const CameraProjection& projection, const Rigid& cam_from_scan,
                 const SessionPick& pick) {
  const Eigen::Vector3d x_in_cam = cam_from_scan * *pick.x_in_scan;
  const auto ray = projection.RayFromImg(*pick.x_in_img);
  const double depth = projection.Depth(x_in_cam);
  if (!ray || !(depth > 0)) return kNoNumber;
  return (depth * *ray - x_in_cam).norm();
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
  review.leave_one_out_px = review.without_px2 = Eigen::VectorXd::Constant(num_picks, kNoNumber);
  if (review.HasPose()) review.residual_px = review.pose().residual_px;
  return review;
}

// A second pose fits the picks about as well as the first.
bool FitsTwice(const PickReview& review) {
  return review.poses.size() > 1 &&
         review.poses[1].rms_px <= std::max(1.5 * review.poses[0].rms_px, 1.0);
}

// Without which the others fit best where that is known of all, else by residual.
int WorstOf(const std::vector<int>& indices, const std::vector<PickState>& picks) {
  const bool known = std::all_of(indices.begin(), indices.end(),
                                 [&](int i) { return std::isfinite(picks[i].without_px2); });
  const auto badness = [&](int i) { return known ? -picks[i].without_px2 : picks[i].residual_px; };
  return *std::max_element(indices.begin(), indices.end(),
                           [&](int a, int b) { return badness(a) < badness(b); });
}

}  // namespace

PickReview PickSolver::Review(const std::string& name, const CameraProjection& projection,
                              const PointPairs& pairs) {
  const auto found = reviewed_.find(name);
  if (found != reviewed_.end() && Equal(found->second.pairs, pairs)) return found->second.review;
  PickReview review;
  const int n = pairs.size();
  const FocalSource source = scene_.focal_source(name);
  if (n >= kMinPicksPerPhoto || !FocalProblemOf(source, pairs).empty()) {
    review = scene_.has_model() ? ReviewPicks(projection, pairs, options_.picks)
                                : ReviewPhotoPicks(projection, source, pairs, options_.picks);
  } else if (n == 3) {
    review = ReviewOfPoses(SolveThreePicks(projection, pairs), n);
  } else {
    review = ReviewOfPoses(SolveFewPicks(projection, pairs), n);
    for (int i = 0; n == 5 && i < n && review.HasPose(); ++i) {
      const auto poses = SolveViewPoses(projection, pairs.Without(i), review.pose().cam_from_scan);
      if (poses.empty()) continue;
      review.leave_one_out_px[i] = PickResiduals(projection, pairs, poses[0].cam_from_scan)[i];
      review.without_px2[i] = poses[0].sum_px2;
    }
  }
  reviewed_[name] = {pairs, review};
  return review;
}

// What the picks of one photo say about it alone.
std::optional<PoseChoice> PickSolver::SolveView(const ScaleOfPhoto& scale_of_photo, PickView* view,
                                                PhotoState* photo) const {
  const int n = view->pairs.size();
  const Camera& camera = scene_.FindPhoto(view->image_name)->projection->camera();
  const PickReview& review = view->review;
  std::optional<PoseChoice> choice;
  if (!review.HasPose()) {
    photo->warnings.push_back(
        "No camera pose has all these picks in front of the camera. Check that they are of this "
        "photo.");
    return choice;
  }
  if (scale_of_photo) {
    choice = ChoosePoseOf(*view, options_.scale, options_.trust.min_scale_features, scale_of_photo);
    photo->ambiguous = choice->ambiguous;
  } else {
    photo->ambiguous =
        n < kMinPicksPerPhoto ? review.poses.size() > 1 : !scene_.has_model() && FitsTwice(review);
  }
  const int num_features = choice ? choice->scale.num_features : 0;
  // Three picks, or with all but one on a line: the sparse model has to say which pose it is.
  const std::string problem =
      n > 3 && n < kMinPicksPerPhoto ? FindLayoutProblem(view->pairs, camera, options_.picks) : "";
  if ((n == 3 || !problem.empty()) && num_features < options_.trust.min_scale_features) {
    if (scale_of_photo) {
      photo->warnings.push_back(
          n == 3 ? "Three picks fit several poses, and too few sparse points of this photo lie on "
                   "the scan to tell which."
                 : AsSentence(problem));
    }
    view->review.poses.clear();
    return choice;
  }
  const ViewPose& pose = review.poses[choice ? choice->index : 0];
  photo->cam_from_scan = pose.cam_from_scan;
  photo->by = n == 3 ? PhotoState::By::kSparseModel : PhotoState::By::kPicks;
  if (pose.lens) {
    photo->found_projection = std::make_shared<const CameraProjection>(*pose.lens);
    photo->focal_sigma = pose.focal_sigma * pose.lens->MeanFocalLength();
  }
  const double sigma = pose.PositionSigma();
  if (n >= 4 && std::isfinite(sigma)) photo->position_sigma = sigma;
  return choice;
}

std::vector<PickSolver::Complete> PickSolver::CompletePicks(const std::vector<SessionPick>& picks,
                                                            PickSolution* solution) const {
  std::vector<Complete> complete(scene_.models().size());
  for (size_t model = 0; model < complete.size(); ++model) {
    complete[model].model = static_cast<int>(model);
  }
  std::map<std::string, std::vector<int>> on;
  for (size_t i = 0; i < picks.size(); ++i) {
    const SessionPick& pick = picks[i];
    if (!pick.complete()) continue;
    const int index = static_cast<int>(i);
    Complete& own = complete[scene_.FindPhoto(pick.image_name)->model];
    own.picks.push_back(
        {pick.image_name, *pick.x_in_img, *pick.x_in_scan, 0, pick.weight, pick.label});
    own.index.push_back(index);
    ++solution->photos[pick.image_name].num_complete;
    solution->picks[i].status =
        pick.weight > 0 ? PickState::Status::kUsed : PickState::Status::kOff;
    if (pick.weight > 0) on[pick.image_name].push_back(index);
  }
  for (const auto& [name, indices] : on) {
    solution->photos[name].warnings = SurfaceWarnings(picks, indices, scene_);
  }
  return complete;
}

ScaleOfPhoto PickSolver::ScaleByRays(int model, const ScanRays* rays) const {
  if (rays == nullptr) return {};
  return [this, model, rays](const SparseImage& image, const Rigid& cam_from_scan,
                             const ScaleOptions& options) {
    return EstimateScale(scene_.models()[model], image, cam_from_scan, rays->caster(), options,
                         scene_.input().num_threads);
  };
}

PickSolver::Views PickSolver::SolveViews(const Complete& complete,
                                         const ScaleOfPhoto& scale_of_photo,
                                         PickSolution* solution) {
  Views solved;
  solved.views =
      ReviewViews(scene_.models()[complete.model], complete.picks, kMinPicks, options_.picks,
                  [this](const std::string& name, const CameraProjection& projection,
                         const PointPairs& pairs) { return Review(name, projection, pairs); });
  for (PickView& view : solved.views) {
    PhotoState& photo = solution->photos[view.image_name];
    solved.choices.emplace_back();
    if (view.layout_problem.empty()) {
      view.layout_problem = FocalProblemOf(scene_.focal_source(view.image_name), view.pairs);
    }
    if (!view.layout_problem.empty()) {
      photo.warnings.push_back(AsSentence(view.layout_problem));
      continue;
    }
    std::vector<int> on;
    for (const int pick : view.picks) on.push_back(complete.index[pick]);
    for (std::string& warning : ReviewWarnings(view.review, on, scene_.azimuth())) {
      photo.warnings.push_back(std::move(warning));
    }
    solved.choices.back() = SolveView(scale_of_photo, &view, &photo);
    for (size_t k = 0; view.HasPose() && k < on.size(); ++k) {
      PickState& state = solution->picks[on[k]];
      state.leave_one_out_px = view.review.leave_one_out_px[static_cast<int>(k)];
      state.without_px2 = view.review.without_px2[static_cast<int>(k)];
      if (!view.review.used[k]) state.status = PickState::Status::kBad;
    }
  }
  return solved;
}

// What picks that place the model together say.
void PickSolver::TakeSpread(const Complete& complete, const PickStart& found,
                            PickSolution* solution) const {
  const std::vector<std::string>& spread = solution->models[complete.model].warnings =
      SpreadWarnings(*found.spread, complete.index, scene_.azimuth());
  std::set<std::string> clicked;
  for (const Pick& pick : complete.picks) {
    if (pick.weight > 0) clicked.insert(pick.image_name);
  }
  for (const std::string& name : clicked) {
    std::vector<std::string>& warnings = solution->photos[name].warnings;
    warnings.insert(warnings.end(), spread.begin(), spread.end());
  }
  if (!found.start) return;
  for (size_t k = 0; k < complete.index.size(); ++k) {
    if (!(complete.picks[k].weight > 0)) continue;
    PickState& state = solution->picks[complete.index[k]];
    state.leave_one_out_px = found.spread->leave_one_out_px[k];
    state.without_px2 = found.spread->without_px2[k];
    PhotoState& photo = solution->photos[complete.picks[k].image_name];
    photo.position_sigma = found.start->position_sigma;
    photo.ambiguous = found.choice.ambiguous;
  }
}

// One similarity for each model (thesis 7.1.3).
void PickSolver::FitModel(const Complete& complete, const Views& views,
                          const ScaleOfPhoto& scale_of_photo, PickSolution* solution) const {
  const PickStart found = StartFromPicks(scene_.models()[complete.model], complete.picks,
                                         views.views, views.choices, options_, scale_of_photo);
  if (found.spread) TakeSpread(complete, found, solution);
  if (!found.start) return;
  ModelState& model = solution->models[complete.model];
  model.scale = found.start->scale;
  model.scan_from_sparse = found.start->scan_from_sparse;
  for (size_t k = 0; k < complete.index.size(); ++k) {
    PickState& state = solution->picks[complete.index[k]];
    const bool is_left_out = !found.start->picks[k].used;
    if (is_left_out && state.status == PickState::Status::kUsed) {
      state.status = PickState::Status::kBad;
    }
  }
  for (const PickPhoto& photo : scene_.photos()) {
    if (photo.model != complete.model) continue;
    PhotoState& state = solution->photos[photo.name()];
    state.cam_from_scan = CamFromScan(photo.image->cam_from_model, *model.scan_from_sparse);
    if (!state.solved()) state.by = PhotoState::By::kSparseModel;
  }
}

// Photos that no picks place stand where the search has put them.
void PickSolver::PlaceFound(PickSolution* solution) const {
  solution->found = found_;
  if (!found_) return;
  for (const auto& [name, found] : found_->photos) {
    const auto at = solution->photos.find(name);
    if (at == solution->photos.end() || at->second.solved()) continue;
    at->second.by = PhotoState::By::kSearch;
    at->second.cam_from_scan = found.cam_from_scan;
    at->second.found_projection = found.projection;
  }
}

// Residuals of all complete picks, and what they add up to.
void PickSolver::Measure(const std::vector<SessionPick>& picks, PickSolution* solution) const {
  struct Sums {
    double px2 = 0, metres2 = 0, weights = 0;
    std::vector<int> picks;
    void Add(const PickState& state, double weight) {
      px2 += std::pow(weight * state.residual_px, 2);
      metres2 += std::pow(weight * state.residual, 2);
      weights += weight * weight;
    }
  };
  Sums check;
  std::vector<Sums> of_model(solution->models.size());
  std::map<std::string, Sums> of_photo;
  for (size_t i = 0; i < picks.size(); ++i) {
    const SessionPick& pick = picks[i];
    PickState& state = solution->picks[i];
    PhotoState& photo = solution->photos[pick.image_name];
    if (!pick.complete()) continue;
    if (!photo.solved_by_picks() && state.status == PickState::Status::kUsed) {
      state.status = PickState::Status::kWaiting;
    }
    if (!photo.solved()) continue;
    const PickPhoto& where = *scene_.FindPhoto(pick.image_name);
    const CameraProjection& projection = photo.projection(where);
    const auto error = projection.ImgError(photo.cam_from_scan * *pick.x_in_scan, *pick.x_in_img);
    if (error) state.error_px = *error;
    state.residual_px = state.error_px.norm();
    state.residual = MetresOff(projection, photo.cam_from_scan, pick);
    if (state.status == PickState::Status::kOff && std::isfinite(state.residual)) {
      check.Add(state, 1);
      ++solution->num_check_points;
    }
    if (state.status != PickState::Status::kUsed) continue;
    ++photo.num_used;
    of_model[where.model].Add(state, pick.weight);
    Sums& sums = of_photo[pick.image_name];
    sums.Add(state, pick.weight);
    sums.picks.push_back(static_cast<int>(i));
  }
  for (const auto& [name, sums] : of_photo) {
    PhotoState& photo = solution->photos[name];
    photo.rms_px = WeightedRms(sums.px2, sums.weights);
    photo.rms = WeightedRms(sums.metres2, sums.weights);
    PickState& worst = solution->picks[WorstOf(sums.picks, solution->picks)];
    // Of three picks that fit exactly none is worse than another.
    worst.worst = worst.residual_px > 0.01;
    ++solution->models[scene_.FindPhoto(name)->model].num_clicked_photos;
  }
  for (size_t model = 0; model < of_model.size(); ++model) {
    solution->models[model].rms_px = WeightedRms(of_model[model].px2, of_model[model].weights);
  }
  solution->check_rms_px = WeightedRms(check.px2, check.weights);
  solution->check_rms = WeightedRms(check.metres2, check.weights);
}

// The other side of half-finished pairs. Not by the search: picks are to say whether it is right.
void PickSolver::Predict(const std::vector<SessionPick>& picks, const ScanRays* rays,
                         PickSolution* solution) const {
  for (size_t i = 0; i < picks.size(); ++i) {
    const SessionPick& pick = picks[i];
    const PhotoState& photo = solution->photos[pick.image_name];
    if (pick.complete() || !photo.solved_by_picks()) continue;
    PickState& state = solution->picks[i];
    const CameraProjection& projection = photo.projection(*scene_.FindPhoto(pick.image_name));
    if (pick.x_in_scan) {
      const auto x_in_img = projection.ImgFromCam(photo.cam_from_scan * *pick.x_in_scan);
      if (x_in_img && projection.InImage(*x_in_img)) state.predicted_img = x_in_img;
    }
    if (!pick.x_in_img || rays == nullptr) continue;
    const auto ray = projection.RayFromImg(*pick.x_in_img);
    if (!ray) continue;
    const Eigen::Vector3d direction = photo.cam_from_scan.rotation.conjugate() * ray->normalized();
    const auto hit = rays->caster().Cast(photo.cam_from_scan.TargetOriginInSource(), direction);
    if (!hit) continue;
    const int scan = rays->ScanOf(hit->triangle);
    const auto place = scene_.places(scan).PlaceOf(hit->point);
    if (!place) continue;
    state.predicted_spot = ScanSpot{scan, *place};
    state.predicted_point = hit->point;
  }
}

PickSolver::Views PickSolver::SolveModel(const Complete& complete, const ScanRays* rays,
                                         PickSolution* solution) {
  const ScaleOfPhoto scale_of_photo =
      ScaleByRays(complete.model, scene_.has_model() ? rays : nullptr);
  Views views = SolveViews(complete, scale_of_photo, solution);
  if (scale_of_photo) FitModel(complete, views, scale_of_photo, solution);
  return views;
}

// What is said of the layout of picks, and of a photo's place among the others.
void PickSolver::Warn(const Views& views, PickSolution* solution) const {
  for (const PickView& view : views.views) {
    if (!view.HasPose()) continue;
    PhotoState& photo = solution->photos[view.image_name];
    const CameraProjection& projection = *scene_.FindPhoto(view.image_name)->projection;
    for (std::string& warning : SpreadWarnings(view.pairs, projection.camera())) {
      photo.warnings.push_back(std::move(warning));
    }
    const std::string warning = ModelWarning(view.review, photo);
    if (!warning.empty()) photo.warnings.push_back(warning);
  }
}

PickSolution PickSolver::Solve(const std::vector<SessionPick>& picks) {
  const ScanRays* rays = scene_.rays();
  PickSolution solution;
  solution.with_rays = rays != nullptr;
  solution.picks.resize(picks.size());
  solution.models.resize(scene_.models().size());
  for (const PickPhoto& photo : scene_.photos()) solution.photos[photo.name()];
  std::vector<Views> solved;
  for (const Complete& complete : CompletePicks(picks, &solution)) {
    solved.push_back(SolveModel(complete, rays, &solution));
  }
  PlaceFound(&solution);
  Measure(picks, &solution);
  for (const Views& views : solved) Warn(views, &solution);
  Predict(picks, rays, &solution);
  solution.next = NextStep(picks, solution, scene_);
  return solution;
}

}  // namespace roomtex
