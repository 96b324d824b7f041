#pragma once
// Pairs to start from, one after the other, until COLMAP makes a model of one.

#include <vector>

#include "colmap_ext/mapping_pass.h"

namespace roomtex {

// The model of most photos, those that COLMAP leaves out chained; nothing if no pair gives one. At
// most one. init: of the pairs, instead of that of `options`. trials: gets one entry of the
// report's `pair_trials` for each pair that was looked at.
std::vector<MappingOutcome> TrySeeds(const Database& database, MatchedImages* images,
                                     MapperRun* mapper, const MappingOptions& options,
                                     const InitOptions& init, const Command::Context& context,
                                     Json* trials);

}  // namespace roomtex
