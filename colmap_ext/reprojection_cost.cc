#include "colmap_ext/reprojection_cost.h"

#include "core/projection_jacobian.h"
#include "core/twist.h"

namespace roomtex {
namespace {

constexpr double kMinDepth = 1e-3;  // metres in front of the camera
// From the keypoint's row to the one that sees the point; each is nearer by the share of the photo
// that the motion shifts what it shows, some thousandths.
constexpr int kRowSteps = 2;
// Derivatives cost by how many there may be; most camera models have no more parameters.
constexpr int kFewParams = 8;

using RowMatrix23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using RowMatrix26 = Eigen::Matrix<double, 2, 6, Eigen::RowMajor>;

}  // namespace

PoseParameters::PoseParameters(const Rigid& cam_from_scan)
    : start_rotation(cam_from_scan.rotation),
      start_matrix(cam_from_scan.rotation.toRotationMatrix()) {
  Eigen::Map<Eigen::Vector3d>(values + 3) = cam_from_scan.TargetOriginInSource();
}

Rigid PoseParameters::CamFromScan() const {
  const Eigen::Map<const Eigen::Vector3d> w(values), centre(values + 3);
  Rigid cam_from_scan;
  cam_from_scan.rotation = (RotationFromVector(w) * start_rotation).normalized();
  cam_from_scan.translation = -(cam_from_scan.rotation * centre);
  return cam_from_scan;
}

ReprojectionCost::ReprojectionCost(const PoseParameters& pose, const Camera& camera,
                                   const Eigen::Vector2d& x_in_img, double weight,
                                   bool refine_intrinsics, const Rigid& cam_from_rig, bool rolls)
    : pose_(pose),
      cam_from_rig_(cam_from_rig.rotation.toRotationMatrix()),
      rig_in_cam_(cam_from_rig.translation),
      camera_(camera),
      x_in_img_(x_in_img),
      weight_(weight),
      refine_intrinsics_(refine_intrinsics),
      rolls_(rolls) {
  set_num_residuals(2);
  *mutable_parameter_block_sizes() = {6, 3};
  if (refine_intrinsics) {
    mutable_parameter_block_sizes()->push_back(static_cast<int>(camera.params.size()));
  }
  if (rolls) mutable_parameter_block_sizes()->push_back(6);
}

bool ReprojectionCost::Evaluate(double const* const* parameters, double* residuals,
                                double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> w(parameters[0]), centre(parameters[0] + 3);
  const Eigen::Map<const Eigen::Vector3d> q(parameters[1]);
  const double* const intrinsics = refine_intrinsics_ ? parameters[2] : camera_.params.data();
  const RotationAndJacobian turn = RotationWithJacobian(w);
  const Eigen::Matrix3d rotation = turn.rotation * pose_.start_matrix;
  const Eigen::Vector3d p_in_rig = rotation * (q - centre);
  const Eigen::Vector3d still = cam_from_rig_ * p_in_rig + rig_in_cam_;
  const int rolls_at = refine_intrinsics_ ? 3 : 2;
  const int num_params = static_cast<int>(camera_.params.size());
  const auto is_before = [&](const Eigen::Vector3d& x) {
    return (camera_.IsPerspective() ? x.z() : x.norm()) > kMinDepth;
  };
  double share = 0;
  RowMotion motion;
  Eigen::Vector3d p = still;
  if (rolls_) {
    motion.turn = Eigen::Map<const Eigen::Vector3d>(parameters[rolls_at]);
    motion.move = Eigen::Map<const Eigen::Vector3d>(parameters[rolls_at] + 3);
    // The row that sees the point. That of the keypoint has the keypoint's noise, which a motion
    // could make smaller: all photos would nod alike and the focal length down the rows shrink.
    share = RowShare(camera_, x_in_img_);
    for (int k = 0; k < kRowSteps; ++k) {
      p = motion(share, still);
      if (!is_before(p)) return false;
      const auto error = ErrorOfPoint<0>(camera_.model, intrinsics, num_params, p, x_in_img_).error;
      share = RowShare(camera_, x_in_img_ + error);
    }
    p = motion(share, still);
  }
  if (!is_before(p)) return false;
  const auto seen = ErrorOfPoint<0>(camera_.model, intrinsics, num_params, p, x_in_img_);
  Eigen::Map<Eigen::Vector2d> residual(residuals);
  residual = weight_ * seen.error;
  if (!residual.allFinite()) return false;
  if (jacobians == nullptr) return true;

  Eigen::Matrix3d p_by_still = Eigen::Matrix3d::Identity();
  Eigen::Matrix2d settled = Eigen::Matrix2d::Identity();
  if (rolls_) {
    p_by_still += share * CrossMatrix(motion.turn);
    // What shifts the point's picture shifts the row that sees it, too.
    const Eigen::Vector2d by_share = seen.by_point * (motion.turn.cross(still) + motion.move);
    settled -= by_share * RowShareByImg(camera_).transpose();
    settled = settled.inverse().eval();
  }
  const Eigen::Matrix2d weight = weight_ * settled;
  const RowMatrix23 by_seen = weight * seen.by_point;
  const RowMatrix23 by_p = by_seen * p_by_still * cam_from_rig_;
  const RowMatrix23 by_q = by_p * rotation;
  if (jacobians[0] != nullptr) {
    Eigen::Map<RowMatrix26> by_pose(jacobians[0]);
    // p_in_rig = exp(w) p0: a small step dw turns it by L dw, which moves it by (L dw) x p_in_rig.
    by_pose.leftCols<3>() = -by_p * CrossMatrix(p_in_rig) * turn.left_jacobian;
    by_pose.rightCols<3>() = -by_q;
  }
  if (jacobians[1] != nullptr) Eigen::Map<RowMatrix23>{jacobians[1]} = by_q;
  if (refine_intrinsics_ && jacobians[2] != nullptr) {
    using ByParams = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>;
    Eigen::Map<ByParams> by_params(jacobians[2], 2, num_params);
    const auto set = [&](const auto& seen_by) {
      by_params = weight * seen_by.by_params.leftCols(num_params);
    };
    if (num_params <= kFewParams) {
      set(ErrorOfPoint<kFewParams>(camera_.model, intrinsics, num_params, p, x_in_img_));
    } else {
      set(ErrorOfPoint<kMaxCameraParams>(camera_.model, intrinsics, num_params, p, x_in_img_));
    }
  }
  if (rolls_ && jacobians[rolls_at] != nullptr) {
    Eigen::Map<RowMatrix26> by_motion(jacobians[rolls_at]);
    by_motion.leftCols<3>() = -share * by_seen * CrossMatrix(still);
    by_motion.rightCols<3>() = share * by_seen;
  }
  return true;
}

}  // namespace roomtex
