#include "align/fit/plane_bundle_round.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "align/fit/plane_bundle_costs.h"
#include "colmap_ext/lens_prior.h"
#include "colmap_ext/solver_log.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Scale of Cauchy's loss for distances from the surface, in their standard deviations.
constexpr double kCauchy = 3.0;
// A round stops when a step lowers the cost by less than this share; what one round leaves the next
// one finds.
constexpr double kFunctionTolerance = 1e-5;
// Or when a step moves no camera by more than this share of what counts from round to round: what
// would lower the cost further, for as many steps again, are a few points that hold no camera.
constexpr double kStillShare = 0.2;
constexpr double kStartRadius = 1e6;  // the start is near: almost a Gauss-Newton step
// More photos than this have a sparse reduced system.
constexpr size_t kMaxDensePhotos = 80;

// Ends a solution once the cameras stand still. The poses must be those of every iteration.
class StopAtStillCameras : public ceres::IterationCallback {
 public:
  explicit StopAtStillCameras(const std::vector<PoseParameters>& poses) : poses_(poses) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    const std::vector<Rigid> before = std::exchange(last_, {});
    for (const PoseParameters& pose : poses_) last_.push_back(pose.CamFromScan());
    // A step that failed or was held back says nothing.
    const bool is_free = summary.step_is_successful && summary.trust_region_radius >= kStartRadius;
    bool is_still = summary.iteration > 0 && is_free;
    for (size_t i = 0; is_still && i < before.size(); ++i) {
      is_still = !HasMoved(before[i], last_[i], kStillShare);
    }
    return is_still ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  const std::vector<PoseParameters>& poses_;
  std::vector<Rigid> last_;
};

class RoundProblem {
 public:
  RoundProblem(const BundleRound& round, const SparseModel& model, const RowMotions& motions)
      : round_(round), model_(model), reprojection_loss_(kReprojectionHuber * round.sigma_px) {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;
    problem_ = std::make_unique<ceres::Problem>(options);
    MakeParameters();
    motions_.reserve(motions.size());  // Ceres keeps pointers into it
    for (const auto& [id, motion] : motions) {
      motion_index_[id] = motions_.size();
      std::array<double, 6>& values = motions_.emplace_back();
      Eigen::Map<Eigen::Vector3d>(values.data()) = motion.turn;
      Eigen::Map<Eigen::Vector3d>(values.data() + 3) = motion.move;
    }
    AddObservations();
    AddPicks();
    AddSurface();
    AddMotionPriors();
    if (round.options.refine_intrinsics) AddIntrinsicsPriors();
    if (round.options.fix_clicked_view) FixClickedView();
  }

  bool Solve() {
    ceres::Solver::Options o;
    o.linear_solver_type =
        poses_.size() > kMaxDensePhotos ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
    o.max_num_iterations = round_.options.max_iterations;
    o.function_tolerance = kFunctionTolerance;
    o.parameter_tolerance = 1e-9;
    o.gradient_tolerance = 1e-12;
    o.initial_trust_region_radius = kStartRadius;
    o.num_threads = 1;
    o.logging_type = ceres::SILENT;
    o.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    const auto order = [&](double* block, int group) {
      if (problem_->HasParameterBlock(block)) {
        o.linear_solver_ordering->AddElementToGroup(block, group);
      }
    };
    for (Eigen::Vector3d& point : points_) order(point.data(), 0);
    for (PoseParameters& pose : poses_) order(pose.values, 1);
    for (auto& motion : motions_) order(motion.data(), 2);
    for (auto& params : params_) order(params.data(), 3);
    for (Eigen::Vector3d& point : pick_points_) order(point.data(), 4);
    StopAtStillCameras stop(poses_);
    o.callbacks.push_back(&stop);
    o.update_state_every_iteration = true;
    ceres::Solver::Summary summary;
    SilenceCeres();
    ceres::Solve(o, problem_.get(), &summary);
    return summary.IsSolutionUsable();
  }

  void Write(SparseModel* model, RowMotions* motions) const {
    for (const auto& [id, index] : motion_index_) {
      const std::array<double, 6>& values = motions_[index];
      motions->at(id) = {Eigen::Map<const Eigen::Vector3d>(values.data()),
                         Eigen::Map<const Eigen::Vector3d>(values.data() + 3)};
    }
    for (const auto& [id, index] : pose_index_) {
      const double* const pose = poses_[index].values;
      if (!problem_->HasParameterBlock(pose) || problem_->IsParameterBlockConstant(pose)) continue;
      const Rigid rig_from_scan = poses_[index].CamFromScan();
      SparseImage& image = model->images.at(id);
      image.cam_from_model =
          image.frame_id == kNoFrame ? rig_from_scan : cam_from_rig_.at(id) * rig_from_scan;
    }
    for (const auto& [id, index] : point_index_) {
      model->points.at(id).x_in_model = points_[index];
    }
    if (!round_.options.refine_intrinsics) return;
    for (const auto& [id, index] : camera_index_) {
      std::vector<double>& params = model->cameras.at(id).params;
      std::copy_n(params_[index].begin(), params.size(), params.begin());
    }
  }

 private:
  void MakeParameters() {
    std::map<int, size_t> index_of_lens;
    for (const auto& [id, camera] : model_.cameras) {
      projections_.emplace(id, camera);
      camera_index_[id] = params_.size();
      const auto lens = round_.input.lens_of_camera.find(id);
      if (lens != round_.input.lens_of_camera.end()) {
        const auto [at, is_first] = index_of_lens.emplace(lens->second, params_.size());
        camera_index_[id] = at->second;
        if (!is_first) continue;
      }
      params_.push_back({});
      std::copy(camera.params.begin(), camera.params.end(), params_.back().begin());
    }
    std::map<uint32_t, uint32_t> first_of_frame;  // its image whose pose is that of the rig
    for (const auto& [id, image] : model_.images) {
      if (round_.idle_images.count(id) > 0) continue;
      const uint32_t first = image.frame_id == kNoFrame
                                 ? id
                                 : first_of_frame.emplace(image.frame_id, id).first->second;
      if (first != id) {
        pose_index_[id] = pose_index_.at(first);
        cam_from_rig_[id] = image.cam_from_model * model_.images.at(first).cam_from_model.Inverse();
        continue;
      }
      pose_index_[id] = poses_.size();
      poses_.emplace_back(image.cam_from_model);
      cam_from_rig_[id] = Rigid();
    }
    for (const auto& [id, point] : model_.points) {
      const Eigen::Vector3d& x_in_model = point.x_in_model;
      const auto num_seen = std::count_if(
          point.track.begin(), point.track.end(),
          [&](const TrackElement& element) { return Sees(element.image_id, x_in_model); });
      if (num_seen < 2) continue;
      point_index_[id] = points_.size();
      points_.push_back(point.x_in_model);
    }
    pick_points_.reserve(round_.input.picks.size());  // Ceres keeps pointers into it
  }

  bool Sees(uint32_t image_id, const Eigen::Vector3d& x_in_scan) const {
    if (pose_index_.count(image_id) == 0) return false;
    const SparseImage& image = model_.images.at(image_id);
    return projections_.at(image.camera_id)
        .ImgFromCam(image.cam_from_model * x_in_scan)
        .has_value();
  }

  void AddReprojection(uint32_t image_id, double* point, const Eigen::Vector2d& x_in_img,
                       double weight) {
    const Camera& camera = model_.cameras.at(model_.images.at(image_id).camera_id);
    PoseParameters& pose = poses_[pose_index_.at(image_id)];
    const bool refine = round_.options.refine_intrinsics;
    const auto motion = motion_index_.find(image_id);
    const bool rolls = motion != motion_index_.end();
    std::vector<double*> blocks{pose.values, point};
    if (refine) blocks.push_back(params_[camera_index_.at(camera.camera_id)].data());
    if (rolls) blocks.push_back(motions_[motion->second].data());
    problem_->AddResidualBlock(new ReprojectionCost(pose, camera, x_in_img, weight, refine,
                                                    cam_from_rig_.at(image_id), rolls),
                               &reprojection_loss_, blocks);
  }

  void AddObservations() {
    for (const auto& [id, index] : point_index_) {
      const SparsePoint& point = model_.points.at(id);
      for (const TrackElement& element : point.track) {
        if (!Sees(element.image_id, point.x_in_model)) continue;
        AddReprojection(element.image_id, points_[index].data(),
                        model_.images.at(element.image_id).points2d[element.point2d_index], 1);
      }
    }
  }

  void AddPicks() {
    for (size_t i = 0; i < round_.input.picks.size(); ++i) {
      const Pick& pick = round_.input.picks[i];
      const SparseImage* const image = model_.FindImage(pick.image_name);
      const Eigen::Vector3d x_in_scan = round_.input.bend.Straighten(pick.x_in_scan);
      if (!round_.input.used[i] || image == nullptr || !Sees(image->image_id, x_in_scan)) continue;
      pick_points_.push_back(x_in_scan);
      AddReprojection(image->image_id, pick_points_.back().data(), pick.x_in_img,
                      round_.sigma_px / std::hypot(round_.input.pick_sigma_px / pick.weight,
                                                   round_.input.pick_bend_px));
      problem_->SetParameterBlockConstant(pick_points_.back().data());
    }
  }

  void AddSurface() {
    // In the first round distances are large because the similarity is rough, not because the
    // points are wrong: the loss widens with them.
    std::vector<double> deviations;
    for (const SurfaceConstraint& c : round_.constraints) {
      deviations.push_back(std::abs(c.Distance(model_.points.at(c.point3d_id).x_in_model)) /
                           c.sigma);
    }
    const double typical = std::max(1.0, kSigmaPerMad * Median(deviations));
    for (const SurfaceConstraint& c : round_.constraints) {
      const auto at = point_index_.find(c.point3d_id);
      if (at == point_index_.end()) continue;
      const double fixed_beta = round_.options.beta;
      const double beta = fixed_beta > 0 ? fixed_beta : round_.sigma_px / c.sigma;
      surface_losses_.push_back(
          std::make_unique<ceres::CauchyLoss>(kCauchy * typical * beta * c.sigma));
      problem_->AddResidualBlock(new PlaneCost(beta, c.point, c.normal),
                                 surface_losses_.back().get(), points_[at->second].data());
    }
  }

  void AddMotionPriors() {
    const Eigen::MatrixXd weights = round_.sigma_px * RowMotionPrior();
    for (auto& motion : motions_) {
      if (!problem_->HasParameterBlock(motion.data())) continue;
      problem_->AddResidualBlock(new ceres::NormalPrior(weights, Eigen::VectorXd::Zero(6)), nullptr,
                                 motion.data());
    }
  }

  // One per lens.
  void AddIntrinsicsPriors() {
    std::set<size_t> held;
    for (const auto& [id, index] : camera_index_) {
      double* const params = params_[index].data();
      if (!problem_->HasParameterBlock(params) || !held.insert(index).second) continue;
      const auto told = round_.input.told.find(id);
      const Camera& given =
          told != round_.input.told.end() ? told->second : round_.input.model.cameras.at(id);
      const Eigen::Map<const Eigen::VectorXd> b(given.params.data(),
                                                static_cast<int>(given.params.size()));
      problem_->AddResidualBlock(
          new ceres::NormalPrior(round_.sigma_px * LensPrior(given, round_.options.hold_centre), b),
          nullptr, params);
    }
  }

  void FixClickedView() {
    const SparseImage* const image = model_.FindImage(round_.input.clicked_image);
    if (image == nullptr || pose_index_.count(image->image_id) == 0) return;
    double* const pose = poses_[pose_index_.at(image->image_id)].values;
    if (problem_->HasParameterBlock(pose)) problem_->SetParameterBlockConstant(pose);
  }

  const BundleRound& round_;
  const SparseModel& model_;
  std::map<uint32_t, CameraProjection> projections_;
  std::map<uint32_t, size_t> camera_index_, pose_index_;
  std::map<uint32_t, Rigid> cam_from_rig_;  // by image; the rig is the first image of its frame
  std::map<uint64_t, size_t> point_index_;
  std::map<uint32_t, size_t> motion_index_;
  std::vector<std::array<double, 6>> motions_;  // RowMotion: turn, move
  std::vector<std::array<double, kMaxCameraParams>> params_;
  std::vector<PoseParameters> poses_;
  std::vector<Eigen::Vector3d> points_, pick_points_;
  ceres::HuberLoss reprojection_loss_;
  std::vector<std::unique_ptr<ceres::LossFunction>> surface_losses_;
  std::unique_ptr<ceres::Problem> problem_;
};

}  // namespace

bool HasMoved(const Rigid& before, const Rigid& after, double share) {
  const Eigen::Vector3d step = after.TargetOriginInSource() - before.TargetOriginInSource();
  return step.norm() > share * 5e-5 ||
         RotationAngle(after.rotation, before.rotation) > share * 2e-5;
}

bool SolveRound(const BundleRound& round, SparseModel* model, RowMotions* motions) {
  RoundProblem problem(round, *model, *motions);
  if (!problem.Solve()) return false;
  problem.Write(model, motions);
  return true;
}

}  // namespace roomtex
