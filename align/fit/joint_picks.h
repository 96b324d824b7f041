#pragma once
// Picks of several photos as one answer.

#include <vector>

#include "align/fit/similarity_fit.h"

namespace roomtex {

struct JointPickFit {
  bool converged = false;
  Similarity scan_from_sparse;      // the start's, if nothing converged
  std::vector<bool> used;           // those given, without the ones that then stand far off
  std::vector<double> left_out_px;  // of a pick that was left out: how far off it stood
};

// FitToPicks() on all picks, once more without those farther than 4.5 standard deviations of a
// click (from the median) and min_bad_pick_px from where the others put them.
JointPickFit FitPicksJointly(const SparseModel& model, const std::vector<Pick>& picks,
                             const std::vector<bool>& used, double sigma_px,
                             const Similarity& start, const SimilarityFitOptions& options,
                             double min_bad_pick_px);

}  // namespace roomtex
