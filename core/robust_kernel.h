#pragma once
// Weights of robust least squares: what a residual still counts (M-estimators as iteratively
// reweighted least squares, Holland and Welsch 1977; the table in Zhang 1997, "Parameter estimation
// techniques", section 9.4, has all of these). For Ceres' solver its own loss functions say the
// same.

#include <cmath>

namespace roomtex {

// Huber 1964: squares up to the limit, linear beyond. residual, limit >= 0.
inline double HuberWeight(double residual, double limit) {
  return residual > limit ? limit / residual : 1.0;
}
// The cost that goes with it, as large as a square below the limit.
inline double HuberCost(double residual, double limit) {
  return residual > limit ? limit * (2 * residual - limit) : residual * residual;
}

// Cauchy's (Lorentz') weight, times `weight`: pulls ever less, but from any distance.
// residual: over the kernel's scale.
inline double CauchyWeight(double residual, double weight = 1) {
  return weight / (1 + residual * residual);
}

// Tukey's biweight (Beaton and Tukey 1974) is the square of this; 0 from the gate on. The root,
// because callers that divide by a variance do so before or after squaring.
inline double TukeyRootWeight(double residual, double gate) {
  const double u = residual / gate;
  return u * u < 1 ? 1 - u * u : 0;
}

// Geman and McClure 1987, times `weight`, from the squared residual over the squared scale: what
// lies far off pulls next to nothing, but no gate cuts it off.
inline double GemanMcClureWeight(double squared_residual, double weight = 1) {
  return weight / std::pow(1 + squared_residual, 2);
}

}  // namespace roomtex
