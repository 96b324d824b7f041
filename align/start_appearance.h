#pragma once
// What appearance says of the starts: an own search by features that photos and scan have in common
// (align/trust/appearance_search.h). Geometry has no part in it, so that a start where both lead
// is no room of the same plan.

#include <vector>

#include "align/alignment_input.h"
#include "align/start_search.h"

namespace roomtex {

struct StartAppearanceOptions {
  // Places of the scan, in cells of 15 cm, that photos show and that agree: at least so many, and
  // so many times those of the next best place. Larger = stricter. Counted: docs/automatic.md.
  int min_cells = 25;
  double min_ratio = 2;
};

// Whether the best place has what the options ask for.
bool StandsOut(const std::vector<AppearancePlace>& places, const StartAppearanceOptions& options);

// A place where photos and scan look alike, by evidence of its own: it is fitted to the surface,
// and becomes a start, or one that is there already is marked (FittedStart::looks_alike), unless a
// hint of the user contradicts. agreeing: what the photos show of the scan there, weight 1.
void AddStartThatLooksAlike(const AlignmentInput& input, const AlignmentOptions& options,
                            const Similarity& scan_from_sparse, const std::vector<Pick>& agreeing,
                            StartSearch* search);

// Fills StartSearch::appearance, unless it is known already, and adds a start where the best place
// stands out and shows more than one object (CellSpread). Does nothing without photos.
void AskAppearance(const AlignmentInput& input, const AlignmentOptions& options,
                   const StartAppearanceOptions& appearance, StartSearch* search);

}  // namespace roomtex
