#pragma once
// The residuals of the plane-constrained bundle adjustment with their derivatives (thesis 7.2,
// Appendix C): distances from planes, beside reprojection errors. Only plane_bundle.cc and tests
// use them.

#include <Eigen/Core>
#include <ceres/sized_cost_function.h>

#include "colmap_ext/reprojection_cost.h"

namespace roomtex {

// Thesis (C.3): (beta / sqrt 2) * n . (q - t), twice: point q (3 parameters, `scan`, metres) off
// the plane (t, n); beta in pixels per metre, residuals in pixels. Jacobian: twice (beta / sqrt 2)
// * n^T. One row beta * n . (q - t) would have the same cost and gradient; two rows, like those of
// a pixel, let the solver use its code for rows of one size (the thesis' reason, too): 20 000
// points take half the time.
class PlaneCost : public ceres::SizedCostFunction<2, 3> {
 public:
  PlaneCost(double beta_px_per_m, const Eigen::Vector3d& point, const Eigen::Vector3d& normal)
      : beta_(beta_px_per_m), point_(point), normal_(normal) {}
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  double beta_;
  Eigen::Vector3d point_, normal_;
};

// How far a hand turns and moves a camera while a photo is read: RowMotion over its standard
// deviation per axis, radians (10 degrees per second for 30 ms) and metres.
inline Eigen::Matrix<double, 6, 6> RowMotionPrior() {
  constexpr double kTurn = 0.005, kMove = 0.002;
  Eigen::Matrix<double, 6, 1> weights;
  weights << Eigen::Vector3d::Constant(1 / kTurn), Eigen::Vector3d::Constant(1 / kMove);
  return weights.asDiagonal();
}

}  // namespace roomtex
