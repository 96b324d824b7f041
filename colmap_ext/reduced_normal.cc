#include "colmap_ext/reduced_normal.h"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace roomtex {
namespace {

using ByPoint = Eigen::Matrix<double, Eigen::Dynamic, 3, 0, NormalTerms::kMaxSize, 3>;

struct MixedBlock {
  int offset = 0;
  ByPoint product;  // derivatives' product with the point
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
    const ByPoint weighted = a.product * covariance;
    for (const MixedBlock& b : mixed) {
      matrix_.block(a.offset, b.offset, a.product.rows(), b.product.rows()).noalias() -=
          weighted * b.product.transpose();
    }
  }
}

void ReducedNormal::AddInformation(int offset, const Eigen::MatrixXd& information) {
  matrix_.block(offset, offset, information.rows(), information.cols()) += information;
}

namespace {

// The factor of a normal matrix with ones on its diagonal, and what scales it so.
struct ScaledFactor {
  explicit ScaledFactor(const Eigen::MatrixXd& matrix) {
    const Eigen::VectorXd size = matrix.diagonal().cwiseSqrt();
    if (size.size() == 0 || !matrix.allFinite() || !(size.minCoeff() > 0)) return;
    scale = size.cwiseInverse();
    factor.compute(scale.asDiagonal() * matrix * scale.asDiagonal());
    usable = factor.info() == Eigen::Success;
  }

  Eigen::VectorXd scale;
  Eigen::LLT<Eigen::MatrixXd> factor;
  bool usable = false;  // false: something stays open
};

}  // namespace

std::vector<Eigen::MatrixXd> ReducedNormal::Covariances(
    const std::vector<UnknownBlock>& blocks) const {
  const ScaledFactor scaled(matrix_);
  if (!scaled.usable) return {};
  std::vector<Eigen::MatrixXd> covariances;
  for (const UnknownBlock& block : blocks) {
    // With A = L L^T the block is Y^T Y of L Y = (the block's unit vectors), and Y is 0 above them:
    // all blocks together take a third of n^3, the whole inverse two.
    const auto rest = static_cast<Eigen::Index>(matrix_.rows() - block.offset);
    Eigen::MatrixXd solved = Eigen::MatrixXd::Identity(rest, block.size);
    scaled.factor.matrixLLT()
        .bottomRightCorner(rest, rest)
        .triangularView<Eigen::Lower>()
        .solveInPlace(solved);
    const auto by = scaled.scale.segment(block.offset, block.size).asDiagonal();
    covariances.emplace_back(by * (solved.transpose() * solved) * by);
  }
  return covariances;
}

Eigen::MatrixXd ReducedNormal::CovarianceColumns(const std::vector<UnknownBlock>& blocks) const {
  const ScaledFactor scaled(matrix_);
  if (!scaled.usable) return {};
  Eigen::Index count = 0;
  for (const UnknownBlock& block : blocks) count += block.size;
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(matrix_.rows(), count);
  Eigen::Index next = 0;
  for (const UnknownBlock& block : blocks) {
    for (int k = 0; k < block.size; ++k) {
      columns(block.offset + k, next++) = scaled.scale[block.offset + k];
    }
  }
  scaled.factor.solveInPlace(columns);
  return scaled.scale.asDiagonal() * columns;
}

}  // namespace roomtex
