#pragma once
// An alignment without picks, or with fewer than fix a pose: starts are searched for, judged, and
// the best one is fitted and adjusted as after clicks.

#include <optional>
#include <string>
#include <vector>

#include "align/alignment.h"
#include "align/mirrored_reading.h"
#include "align/start_search.h"
#include "align/start_verdict.h"

namespace roomtex {

struct AutomaticAlignment {
  StartSearch search;
  StartVerdict verdict;
  // Its reasons hold that of the verdict.
  AlignmentAttempt attempt;
};

// Fewer picks than fix a pose, so that they can only be a hint.
bool AreHints(const std::vector<Pick>& picks);

// Whether an alignment has to be held by corners that photos show where the scan has them: the
// surface leaves something open, or it holds the model by a part of the room alone, without which
// the fit lies elsewhere; or it drew the model away from where the photos confirmed the start.
// sigma_px: CornerSigma() there. model: the input's; corners are measured in what was aligned of
// it, which may have other lenses, or still rows.
bool NeedsCorners(const Alignment& alignment, const std::vector<Pick>& corners, double sigma_px,
                  const SparseModel& model);

// input.picks: hints, may be empty. near: names must be in the model.
AutomaticAlignment AlignAutomatically(const AlignmentInput& input,
                                      const std::vector<NearHint>& near,
                                      const AlignmentOptions& options, Progress* progress);

}  // namespace roomtex
