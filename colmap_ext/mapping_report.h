#pragma once
// What roomtex-mapper reports of its mapping (docs/commands.md), and its longer sentences.

#include <string>
#include <vector>

#include "colmap_ext/mapping_pass.h"
#include "core/report.h"

namespace roomtex {

// One of `pair_trials`.
Json TrialJson(const PairTrial& trial, const MatchedImages& images, const std::string& outcome);
// The pair, the counts, lenses and `init` of the first model, `images` and, of several, `models`.
// images: all of the database.
void FillMappingReport(const std::vector<MappingPass>& passes, const MatchedImages& images,
                       Report* report);
// Names the pair, and the photo that would cure it.
std::string AmbiguousSentence(const PairTrial& trial, const MatchedImages& images);
// Of photos that fall into several groups, each connected by pairs, where one is mapped; else "".
std::string SeparateGroupsSentence(const MatchedImages& images);

}  // namespace roomtex
