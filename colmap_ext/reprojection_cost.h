#pragma once
// The reprojection error of a bundle adjustment with its derivatives by pose, point and camera.
// Frame: `scan` stands for any frame that a model lies in.

#include <Eigen/Core>
#include <ceres/cost_function.h>

#include "core/camera_model.h"
#include "core/row_motion.h"
#include "core/similarity.h"

namespace roomtex {

// Reprojection and click errors beyond this many standard deviations count linearly (Huber 1964),
// in the adjustment and in what is said of its result.
inline constexpr double kReprojectionHuber = 2.5;

// A pose near `cam_from_scan`: x_in_cam = exp(w) R (x_in_scan - centre).
struct PoseParameters {
  // w (radians), centre (`scan`).
  double values[6] = {0, 0, 0, 0, 0, 0};
  Eigen::Quaterniond start_rotation = Eigen::Quaterniond::Identity();  // R
  Eigen::Matrix3d start_matrix = Eigen::Matrix3d::Identity();          // of R

  explicit PoseParameters(const Rigid& cam_from_scan);
  Rigid CamFromScan() const;
};

// weight * CameraProjection::ImgError, pixels. Parameters: the pose (6, PoseParameters) of the
// camera, or of the rig that holds it (cam_from_rig is fixed), the point (3, `scan`), with
// refine_intrinsics those of the camera, and with `rolls` the photo's RowMotion (turn, move). Fails
// for a point that is not in front of the camera. `pose` and `camera` must outlive it.
class ReprojectionCost : public ceres::CostFunction {
 public:
  ReprojectionCost(const PoseParameters& pose, const Camera& camera,
                   const Eigen::Vector2d& x_in_img, double weight, bool refine_intrinsics,
                   const Rigid& cam_from_rig = Rigid(), bool rolls = false);
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  const PoseParameters& pose_;
  Eigen::Matrix3d cam_from_rig_;
  Eigen::Vector3d rig_in_cam_;
  const Camera& camera_;
  Eigen::Vector2d x_in_img_;
  double weight_;
  bool refine_intrinsics_;
  bool rolls_;
};

}  // namespace roomtex
