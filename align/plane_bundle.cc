#include "align/plane_bundle.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>

#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "align/bent_model.h"
#include "align/plane_bundle_costs.h"
#include "core/camera_formulas.h"
#include "core/frames.h"

namespace roomtex {
namespace {

// Reprojection and click errors beyond this many standard deviations count linearly (Huber 1964).
constexpr double kHuber = 2.5;
// Scale of Cauchy's loss for distances from the surface, in their standard deviations.
constexpr double kCauchy = 3.0;
// Fewer points on the surface than this make no adjustment.
constexpr size_t kMinConstraints = 30;
// Gates of the rounds, in standard deviations; the last one stays.
constexpr double kGates[] = {6, 5, 4, 3.5};
// A round that moves no camera farther is the last.
constexpr double kSettledMetres = 5e-5, kSettledRadians = 2e-5;
// A round stops when a step lowers the cost by less than this share; what a round leaves the next
// one finds.
constexpr double kFunctionTolerance = 1e-5;
// How well the given intrinsics are believed when they are refined: weak, but keeps parameters that
// the photos say nothing about. Focal lengths and principal point as a share of the focal length.
constexpr double kLinearPrior = 0.02, kDistortionPrior = 0.05;
// The adjusted model may differ from the input by a similarity of this much ...
constexpr double kMaxScaleChange = 0.10, kMaxMove = 0.5;  // share; metres
// ... and beyond that its cameras may move by this share of the model's extent, at least 5 cm, and
// turn by 3 degrees: a scan bent by 1 % asks for a third of it.
// (An rms reprojection error may grow by this factor, or by these pixels if that is more.)
constexpr double kMaxReprojectionGrowth = 4, kMaxReprojectionRise_px = 4;
constexpr double kMaxBending = 0.04, kMinBendingLimit = 0.05, kMaxTurn_deg = 3;

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const size_t middle = values.size() / 2;
  std::nth_element(values.begin(), values.begin() + middle, values.end());
  return values[middle];
}

std::string Number(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof(text), "%.*f", digits, value);
  return text;
}

// Standard deviation of a keypoint's coordinate, from the middle of the residuals (outliers do not
// count), with what points and poses have taken up of them.
double ImageNoise(const SparseModel& model) {
  std::map<uint32_t, CameraProjection> projections;
  for (const auto& [id, camera] : model.cameras) projections.emplace(id, camera);
  std::vector<double> errors;
  size_t num_points = 0;
  for (const auto& [id, point] : model.points) {
    num_points += point.track.size() >= 2;
    for (const TrackElement& element : point.track) {
      const SparseImage& image = model.images.at(element.image_id);
      const auto x =
          projections.at(image.camera_id).ImgFromCam(image.cam_from_model * point.x_in_model);
      if (x) errors.push_back((*x - image.points2d[element.point2d_index]).norm());
    }
  }
  const double num_equations = 2.0 * static_cast<double>(errors.size());
  const double num_unknowns =
      3.0 * static_cast<double>(num_points) + 6.0 * static_cast<double>(model.images.size());
  const double free_share = std::max(0.2, 1 - num_unknowns / std::max(1.0, num_equations));
  // Median of a Rayleigh distribution: 1.1774 sigma.
  return std::max(0.1, Median(std::move(errors)) / 1.1774 / std::sqrt(free_share));
}

// One round: everything that Ceres needs, from the model as it is.
class Round {
 public:
  Round(const PlaneBundleInput& input, const PlaneBundleOptions& options, double sigma_px,
        const std::vector<SurfaceConstraint>& constraints, SparseModel* model)
      : input_(input), options_(options), sigma_px_(sigma_px), model_(*model) {
    ceres::Problem::Options problem_options;
    problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_options.disable_all_safety_checks = true;
    problem_ = std::make_unique<ceres::Problem>(problem_options);
    reprojection_loss_ = std::make_unique<ceres::HuberLoss>(kHuber * sigma_px);
    for (const auto& [id, image] : model_.images) poses_.emplace(id, image.cam_from_model);
    for (auto& [id, camera] : model_.cameras) projections_.emplace(id, camera);
    AddObservations();
    AddPicks();
    AddSurface(constraints);
    if (options.refine_intrinsics) AddIntrinsicsPriors();
    if (options.fix_clicked_view) FixClickedView();
  }

  // Writes the solution into the model; false if there is none.
  bool Solve() {
    ceres::Solver::Options o;
    o.linear_solver_type = poses_.size() > 80 ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
    o.max_num_iterations = options_.max_iterations;
    o.function_tolerance = kFunctionTolerance;
    o.parameter_tolerance = 1e-9;
    o.gradient_tolerance = 1e-12;
    o.initial_trust_region_radius = 1e6;  // the start is near: almost a Gauss-Newton step
    o.max_num_consecutive_invalid_steps = 20;
    o.num_threads = 1;  // more would add up in another order
    o.logging_type = ceres::SILENT;
    o.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (double* const point : points_) o.linear_solver_ordering->AddElementToGroup(point, 0);
    for (auto& [id, pose] : poses_) {
      if (problem_->HasParameterBlock(pose.values)) {
        o.linear_solver_ordering->AddElementToGroup(pose.values, 1);
      }
    }
    if (options_.refine_intrinsics) {
      for (auto& [id, camera] : model_.cameras) {
        o.linear_solver_ordering->AddElementToGroup(camera.params.data(), 1);
      }
    }
    for (Eigen::Vector3d& point : pick_points_) {
      o.linear_solver_ordering->AddElementToGroup(point.data(), 1);
    }
    ceres::Solver::Summary summary;
    ceres::Solve(o, problem_.get(), &summary);
    if (getenv("BUNDLE_VERBOSE")) fprintf(stderr, "%s\n", summary.FullReport().c_str());
    if (!summary.IsSolutionUsable()) return false;
    for (auto& [id, pose] : poses_) {
      if (problem_->HasParameterBlock(pose.values) &&
          !problem_->IsParameterBlockConstant(pose.values)) {
        model_.images.at(id).cam_from_model = pose.CamFromScan();
      }
    }
    return true;
  }

 private:
  void AddReprojection(uint32_t image_id, double* point, const Eigen::Vector2d& x_in_img,
                       double weight) {
    Camera& camera = model_.cameras.at(model_.images.at(image_id).camera_id);
    PoseParameters& pose = poses_.at(image_id);
    auto* const cost =
        new ReprojectionCost(pose, camera, x_in_img, weight, options_.refine_intrinsics);
    if (options_.refine_intrinsics) {
      problem_->AddResidualBlock(cost, reprojection_loss_.get(), pose.values, point,
                                 camera.params.data());
    } else {
      problem_->AddResidualBlock(cost, reprojection_loss_.get(), pose.values, point);
    }
  }

  bool Sees(const SparseImage& image, const Eigen::Vector3d& x_in_scan) const {
    return projections_.at(image.camera_id)
        .ImgFromCam(image.cam_from_model * x_in_scan)
        .has_value();
  }

  void AddObservations() {
    for (auto& [id, point] : model_.points) {
      int num_seen = 0;
      for (const TrackElement& element : point.track) {
        num_seen += Sees(model_.images.at(element.image_id), point.x_in_model);
      }
      if (num_seen < 2) continue;
      for (const TrackElement& element : point.track) {
        const SparseImage& image = model_.images.at(element.image_id);
        if (!Sees(image, point.x_in_model)) continue;
        AddReprojection(image.image_id, point.x_in_model.data(),
                        image.points2d[element.point2d_index], 1);
      }
      points_.push_back(point.x_in_model.data());
    }
  }

  void AddPicks() {
    pick_points_.reserve(input_.picks.size());  // Ceres keeps pointers into it
    for (size_t i = 0; i < input_.picks.size(); ++i) {
      const Pick& pick = input_.picks[i];
      const SparseImage* const image = model_.FindImage(pick.image_name);
      const Eigen::Vector3d x_in_scan = input_.bend.Straighten(pick.x_in_scan);
      if (!input_.used[i] || image == nullptr || !Sees(*image, x_in_scan)) continue;
      pick_points_.push_back(x_in_scan);
      double* const point = pick_points_.back().data();
      AddReprojection(image->image_id, point, pick.x_in_img, sigma_px_ / input_.pick_sigma_px);
      problem_->SetParameterBlockConstant(point);
    }
  }

  void AddSurface(const std::vector<SurfaceConstraint>& constraints) {
    // In the first round distances are large because the similarity is rough, not because the
    // points are wrong: the loss widens with them.
    std::vector<double> deviations;
    for (const SurfaceConstraint& c : constraints) {
      deviations.push_back(std::abs(c.Distance(model_.points.at(c.point3d_id).x_in_model)) /
                           c.sigma);
    }
    const double typical = std::max(1.0, 1.4826 * Median(deviations));
    for (const SurfaceConstraint& c : constraints) {
      double* const point = model_.points.at(c.point3d_id).x_in_model.data();
      if (!problem_->HasParameterBlock(point)) continue;
      const double beta = options_.beta > 0 ? options_.beta : sigma_px_ / c.sigma;
      surface_losses_.push_back(
          std::make_unique<ceres::CauchyLoss>(kCauchy * typical * beta * c.sigma));
      problem_->AddResidualBlock(new PlaneCost(beta, c.point, c.normal),
                                 surface_losses_.back().get(), point);
    }
  }

  void AddIntrinsicsPriors() {
    for (auto& [id, camera] : model_.cameras) {
      if (!problem_->HasParameterBlock(camera.params.data())) continue;
      const Camera& given = input_.model.cameras.at(id);
      const int n = static_cast<int>(given.params.size());
      const int num_linear = camera_formulas::NumLinearParams(given.model);
      Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n, n);
      for (int i = 0; i < n; ++i) {
        const double sigma =
            i < num_linear ? kLinearPrior * given.MeanFocalLength() : kDistortionPrior;
        a(i, i) = sigma_px_ / sigma;
      }
      const Eigen::Map<const Eigen::VectorXd> b(given.params.data(), n);
      problem_->AddResidualBlock(new ceres::NormalPrior(a, b), nullptr, camera.params.data());
    }
  }

  void FixClickedView() {
    const SparseImage* const image = model_.FindImage(input_.clicked_image);
    if (image == nullptr) return;
    double* const pose = poses_.at(image->image_id).values;
    if (problem_->HasParameterBlock(pose)) problem_->SetParameterBlockConstant(pose);
  }

  const PlaneBundleInput& input_;
  const PlaneBundleOptions& options_;
  const double sigma_px_;
  SparseModel& model_;
  std::unique_ptr<ceres::LossFunction> reprojection_loss_;
  std::vector<std::unique_ptr<ceres::LossFunction>> surface_losses_;
  std::unique_ptr<ceres::Problem> problem_;
  std::map<uint32_t, PoseParameters> poses_;
  std::map<uint32_t, CameraProjection> projections_;
  std::vector<double*> points_;
  std::vector<Eigen::Vector3d> pick_points_;
};

// How far a round moved the cameras.
bool IsSettled(const SparseModel& before, const SparseModel& after) {
  for (const auto& [id, image] : after.images) {
    const Rigid& old_pose = before.images.at(id).cam_from_model;
    const Rigid& pose = image.cam_from_model;
    if ((pose.TargetOriginInSource() - old_pose.TargetOriginInSource()).norm() > kSettledMetres ||
        RotationAngle(pose.rotation, old_pose.rotation) > kSettledRadians) {
      return false;
    }
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
                     const std::vector<SurfaceConstraint>& constraints) {
  const int num_cameras = static_cast<int>(from.images.size());
  const int n = num_cameras + static_cast<int>(constraints.size());
  Eigen::Matrix3Xd source(3, n), target(3, n);
  int i = 0;
  for (const auto& [id, image] : from.images) {
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

// Compares the adjusted model with the input; a sentence if it went farther than a correction can.
std::string FindRunaway(const PlaneBundleInput& input, PlaneBundle* result) {
  result->adjusted_from_input = FitModels(input.model, result->model, result->constraints);
  const Similarity& moved = result->adjusted_from_input;
  const double limit =
      std::max(kMinBendingLimit, kMaxBending * Extent(input.model, result->constraints));
  double farthest = 0, widest_turn = 0;
  result->max_bending = 0;
  for (const auto& [id, image] : input.model.images) {
    const Rigid& adjusted = result->model.images.at(id).cam_from_model;
    const Rigid expected = CamFromScan(image.cam_from_model, moved);
    const Eigen::Vector3d centre = adjusted.TargetOriginInSource();
    if (!centre.allFinite()) return "The adjustment to the scan's surface gave no finite pose.";
    result->max_bending =
        std::max(result->max_bending, (centre - expected.TargetOriginInSource()).norm());
    farthest = std::max(farthest, (centre - image.cam_from_model.TargetOriginInSource()).norm());
    widest_turn = std::max(widest_turn, RotationAngle(adjusted.rotation, expected.rotation));
  }
  if (!(std::abs(moved.scale - 1) <= kMaxScaleChange) || !(farthest <= kMaxMove)) {
    return "The adjustment to the scan's surface ran away: it moves a camera by " +
           Number(farthest, 2) + " m and changes the scale by " +
           Number(100 * (moved.scale - 1), 1) + " %.";
  }
  if (!(result->max_bending <= limit) || !(widest_turn <= RadFromDeg(kMaxTurn_deg))) {
    return "The adjustment to the scan's surface bends the model: it moves a camera by " +
           Number(result->max_bending, 3) + " m and turns one by " +
           Number(DegFromRad(widest_turn), 2) + " degrees against the others (limits " +
           Number(limit, 3) + " m and " + Number(kMaxTurn_deg, 0) + " degrees).";
  }
  return "";
}

// Points that took no part follow the others.
void MoveIdlePoints(const SparseModel& input, const Similarity& adjusted_from_input,
                    SparseModel* model) {
  for (auto& [id, point] : model->points) {
    const Eigen::Vector3d& before = input.points.at(id).x_in_model;
    if (point.x_in_model == before || !point.x_in_model.allFinite()) {
      point.x_in_model = adjusted_from_input * before;
    }
  }
}

// What is wrong with the result as a whole; empty if nothing is.
std::string FindFault(const PlaneBundle& result) {
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
  return "";
}

// The points that lie on the surface of the scan as it is.
std::vector<SurfaceConstraint> FindConstraints(const PlaneBundleInput& input, int min_track,
                                               const PlaneAssociationOptions& association,
                                               const PlaneBundle& state) {
  std::vector<SurfacePoint> points =
      FindSurfacePoints(state.model, min_track, state.sigma_px, std::numeric_limits<size_t>::max());
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

// Runs the rounds; a sentence if one of them fails.
std::string RunRounds(const PlaneBundleInput& input, const PlaneBundleOptions& options,
                      PlaneBundle* result) {
  PlaneAssociationOptions association;
  association.max_distance = options.max_distance;
  association.surface = options.surface;
  association.surface_noise = options.surface_noise;
  for (int round = 0; round < options.num_rounds; ++round) {
    association.gate = kGates[std::min<size_t>(round, std::size(kGates) - 1)];
    result->constraints = FindConstraints(input, options.min_track, association, *result);
    if (result->constraints.size() < kMinConstraints) {
      return "Only " + std::to_string(result->constraints.size()) +
             " sparse points lie on the scan's planes" +
             (options.surface ? " or flat patches" : "") + ", too few to adjust the poses to them.";
    }
    const SparseModel before = result->model;
    const auto straight = Straightened(result->constraints, result->model, input.bend);
    if (!Round(input, options, result->sigma_px, straight, &result->model).Solve()) {
      return "The adjustment to the scan's surface found no solution.";
    }
    result->num_rounds = round + 1;
    const std::string problem = FindRunaway(input, result);
    if (!problem.empty()) return problem;
    if (association.gate <= kGates[std::size(kGates) - 1] && IsSettled(before, result->model)) {
      break;
    }
  }
  return "";
}

}  // namespace

std::vector<std::string> PlaneBundleOptions::Problems() const {
  std::vector<std::string> problems;
  const auto require = [&problems](bool holds, const std::string& sentence) {
    if (!holds) problems.push_back(sentence);
  };
  require(beta >= 0 && std::isfinite(beta), "--PlaneBA.beta must not be negative");
  require(max_distance > 0, "--PlaneBA.max_distance must be positive");
  require(surface_noise > 0, "--PlaneBA.surface_noise must be positive");
  require(min_track >= 2, "--PlaneBA.min_track must be at least 2");
  require(num_rounds >= 1 && num_rounds <= 100, "--PlaneBA.num_rounds must be 1 to 100");
  require(max_iterations >= 1, "--PlaneBA.max_iterations must be positive");
  return problems;
}

PlaneBundle AdjustToSurface(const PlaneBundleInput& input, const PlaneBundleOptions& options) {
  PlaneBundle result;
  result.model = input.model;
  result.reprojection_rms_before = UpdateReprojectionErrors(&result.model).rms_px;
  result.sigma_px = ImageNoise(result.model);
  result.reason = RunRounds(input, options, &result);
  if (result.reason.empty()) {
    MoveIdlePoints(input.model, result.adjusted_from_input, &result.model);
    result.plane_rms_before = SurfaceRms(input.model, result.constraints);
    result.model = BendModel(result.model, input.bend);
    result.plane_rms_after = SurfaceRms(result.model, result.constraints);
    result.reprojection_rms_after = UpdateReprojectionErrors(&result.model).rms_px;
    result.num_points_of_plane.assign(input.planes.size(), 0);
    for (const SurfaceConstraint& c : result.constraints) {
      if (c.plane >= 0) ++result.num_points_of_plane[c.plane];
    }
    result.reason = FindFault(result);
  }
  result.usable = result.reason.empty();
  if (!result.usable) {
    result.model = input.model;
    result.reprojection_rms_after = UpdateReprojectionErrors(&result.model).rms_px;
  }
  return result;
}

}  // namespace roomtex
