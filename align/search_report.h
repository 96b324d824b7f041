#pragma once
// The report's `search`: where a start without clicks came from, what else fitted, and what speaks
// for it.

#include "align/automatic_alignment.h"
#include "core/report.h"

namespace roomtex {

Json SearchToJson(const AutomaticAlignment& found);

}  // namespace roomtex
