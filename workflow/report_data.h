#pragma once
// What came out, collected from the steps' own reports: the keys of report.json, and what the page
// shows.

#include "core/report.h"
#include "workflow/run_steps.h"

namespace roomtex {

// verdict {state, headline, sentences[]}, remedies[], facts[] {name, value}, warnings[], photos[],
// steps[], total {seconds, peak_memory_bytes}, versions, command.
Json MakeReportKeys(Chain* chain, const RunResult& result);

}  // namespace roomtex
