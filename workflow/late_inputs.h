#pragma once
// What no step reads before the last ones do. Looked at when a run begins, so that what is wrong
// there is said before the hours that features and matches take.

#include "workflow/auto_options.h"

namespace roomtex {

// Reads the scans as roomtex-align will, and the picks' table. Throws InputError or UsageError as
// it would. No more than one scan is held at a time. Progress is for the caller to tell.
void RequireReadableScans(const AutoOptions& options);
// Columns and numbers; which photos they name is known when there is a model.
void RequireReadablePicks(const std::string& path);

}  // namespace roomtex
