#include "colmap_ext/common_point.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/decompositions.h"

namespace roomtex {
namespace {

// Squared errors of a point in pixels, and the normal equations that lead to where they are least.
struct PointFit {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double sum2 = 0;  // infinite when x lies behind a view

  void Add(const Rigid& cam_from_model, const Ray& ray, const Eigen::Vector3d& x_in_model) {
    const Eigen::Vector3d x = cam_from_model * x_in_model;
    if (!(x.z() > 1e-9)) {
      sum2 = std::numeric_limits<double>::infinity();
      return;
    }
    const Eigen::Vector2d error = ray.PixelError(x.hnormalized());
    Eigen::Matrix<double, 2, 3> projection;
    projection << 1 / x.z(), 0, -x.x() / (x.z() * x.z()), 0, 1 / x.z(), -x.y() / (x.z() * x.z());
    const Eigen::Matrix<double, 2, 3> jacobian =
        ray.img_from_ray * projection * cam_from_model.rotation.toRotationMatrix();
    hessian += jacobian.transpose() * jacobian;
    gradient += jacobian.transpose() * error;
    sum2 += error.squaredNorm();
  }
};

}  // namespace

double GrowthByView(const CommonPoint& common, const Rigid& view_from_model) {
  Eigen::Vector3d x = common.point->x_in_model;
  double without = 0, best = std::numeric_limits<double>::infinity();
  for (int step = 0; step < 6; ++step) {
    PointFit fit;
    for (const auto& [cam_from_model, ray] : common.sights) fit.Add(cam_from_model, ray, x);
    if (step == 0) without = fit.sum2;  // the model's points are adjusted
    fit.Add(view_from_model, common.ray, x);
    best = std::min(best, fit.sum2);
    if (!std::isfinite(fit.sum2)) break;
    x -= SolveSymmetric(fit.hessian, fit.gradient);
    if (!x.allFinite()) break;
  }
  return std::max(0.0, best - without);
}

}  // namespace roomtex
