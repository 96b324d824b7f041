#pragma once
// A start, fitted to the surface of the scan: one similarity for the whole model.

#include <limits>
#include <vector>

#include "align/alignment_input.h"
#include "align/fit/model_adjustment.h"
#include "align/fit/similarity_fit.h"
#include "align/start.h"
#include "align/trust/disagreement.h"

namespace roomtex {

struct AlignmentFit {
  std::vector<SurfacePoint> points;  // of the sparse model, those that can be judged
  // On the surface. It is made in any case, as a check of the start; `refined` says whether it is
  // the answer.
  SimilarityFit surface;
  bool refined = false;
  Similarity scan_from_sparse;  // the answer: by the surface or the start's
  // Distances of the picks where the sparse points lie on the surface, pixels; NaN if they could
  // not be brought there. pick_rms_px: of the used ones, NaN without any pick.
  std::vector<double> pick_px;
  double pick_rms_px = std::numeric_limits<double>::quiet_NaN();
  // What the similarity leaves between sparse model and scan, and how far picks are off by it,
  // however well they are made: pixels, the largest over the photos with picks.
  ShapeDisagreement disagreement;
  double pick_bend_px = 0;

  // How far model and scan differ in shape, metres rms; infinite if the two do not meet.
  double ShapeDifference() const {
    return surface.converged ? disagreement.rms : std::numeric_limits<double>::infinity();
  }
};

// Standard deviation of an observation's coordinate, pixels.
double KeypointSigma(const SparseModel& model);

// sigma_px: of an observation of the sparse model, per coordinate (KeypointSigma()).
AlignmentFit FitAlignment(const AlignmentInput& input, const AlignmentStart& start, double sigma_px,
                          const AlignmentOptions& options);

// Poses and points of a fit that is trusted, adjusted to the surface, and lenses that the check of
// the photos (of input.model) found wrong, or that photos leave to the scan. like: an adjustment
// whose bend, or that there is none, is taken over, as AdjustModelLike() has it.
ModelAdjustment AdjustAlignment(const AlignmentInput& input, const AlignmentStart& start,
                                const AlignmentFit& fit, const LensCheck& lenses,
                                const AlignmentOptions& options,
                                const ModelAdjustment* like = nullptr);

}  // namespace roomtex
