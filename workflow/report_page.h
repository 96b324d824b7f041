#pragma once
// report.html: one file without anything from outside, to read, print and give away.

#include <string>

#include "core/report.h"
#include "workflow/chain.h"

namespace roomtex {

// keys: of MakeReportKeys(). Adds `coverage`, `places_to_photograph` and `plan` {picture (beside
// the page, x from left to right, y up), plan_from_scan (rows of a rotation), low, size (metres,
// see PlanFrame)} to them where the room was coloured. Written aside and renamed. Throws
// InputError.
void WriteReportPage(Chain* chain, Json* keys);

}  // namespace roomtex
