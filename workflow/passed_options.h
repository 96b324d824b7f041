#pragma once
// Options that roomtex-auto hands on to the commands of its steps.

#include "workflow/chain.h"

namespace roomtex {

// A slip of the finger is said before the first step, not hours later by the one that it was meant
// for. Throws UsageError for a name that its command does not have.
void CheckPassedOptions(Chain* chain);

}  // namespace roomtex
