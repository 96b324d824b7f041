#pragma once
// The folder that roomtex-auto makes everything in: what of it is made anew, so that nothing of the
// user's may lie there.

#include "workflow/chain.h"
#include "workflow/run_state.h"

namespace roomtex {

// Throws UsageError if a photo folder, a scan or another input lies where this run puts results, or
// if the output folder lies in one of the photos, whose pictures would be taken for photos the next
// time.
void RequireInputsApart(Chain* chain);

// Throws InputError if a result that this run would replace is there already and no run has made
// it: somebody else's model or database, or a folder of pictures.
void RequireOwnResults(Chain* chain, const RunState& state);

}  // namespace roomtex
