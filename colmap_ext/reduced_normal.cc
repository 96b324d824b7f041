#include "colmap_ext/reduced_normal.h"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace roomtex {
namespace {

struct MixedBlock {
  int offset = 0;
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 12, 3>
      product;  // derivatives' product with the point
};

}  // namespace

ReducedNormal::ReducedNormal(int num_unknowns)
    : matrix_(Eigen::MatrixXd::Zero(num_unknowns, num_unknowns)) {}

void ReducedNormal::AddKnownPoint(const NormalTerms& observation) {
  for (const auto& a : observation.blocks) {
    for (const auto& b : observation.blocks) {
      matrix_.block(a.offset, b.offset, a.by.cols(), b.by.cols()).noalias() +=
          a.by.transpose() * b.by;
    }
  }
}

void ReducedNormal::AddPoint(const std::vector<NormalTerms>& observations,
                             const Eigen::Matrix3d& point_information) {
  Eigen::Matrix3d information = point_information;
  std::vector<MixedBlock> mixed;
  for (const NormalTerms& observation : observations) {
    information += observation.by_point.transpose() * observation.by_point;
    for (const auto& block : observation.blocks) {
      auto at = std::find_if(mixed.begin(), mixed.end(),
                             [&](const MixedBlock& other) { return other.offset == block.offset; });
      if (at == mixed.end()) {
        mixed.push_back({block.offset, Eigen::MatrixXd::Zero(block.by.cols(), 3)});
        at = mixed.end() - 1;
      }
      at->product += block.by.transpose() * observation.by_point;
    }
  }
  const Eigen::Matrix3d covariance = information.inverse();
  if (!covariance.allFinite()) return;
  for (const NormalTerms& observation : observations) AddKnownPoint(observation);
  for (const MixedBlock& a : mixed) {
    const Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 12, 3> weighted = a.product * covariance;
    for (const MixedBlock& b : mixed) {
      matrix_.block(a.offset, b.offset, a.product.rows(), b.product.rows()).noalias() -=
          weighted * b.product.transpose();
    }
  }
}

void ReducedNormal::AddInformation(int offset, const Eigen::MatrixXd& information) {
  matrix_.block(offset, offset, information.rows(), information.cols()) += information;
}

Eigen::MatrixXd ReducedNormal::Covariance() const {
  const Eigen::VectorXd size = matrix_.diagonal().cwiseSqrt();
  if (size.size() == 0 || !matrix_.allFinite() || !(size.minCoeff() > 0)) return {};
  const Eigen::VectorXd scale = size.cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> solver(scale.asDiagonal() * matrix_ * scale.asDiagonal());
  if (solver.info() != Eigen::Success) return {};
  const Eigen::MatrixXd inverse =
      solver.solve(Eigen::MatrixXd::Identity(matrix_.rows(), matrix_.cols()));
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

}  // namespace roomtex
