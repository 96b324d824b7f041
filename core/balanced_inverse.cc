#include "core/balanced_inverse.h"

#include "core/decompositions.h"

namespace roomtex {

std::optional<Eigen::MatrixXd> BalancedInverse(const Eigen::MatrixXd& normal,
                                               double least_eigenvalue) {
  const Eigen::VectorXd size = normal.diagonal().cwiseSqrt();
  if (!normal.allFinite() || !(size.minCoeff() > 0)) return std::nullopt;
  const Eigen::VectorXd down = size.cwiseInverse();
  const SymmetricEigen of_balanced(down.asDiagonal() * normal * down.asDiagonal());
  if (!(of_balanced.values[0] > least_eigenvalue)) return std::nullopt;
  const Eigen::MatrixXd inverse = of_balanced.vectors *
                                  of_balanced.values.cwiseInverse().asDiagonal() *
                                  of_balanced.vectors.transpose();
  return Eigen::MatrixXd(down.asDiagonal() * inverse * down.asDiagonal());
}

}  // namespace roomtex
