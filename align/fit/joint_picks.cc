#include "align/fit/joint_picks.h"

#include <algorithm>
#include <limits>

#include "core/statistics.h"

namespace roomtex {

JointPickFit FitPicksJointly(const SparseModel& model, const std::vector<Pick>& picks,
                             const std::vector<bool>& used, double sigma_px,
                             const Similarity& start, const SimilarityFitOptions& options,
                             double min_bad_pick_px) {
  JointPickFit joint{false, start, used,
                     std::vector<double>(picks.size(), std::numeric_limits<double>::quiet_NaN())};
  for (int round = 0; round < 2; ++round) {
    const SimilarityFit fit =
        FitToPicks(model, picks, joint.used, sigma_px, joint.scan_from_sparse, options);
    if (!fit.converged) return joint;
    joint.converged = true;
    joint.scan_from_sparse = fit.scan_from_sparse;
    if (round == 1) break;
    const Eigen::Matrix2Xd errors = PickErrors(model, picks, joint.scan_from_sparse);
    std::vector<double> residuals;
    for (size_t i = 0; i < picks.size(); ++i) {
      const double residual = errors.col(static_cast<int>(i)).norm();
      if (joint.used[i]) residuals.push_back(picks[i].weight * residual);
    }
    // 4.5 standard deviations are exceeded by 1 click in 25 000.
    const double limit =
        std::max(min_bad_pick_px, 4.5 / kMedianLengthPerSigma * Median(&residuals));
    for (size_t i = 0; i < picks.size(); ++i) {
      const double residual = errors.col(static_cast<int>(i)).norm();
      if (!joint.used[i] || !(picks[i].weight * residual > limit)) continue;
      joint.used[i] = false;
      joint.left_out_px[i] = residual;
    }
  }
  return joint;
}

}  // namespace roomtex
