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

// kParams: 0 or kMaxCameraParams.
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

}  // namespace roomtex
