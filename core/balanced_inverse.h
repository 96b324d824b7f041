#pragma once
// Inverse of a normal matrix whose unknowns differ in size (radians, metres, pixels).

#include <optional>

#include <Eigen/Core>

namespace roomtex {

// Scaled to a unit diagonal before it is judged, symmetric Jacobi scaling (van der Sluis 1969,
// "Condition numbers and equilibration of matrices"): none if its smallest eigenvalue then is not
// above least_eigenvalue, which leaves a direction open.
std::optional<Eigen::MatrixXd> BalancedInverse(const Eigen::MatrixXd& normal,
                                               double least_eigenvalue);

}  // namespace roomtex
