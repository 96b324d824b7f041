#pragma once
// What the photos say of the starts that fit best: whether they show the scan's intensity where a
// start has it.

#include <vector>

#include "align/alignment_input.h"
#include "align/start_search.h"
#include "align/trust/gradient_shift.h"

namespace roomtex {

struct StartPhotosOptions {
  // Starts that have at least this share of the best score are asked about, so many at most. What
  // has less is no rival (StartVerdictOptions::min_ratio).
  double rival_share = 0.6;
  int max_rivals = 3;
  // A start is drawn to where its photos show the scan so many times at most.
  int max_draws = 3;
};

// Fills FittedStart::photos of the best starts, and of one that looks alike, where it is not known
// yet. Where sparse points and surface differ by centimetres (kExactRms), a start that is fitted to
// the surface can be a few degrees off, too far for photos to confirm: where each of them shows the
// scan's corners shifted alike, the start is first drawn to there, by a fit to these corners and
// the surface.
void AskPhotosOfStarts(const AlignmentInput& input, const AlignmentOptions& options,
                       const StartPhotosOptions& photos, StartSearch* search);

// Corners that photos show, as picks of weight 1: at most `most`, evenly taken. scan_from_sparse:
// what they were looked for with.
std::vector<Pick> PicksOf(const std::vector<FittingCorner>& corners, const SparseModel& model,
                          const Similarity& scan_from_sparse, size_t most);

// Pixels, one standard deviation per coordinate: of half of the corners, how far they are from
// where the similarity has them.
double CornerSigma(const std::vector<Pick>& corners, const SparseModel& model,
                   const Similarity& scan_from_sparse);

}  // namespace roomtex
