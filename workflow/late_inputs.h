#pragma once
// Scans, which no step reads before the last ones do. Looked at when a run begins, so that what is
// wrong there is said before the hours that features and matches take.

#include <string>

#include "workflow/chain.h"

namespace roomtex {

// Has roomtex-import read the scans as roomtex-align will, one after the other. What it prints and
// reports lies in log/scans.log and .json. Throws InputError or UsageError with what it says, and
// Interrupted.
void RequireReadableScans(const Chain& chain);

}  // namespace roomtex
