#include "align/fit/plane_bundle_costs.h"

#include <cmath>

namespace roomtex {
namespace {

using RowMatrix23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;

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

}  // namespace roomtex
