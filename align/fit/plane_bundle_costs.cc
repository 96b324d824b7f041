#include "align/fit/plane_bundle_costs.h"

#include <cmath>

#include <ceres/jet.h>

#include "core/camera_formulas.h"

namespace roomtex {
namespace {

constexpr int kMaxCameraParams = 12;
constexpr double kMinDepth = 1e-3;  // metres in front of the camera

using RowMatrix23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using RowMatrix26 = Eigen::Matrix<double, 2, 6, Eigen::RowMajor>;

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

// exp(w) and the matrix L of exp(w + L^-1 e) ~ exp(e) exp(w): the left Jacobian of the rotations.
void Rotation(const Eigen::Vector3d& w, Eigen::Matrix3d* rotation, Eigen::Matrix3d* left) {
  const double angle2 = w.squaredNorm();
  double a = 1 - angle2 / 6, b = 0.5 - angle2 / 24, c = 1.0 / 6 - angle2 / 120;
  if (angle2 > 1e-6) {
    const double angle = std::sqrt(angle2);
    a = std::sin(angle) / angle;
    b = (1 - std::cos(angle)) / angle2;
    c = (1 - a) / angle2;
  }
  const Eigen::Matrix3d cross = Cross(w), cross2 = cross * cross;
  *rotation = Eigen::Matrix3d::Identity() + a * cross + b * cross2;
  *left = Eigen::Matrix3d::Identity() + b * cross + c * cross2;
}

// Position in `img` of the ray (x, y, 1) and its derivatives by (x, y).
void Project(const Camera& camera, const double* params, double x, double y,
             Eigen::Vector2d* x_in_img, Eigen::Matrix2d* by_ray) {
  using Jet = ceres::Jet<double, 2>;
  Jet jets[kMaxCameraParams], img[2];
  for (size_t i = 0; i < camera.params.size(); ++i) jets[i] = Jet(params[i]);
  camera_formulas::Project(camera.model, jets, Jet(x, 0), Jet(y, 1), &img[0], &img[1]);
  for (int i = 0; i < 2; ++i) {
    (*x_in_img)[i] = img[i].a;
    by_ray->row(i) = img[i].v.transpose();
  }
}

// Derivatives of the position in `img` by the camera's parameters; 2 x n, by rows.
void ProjectByParams(const Camera& camera, const double* params, double x, double y, double weight,
                     double* jacobian) {
  using Jet = ceres::Jet<double, kMaxCameraParams>;
  const int n = static_cast<int>(camera.params.size());
  Jet jets[kMaxCameraParams], img[2];
  for (int i = 0; i < n; ++i) jets[i] = Jet(params[i], i);
  camera_formulas::Project(camera.model, jets, Jet(x), Jet(y), &img[0], &img[1]);
  for (int row = 0; row < 2; ++row) {
    for (int i = 0; i < n; ++i) jacobian[row * n + i] = weight * img[row].v[i];
  }
}

}  // namespace

bool PlaneCost::Evaluate(double const* const* parameters, double* residuals,
                         double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> q(parameters[0]);
  const double weight = beta_ / std::sqrt(2.0);
  residuals[0] = residuals[1] = weight * normal_.dot(q - point_);  // Thesis (C.3)
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    Eigen::Map<RowMatrix23> by_q(jacobians[0]);
    by_q.row(0) = by_q.row(1) = weight * normal_.transpose();
  }
  return true;
}

PoseParameters::PoseParameters(const Rigid& cam_from_scan)
    : start_rotation(cam_from_scan.rotation),
      start_matrix(cam_from_scan.rotation.toRotationMatrix()) {
  Eigen::Map<Eigen::Vector3d>(values + 3) = cam_from_scan.TargetOriginInSource();
}

Rigid PoseParameters::CamFromScan() const {
  const Eigen::Map<const Eigen::Vector3d> w(values), centre(values + 3);
  const double angle = w.norm();
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  if (angle > 0) turn = Eigen::AngleAxisd(angle, w / angle);
  Rigid cam_from_scan;
  cam_from_scan.rotation = (turn * start_rotation).normalized();
  cam_from_scan.translation = -(cam_from_scan.rotation * centre);
  return cam_from_scan;
}

ReprojectionCost::ReprojectionCost(const PoseParameters& pose, const Camera& camera,
                                   const Eigen::Vector2d& x_in_img, double weight,
                                   bool refine_intrinsics)
    : pose_(pose),
      camera_(camera),
      x_in_img_(x_in_img),
      weight_(weight),
      refine_intrinsics_(refine_intrinsics) {
  set_num_residuals(2);
  *mutable_parameter_block_sizes() = {6, 3};
  if (refine_intrinsics) {
    mutable_parameter_block_sizes()->push_back(static_cast<int>(camera.params.size()));
  }
}

bool ReprojectionCost::Evaluate(double const* const* parameters, double* residuals,
                                double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> w(parameters[0]), centre(parameters[0] + 3);
  const Eigen::Map<const Eigen::Vector3d> q(parameters[1]);
  const double* const intrinsics = refine_intrinsics_ ? parameters[2] : camera_.params.data();
  Eigen::Matrix3d turn, left;
  Rotation(w, &turn, &left);
  const Eigen::Matrix3d rotation = turn * pose_.start_matrix;
  const Eigen::Vector3d p = rotation * (q - centre);
  if (!(p.z() > kMinDepth)) return false;
  const double x = p.x() / p.z(), y = p.y() / p.z();
  Eigen::Vector2d x_in_img;
  Eigen::Matrix2d by_ray;
  Project(camera_, intrinsics, x, y, &x_in_img, &by_ray);
  Eigen::Map<Eigen::Vector2d> residual(residuals);
  residual = weight_ * (x_in_img - x_in_img_);
  if (!residual.allFinite()) return false;
  if (jacobians == nullptr) return true;

  RowMatrix23 ray_by_p;
  ray_by_p << 1, 0, -x, 0, 1, -y;
  const RowMatrix23 by_p = weight_ / p.z() * by_ray * ray_by_p;
  const RowMatrix23 by_q = by_p * rotation;
  if (jacobians[0] != nullptr) {
    Eigen::Map<RowMatrix26> by_pose(jacobians[0]);
    // p = exp(w) p0: a small step dw turns p by L dw, which moves it by (L dw) x p.
    by_pose.leftCols<3>() = -by_p * Cross(p) * left;
    by_pose.rightCols<3>() = -by_q;
  }
  if (jacobians[1] != nullptr) Eigen::Map<RowMatrix23>{jacobians[1]} = by_q;
  if (refine_intrinsics_ && jacobians[2] != nullptr) {
    ProjectByParams(camera_, intrinsics, x, y, weight_, jacobians[2]);
  }
  return true;
}

}  // namespace roomtex
