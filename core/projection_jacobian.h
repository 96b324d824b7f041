#pragma once
// Where a camera sees a viewing ray, and how that changes with the ray and with the camera's
// parameters, by Ceres' automatic differentiation. For folders that link Ceres: core itself does
// not.

#include <vector>

#include <Eigen/Core>
#include <ceres/jet.h>

#include "core/camera_formulas.h"
#include "core/camera_model.h"

namespace roomtex {

// kParams: 0 (derivatives by the ray alone), or no less than the model has, kMaxCameraParams at
// most.
template <int kParams>
struct ProjectedRay {
  Eigen::Vector2d x_in_img;
  Eigen::Matrix2d by_ray;  // by x and y of the ray (x, y, 1)
  // By the camera's parameters, in COLMAP's order; 0 for those that the model lacks.
  Eigen::Matrix<double, 2, kParams> by_params;
};

// params: of the model, num_params of them. Not checked: that the ray is within the valid field of
// the distortion (CameraProjection::max_radius).
template <int kParams>
ProjectedRay<kParams> ProjectRay(CameraModel model, const double* params, int num_params, double x,
                                 double y) {
  using Jet = ceres::Jet<double, kParams + 2>;
  Jet jets[kMaxCameraParams], img[2];
  for (int i = 0; i < num_params; ++i) {
    jets[i] = Jet(params[i]);
    if constexpr (kParams > 0) jets[i].v[i] = 1;
  }
  camera_formulas::Project(model, jets, Jet(x, kParams), Jet(y, kParams + 1), &img[0], &img[1]);
  ProjectedRay<kParams> projected;
  for (int i = 0; i < 2; ++i) {
    projected.x_in_img[i] = img[i].a;
    projected.by_ray.row(i) = img[i].v.template tail<2>().transpose();
    projected.by_params.row(i) = img[i].v.template head<kParams>().transpose();
  }
  return projected;
}

// CameraProjection::ImgError of any camera, for a point in `cam` that it sees.
template <int kParams>
struct PointError {
  Eigen::Vector2d error;
  Eigen::Matrix<double, 2, 3> by_point;
  Eigen::Matrix<double, 2, kParams> by_params;  // as in ProjectedRay; a panorama's are 0
};

template <int kParams>
PointError<kParams> ErrorOfPoint(CameraModel model, const double* params, int num_params,
                                 const Eigen::Vector3d& x_in_cam, const Eigen::Vector2d& x_in_img) {
  PointError<kParams> result;
  if (camera_formulas::IsPerspective(model)) {
    const double x = x_in_cam.x() / x_in_cam.z(), y = x_in_cam.y() / x_in_cam.z();
    const auto seen = ProjectRay<kParams>(model, params, num_params, x, y);
    result.error = seen.x_in_img - x_in_img;
    Eigen::Matrix<double, 2, 3> ray_by_point;
    ray_by_point << 1, 0, -x, 0, 1, -y;
    result.by_point = 1 / x_in_cam.z() * seen.by_ray * ray_by_point;
    result.by_params = seen.by_params;
    return result;
  }
  using Jet = ceres::Jet<double, kParams + 3>;
  Jet jets[kMaxCameraParams], point[3], error[2];
  for (int i = 0; i < num_params; ++i) {
    jets[i] = Jet(params[i]);
    if constexpr (kParams > 0) jets[i].v[i] = 1;
  }
  for (int i = 0; i < 3; ++i) point[i] = Jet(x_in_cam[i], kParams + i);
  camera_formulas::ImgError(model, jets, point[0], point[1], point[2], x_in_img, &error[0],
                            &error[1]);
  for (int i = 0; i < 2; ++i) {
    result.error[i] = error[i].a;
    result.by_point.row(i) = error[i].v.template tail<3>().transpose();
    result.by_params.row(i) = error[i].v.template head<kParams>().transpose();
  }
  return result;
}

}  // namespace roomtex
