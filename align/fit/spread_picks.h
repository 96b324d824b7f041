#pragma once
// Picks spread over photos none of which has enough for a pose of its own: together they place the
// whole sparse model. Six picks are twelve equations for the seven numbers of a similarity.

#include <limits>
#include <string>
#include <vector>

#include "align/clicks/pick_review.h"
#include "align/fit/similarity_fit.h"

namespace roomtex {

// Whether these picks are such: at least kMinPicksPerPhoto that count, in at least two photos.
bool AreSpreadPicks(const std::vector<Pick>& picks);

struct SpreadPickFit {
  // Locally best scan_from_sparse on the used picks, best first; empty if none has every pick in
  // front of its camera.
  std::vector<SimilarityFit> fits;
  std::vector<double> rms_px;            // of each fit, weighted
  std::vector<bool> used;                // one per pick
  std::vector<double> leave_one_out_px;  // distance from where the other used picks put it; NaN
  std::vector<double> without_px2;       // as PickReview
  // Of a click with weight 1, per coordinate: ClickSigma() of the residuals.
  double sigma_px = 0;
  // Of the used picks if x of the scan is mirrored; whether that is so much better that it must be.
  double mirrored_rms_px = std::numeric_limits<double>::infinity();
  bool mirrored = false;
  // Why these picks cannot place the model, a sentence without its full stop; empty if they can.
  std::string layout_problem;

  bool HasFit() const { return !fits.empty(); }
};

// Starts by SolveRaySimilarities(), refined on the clicks; one in six picks may be bad and is found
// by leaving out each in turn, as in ReviewPicks(). Picks must name images of the model. The
// covariance of fits[i] is that of the picks alone.
SpreadPickFit FitSpreadPicks(const SparseModel& model, const std::vector<Pick>& picks,
                             const PickReviewOptions& options, const SimilarityFitOptions& fit);

}  // namespace roomtex
