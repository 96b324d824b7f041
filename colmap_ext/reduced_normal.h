#pragma once
// Normal equations of a bundle adjustment with the points eliminated (Schur complement; Triggs et
// al. 2000, "Bundle Adjustment - A Modern Synthesis"): what poses and lenses leave unknown.

#include <vector>

#include <Eigen/Core>

#include "core/camera_model.h"

namespace roomtex {

// Derivatives of one observation over its standard deviation.
struct NormalTerms {
  // The largest block of unknowns is that of a lens.
  static constexpr int kMaxSize = kMaxCameraParams;
  struct Block {
    int offset = 0;  // of the block's unknowns
    Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor, 2, kMaxSize> by;
  };
  std::vector<Block> blocks;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
};

struct UnknownBlock {
  int offset = 0, size = 0;
};

class ReducedNormal {
 public:
  explicit ReducedNormal(int num_unknowns);

  // A point that is unknown, too, with what is known of it otherwise. Nothing is added for a point
  // that stays open.
  void AddPoint(const std::vector<NormalTerms>& observations,
                const Eigen::Matrix3d& point_information);
  // An observation of a point that is known.
  void AddKnownPoint(const NormalTerms& observation);
  // What is known of a block otherwise.
  void AddInformation(int offset, const Eigen::MatrixXd& information);

  // The covariances of these blocks of unknowns, where all the others are unknown, too; none where
  // something stays open.
  std::vector<Eigen::MatrixXd> Covariances(const std::vector<UnknownBlock>& blocks) const;
  // The columns of these blocks, one after the other, in the covariance of all unknowns; 0 x 0
  // where something stays open.
  Eigen::MatrixXd CovarianceColumns(const std::vector<UnknownBlock>& blocks) const;

 private:
  Eigen::MatrixXd matrix_;
};

}  // namespace roomtex
