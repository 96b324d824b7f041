#include "align/clicks/lens_pose.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include "colmap_ext/solver_log.h"
#include "core/balanced_inverse.h"
#include "core/camera_formulas.h"
#include "core/text.h"
#include "core/twist.h"

namespace roomtex {
namespace {

// Focal lengths that are tried where none is known: shares of the photo's longer side, from a wide
// lens (100 degrees across) to a long one (14).
constexpr std::array<double, 6> kTriedFocal = {0.45, 0.7, 1.05, 1.6, 2.5, 4.0};
constexpr size_t kMaxRefined = 4;  // starts that are refined with the lens
// Third extent of the picks over the first below which they are flat: the depth of a plane and the
// focal length can hardly be told apart.
constexpr double kFlatShare = 0.04;
constexpr double kMinDepth = 1e-6;  // metres
// Log of the focal length's change, radial term, shift of the principal point in pixels.
constexpr int kNumLens = 4;

using Matrix10d = Eigen::Matrix<double, 10, 10>;

// Reprojection error, pixels times weight; pose (w, dt) as in view_pose.cc.
struct LensPickCost {
  template <typename T>
  bool operator()(const T* const pose, const T* const lens, T* residual) const {
    const T at_start[3] = {T(start_point.x()), T(start_point.y()), T(start_point.z())};
    T p[3];
    ceres::AngleAxisRotatePoint(pose, at_start, p);
    for (int i = 0; i < 3; ++i) p[i] += pose[3 + i];
    if (p[2] < T(kMinDepth)) return false;
    const T params[4] = {T(focal) * exp(lens[0]), T(principal.x()) + lens[2],
                         T(principal.y()) + lens[3], lens[1]};
    T x, y;
    camera_formulas::Project(CameraModel::kSimpleRadial, params, T(p[0] / p[2]), T(p[1] / p[2]), &x,
                             &y);
    residual[0] = weight * (x - T(x_in_img.x()));
    residual[1] = weight * (y - T(x_in_img.y()));
    return true;
  }
  double focal;
  Eigen::Vector2d principal;
  Eigen::Vector2d x_in_img;
  Eigen::Vector3d start_point;  // `cam`, as the start has it
  double weight;
};

// What is known of the lens, in pixels of a usual click.
struct LensPriorCost {
  template <typename T>
  bool operator()(const T* const lens, T* residual) const {
    residual[0] = focal_weight * (lens[0] - T(focal_offset));
    residual[1] = radial_weight * lens[1];
    residual[2] = principal_weight * (lens[2] - T(principal_offset.x()));
    residual[3] = principal_weight * (lens[3] - T(principal_offset.y()));
    return true;
  }
  double focal_offset, focal_weight, radial_weight, principal_weight;
  Eigen::Vector2d principal_offset;
};

Camera WithLens(Camera camera, double focal, const Eigen::Vector2d& principal, double radial) {
  camera.params[0] = focal;
  camera.params[1] = principal.x();
  camera.params[2] = principal.y();
  if (camera.params.size() > 3) camera.params[3] = radial;
  return camera;
}

Eigen::Vector2d Principal(const Camera& camera) { return {camera.params[1], camera.params[2]}; }

double SquareOf(double x) { return x * x; }

bool IsSame(const ViewPose& a, const ViewPose& b) {
  return RotationAngle(a.cam_from_scan.rotation, b.cam_from_scan.rotation) < 2e-3 &&
         std::abs(std::log(a.lens->params[0] / b.lens->params[0])) < 2e-3;
}

}  // namespace

const char* FocalSourceName(FocalSource source) {
  switch (source) {
    case FocalSource::kGiven:
      return "params";
    case FocalSource::kExif:
      return "exif";
    case FocalSource::kPicks:
      return "picks";
  }
  return "";
}

std::string FindFocalProblem(const PointPairs& pairs) {
  if (pairs.size() < kMinPicksForFocal) {
    return "nothing says its focal length, and " + std::to_string(pairs.size()) +
           " picks do not tell it: " + std::to_string(kMinPicksForFocal) + " do, not on one plane";
  }
  const Eigen::Vector3d extents = PrincipalExtents(pairs.x_in_scan);
  if (extents[2] > kFlatShare * extents[0]) return "";
  return "nothing says its focal length, and picks that lie on one plane (" +
         Number(extents[2], 2) + " m thick, " + Number(extents[0], 2) +
         " m wide, rms) do not tell it: pick points in front of the plane or behind it";
}

LensPoseSolver::LensPoseSolver(const Camera& camera, FocalSource source)
    : camera_(camera), source_(source) {}

// The radial term has its prior as an equation of its own, and so has what EXIF says.
int LensPoseSolver::num_unknowns() const { return source_ == FocalSource::kPicks ? 7 : 6; }

std::vector<ViewPose> LensPoseSolver::Starts(const PointPairs& pairs,
                                             const std::optional<ViewPose>& start) const {
  std::vector<double> focals = {camera_.params[0]};
  if (source_ == FocalSource::kPicks) {
    focals.clear();
    for (const double share : kTriedFocal) {
      focals.push_back(share * std::max(camera_.width, camera_.height));
    }
  }
  std::vector<ViewPose> starts;
  for (const double focal : focals) {
    const Camera camera = WithLens(camera_, focal, Principal(camera_), 0);
    for (ViewPose& pose : SolveViewPoses(CameraProjection(camera), pairs)) {
      pose.lens = camera;
      starts.push_back(pose);
    }
  }
  std::stable_sort(starts.begin(), starts.end(),
                   [](const ViewPose& a, const ViewPose& b) { return a.sum_px2 < b.sum_px2; });
  if (starts.size() > kMaxRefined) starts.resize(kMaxRefined);
  if (start) starts.push_back(*start);
  return starts;
}

std::optional<ViewPose> LensPoseSolver::Refine(const PointPairs& pairs,
                                               const ViewPose& start) const {
  const double focal = start.lens->params[0];
  double pose[6] = {0, 0, 0, 0, 0, 0};
  const Eigen::Vector2d principal = Principal(*start.lens);
  double lens[kNumLens] = {0, HasRadial() ? start.lens->params[3] : 0, 0, 0};
  ceres::Problem problem;
  for (int i = 0; i < pairs.size(); ++i) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<LensPickCost, 2, 6, kNumLens>(
            new LensPickCost{focal, principal, pairs.x_in_img.col(i),
                             start.cam_from_scan * pairs.x_in_scan.col(i), pairs.WeightOf(i)}),
        nullptr, pose, lens);
  }
  const bool by_exif = source_ == FocalSource::kExif;
  const double focal_weight = by_exif ? kUsualClickSigma / kExifFocalSigma : 0;
  // A camera without a radial term has none.
  const double principal_weight =
      kUsualClickSigma / (kPrincipalSigma * std::max(camera_.width, camera_.height));
  const double radial_weight = kUsualClickSigma / (HasRadial() ? kRadialSigma : 1e-9);
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<LensPriorCost, 4, kNumLens>(
          new LensPriorCost{by_exif ? std::log(camera_.params[0] / focal) : 0, focal_weight,
                            radial_weight, principal_weight, Principal(camera_) - principal}),
      nullptr, lens);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-13;
  options.gradient_tolerance = 1e-13;
  options.parameter_tolerance = 1e-11;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  SilenceCeres();
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) return std::nullopt;

  ViewPose result;
  const Eigen::Map<const Eigen::Matrix<double, 6, 1>> step(pose);
  result.cam_from_scan = MovedInPlace(start.cam_from_scan, step);
  result.lens = WithLens(camera_, focal * std::exp(lens[0]),
                         principal + Eigen::Vector2d(lens[2], lens[3]), lens[1]);
  if (!result.lens->Problems().empty()) return std::nullopt;
  result.residual_px = Residuals(pairs, result);
  const double of_picks = pairs.SumOfSquares(result.residual_px);
  if (!std::isfinite(of_picks)) return std::nullopt;
  result.rms_px = std::sqrt(of_picks / pairs.SumOfSquares(Eigen::VectorXd::Ones(pairs.size())));
  result.sum_px2 = 2 * summary.final_cost;
  const int redundancy = 2 * pairs.size() - num_unknowns();
  result.sigma_px = std::sqrt(result.sum_px2 / std::max(1, redundancy));

  // Covariance, with the clicks' noise as it showed and the priors as they are. The turn of the
  // pose about its solution is the left Jacobian of w away from the one about the start.
  ceres::CRSMatrix jacobian;
  problem.Evaluate({}, nullptr, nullptr, nullptr, &jacobian);
  Matrix10d normal = Matrix10d::Zero();
  const double noise2 = SquareOf(ClickSigma(result.sum_px2, redundancy));
  for (int row = 0; row < jacobian.num_rows; ++row) {
    Eigen::Matrix<double, 10, 1> j = Eigen::Matrix<double, 10, 1>::Zero();
    for (int k = jacobian.rows[row]; k < jacobian.rows[row + 1]; ++k) {
      j[jacobian.cols[k]] = jacobian.values[k];
    }
    const bool is_prior = row >= 2 * pairs.size();
    normal += j * j.transpose() / (is_prior ? SquareOf(kUsualClickSigma) : noise2);
  }
  Matrix10d turned = Matrix10d::Identity();
  turned.topLeftCorner<3, 3>() = RotationWithJacobian(step.head<3>()).left_jacobian;
  turned.block<3, 3>(3, 0) = CrossMatrix(step.tail<3>()) * turned.topLeftCorner<3, 3>();
  if (const auto inverse = BalancedInverse(normal, 1e-13)) {
    const Matrix10d covariance = turned * Matrix10d(*inverse) * turned.transpose();
    result.covariance = covariance.topLeftCorner<6, 6>();
    result.focal_sigma = std::sqrt(covariance(6, 6));
    result.radial_sigma = HasRadial() ? std::sqrt(covariance(7, 7)) : 0;
  } else {
    result.covariance.setConstant(std::numeric_limits<double>::infinity());
    result.focal_sigma = result.radial_sigma = std::numeric_limits<double>::infinity();
  }
  return result;
}

std::vector<ViewPose> LensPoseSolver::Solve(const PointPairs& pairs,
                                            const std::optional<ViewPose>& start) const {
  std::vector<ViewPose> poses;
  for (const ViewPose& one : Starts(pairs, start)) {
    const auto refined = Refine(pairs, one);
    if (refined) poses.push_back(*refined);
  }
  std::stable_sort(poses.begin(), poses.end(),
                   [](const ViewPose& a, const ViewPose& b) { return a.sum_px2 < b.sum_px2; });
  std::vector<ViewPose> distinct;
  for (const ViewPose& pose : poses) {
    const bool known = std::any_of(distinct.begin(), distinct.end(),
                                   [&](const ViewPose& other) { return IsSame(pose, other); });
    if (!known) distinct.push_back(pose);
  }
  return distinct;
}

Eigen::VectorXd LensPoseSolver::Residuals(const PointPairs& pairs, const ViewPose& pose) const {
  return PickResiduals(CameraProjection(*pose.lens), pairs, pose.cam_from_scan);
}

}  // namespace roomtex
