#pragma once
// Inverse of a normal matrix whose unknowns differ in size (radians, metres, pixels).

#include <optional>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

namespace roomtex {

// Scaled to a unit diagonal before it is judged, symmetric Jacobi scaling (van der Sluis 1969,
// "Condition numbers and equilibration of matrices"): none if its smallest eigenvalue then is not
// above least_eigenvalue, which leaves a direction open.
template <int N>
std::optional<Eigen::Matrix<double, N, N>> BalancedInverse(
    const Eigen::Matrix<double, N, N>& normal, double least_eigenvalue) {
  using Matrix = Eigen::Matrix<double, N, N>;
  const Eigen::Matrix<double, N, 1> size = normal.diagonal().cwiseSqrt();
  if (!normal.allFinite() || !(size.minCoeff() > 0)) return std::nullopt;
  const Matrix balanced =
      size.cwiseInverse().asDiagonal() * normal * size.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(balanced);
  if (!(solver.eigenvalues()[0] > least_eigenvalue)) return std::nullopt;
  const Matrix inverse = solver.eigenvectors() * solver.eigenvalues().cwiseInverse().asDiagonal() *
                         solver.eigenvectors().transpose();
  return size.cwiseInverse().asDiagonal() * inverse * size.cwiseInverse().asDiagonal();
}

}  // namespace roomtex
