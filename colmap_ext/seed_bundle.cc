#include "colmap_ext/seed_bundle.h"

#include <cmath>
#include <limits>
#include <memory>

#include <ceres/ceres.h>

#include "colmap_ext/solver_log.h"

namespace roomtex {
namespace {

// Pixel error of a point in the first view, which defines the frame: its rays are the points' own.
struct LeftError {
  explicit LeftError(const Ray& r) : ray(r) {}
  template <typename T>
  bool operator()(const T* point, T* residual) const {
    const T dx = point[0] - ray.x.x(), dy = point[1] - ray.x.y();
    residual[0] = ray.img_from_ray(0, 0) * dx + ray.img_from_ray(0, 1) * dy;
    residual[1] = ray.img_from_ray(1, 0) * dx + ray.img_from_ray(1, 1) * dy;
    return true;
  }
  Ray ray;
};

// Pixel error of a point in another view; q = x y z w as Eigen stores it.
struct ViewError {
  explicit ViewError(const Ray& r) : ray(r) {}
  template <typename T>
  bool operator()(const T* q, const T* t, const T* point, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(q);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> translation(t);
    const Eigen::Matrix<T, 3, 1> direction(point[0], point[1], T(1));
    const Eigen::Matrix<T, 3, 1> x = rotation * direction + point[2] * translation;
    if (x.z() < T(1e-6)) return false;  // behind: the step is refused
    const T dx = x.x() / x.z() - ray.x.x(), dy = x.y() / x.z() - ray.x.y();
    residual[0] = ray.img_from_ray(0, 0) * dx + ray.img_from_ray(0, 1) * dy;
    residual[1] = ray.img_from_ray(1, 0) * dx + ray.img_from_ray(1, 1) * dy;
    return true;
  }
  Ray ray;
};

struct ViewParameters {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
};

ceres::LossFunction* MakeLoss(const SeedBundleOptions& options) {
  return options.loss_scale_px > 0 ? new ceres::CauchyLoss(options.loss_scale_px) : nullptr;
}

ceres::CostFunction* MakeViewCost(const Ray& ray) {
  return new ceres::AutoDiffCostFunction<ViewError, 2, 4, 3, 3>(new ViewError(ray));
}

ceres::Solver::Options SolverOptions(const SeedBundleOptions& options) {
  SilenceCeres();
  ceres::Solver::Options solver;
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = 1e-6;
  solver.num_threads = 1;  // pairs run side by side; the answer must not depend on threads
  solver.logging_type = ceres::SILENT;
  return solver;
}

// A point behind a view would make the cost undefined: observations where that is so at the start
// are left out.
bool InFrontOfView(const SeedGeometry& geometry, const SeedObservation& observation) {
  const Rigid& view = geometry.views_from_left[observation.view];
  const InverseDepthPoint& p = geometry.points[observation.point];
  const Eigen::Vector3d x =
      view.rotation * Eigen::Vector3d(p.x(), p.y(), 1.0) + p.z() * view.translation;
  return x.z() > 1e-4;
}

}  // namespace

SeedBundleResult AdjustSeed(const SeedGeometry& start,
                            const std::vector<SeedObservation>& observations,
                            const SeedBundleOptions& options) {
  SeedBundleResult result;
  result.geometry = start;
  std::vector<InverseDepthPoint>& points = result.geometry.points;
  std::vector<ViewParameters> views;
  for (const Rigid& view : start.views_from_left)
    views.push_back({view.rotation, view.translation});

  ceres::Problem problem;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (const SeedObservation& observation : observations) {
    if (!InFrontOfView(start, observation)) continue;
    double* point = points[observation.point].data();
    if (observation.view == 0) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<LeftError, 2, 3>(new LeftError(observation.ray)),
          MakeLoss(options), point);
    } else {
      ViewParameters& view = views[observation.view];
      problem.AddResidualBlock(MakeViewCost(observation.ray), MakeLoss(options),
                               view.rotation.coeffs().data(), view.translation.data(), point);
    }
    ordering->AddElementToGroup(point, 0);
  }
  for (size_t i = 1; i < views.size(); ++i) {
    double* q = views[i].rotation.coeffs().data();
    double* t = views[i].translation.data();
    if (!problem.HasParameterBlock(q)) continue;
    if (static_cast<int>(i) < options.num_fixed_views) {
      problem.SetParameterBlockConstant(q);
      problem.SetParameterBlockConstant(t);
      continue;
    }
    problem.SetManifold(q, new ceres::EigenQuaternionManifold);
    if (i == 1 && !options.free_baseline) problem.SetManifold(t, new ceres::SphereManifold<3>);
    ordering->AddElementToGroup(q, 1);
    ordering->AddElementToGroup(t, 1);
  }
  if (problem.NumResiduals() < problem.NumParameters() / 2) return result;

  ceres::Solver::Options solver = SolverOptions(options);
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.linear_solver_ordering = ordering;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  for (size_t i = 1; i < views.size(); ++i) {
    result.geometry.views_from_left[i] = {views[i].rotation.normalized(), views[i].translation};
  }
  const double baseline = views.size() > 1 ? views[1].translation.norm() : 0;
  result.usable = summary.IsSolutionUsable() && baseline > 1e-9 && std::isfinite(baseline);
  if (!result.usable || options.num_fixed_views > 1) return result;
  for (size_t i = 1; i < views.size(); ++i) {
    result.geometry.views_from_left[i].translation /= baseline;
  }
  for (InverseDepthPoint& point : points) point.z() *= baseline;
  return result;
}

Rigid AdjustView(const SeedGeometry& geometry, int view,
                 const std::vector<SeedObservation>& observations,
                 const SeedBundleOptions& options) {
  std::vector<InverseDepthPoint> points = geometry.points;
  ViewParameters moved{geometry.views_from_left[view].rotation,
                       geometry.views_from_left[view].translation};
  ceres::Problem problem;
  double* q = moved.rotation.coeffs().data();
  for (const SeedObservation& observation : observations) {
    if (observation.view != view || !InFrontOfView(geometry, observation)) continue;
    double* point = points[observation.point].data();
    problem.AddResidualBlock(MakeViewCost(observation.ray), MakeLoss(options), q,
                             moved.translation.data(), point);
    problem.SetParameterBlockConstant(point);
  }
  if (problem.NumResiduals() < 6) return geometry.views_from_left[view];
  problem.SetManifold(q, new ceres::EigenQuaternionManifold);
  ceres::Solver::Options solver = SolverOptions(options);
  solver.linear_solver_type = ceres::DENSE_QR;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (!summary.IsSolutionUsable()) return geometry.views_from_left[view];
  return {moved.rotation.normalized(), moved.translation};
}

std::vector<double> ObservationErrors(const SeedGeometry& geometry,
                                      const std::vector<SeedObservation>& observations) {
  std::vector<double> errors;
  errors.reserve(observations.size());
  for (const SeedObservation& observation : observations) {
    const auto x = ProjectPoint(geometry.views_from_left[observation.view],
                                geometry.points[observation.point]);
    errors.push_back(x ? observation.ray.PixelError(*x).norm()
                       : std::numeric_limits<double>::infinity());
  }
  return errors;
}

}  // namespace roomtex
