#pragma once
// What a person can do where roomtex-align is not sure where the photos stand in the scan.

#include <string>
#include <vector>

#include "workflow/chain.h"

namespace roomtex {

// By what its report says of the search, the least work first; sentences and command lines.
std::vector<std::string> AlignRemedies(const Chain& chain, const Json& report);

}  // namespace roomtex
