#pragma once
// Runs the steps of the table that are not done yet.

#include <string>
#include <vector>

#include "core/command_line.h"
#include "workflow/chain.h"
#include "workflow/run_state.h"

namespace roomtex {

// What became of a step in this run.
struct StepOutcome {
  std::string name, does;
  bool ran = false;    // false: was done before, or is not asked for
  bool known = false;  // it has a record, of this run or an earlier one
  // Passed over by --from or --only, and why what it left is not that of these inputs and options
  // ("changed: picks.csv"); "" = it is, or it ran.
  std::string outdated;
  StepRecord record;
  Json report;  // its command's own; null if there is none
};

// The mapper did not trust its model for nothing but what roomtex-align, which reads it, judges
// anew by scan and photos: how the cameras moved, and the lenses (colmap_ext/mapper_verdict.h). Too
// few photos are still too few.
bool IsLeftToAlign(const StepOutcome& outcome);

// Why a run ended before its last step.
struct Stop {
  bool stopped = false;
  // --from or --only passed over what `step`, the first one asked for, needs: it has not run.
  bool cannot_begin = false;
  std::string step, reason;
  int exit_code = 0;                  // kExitUntrusted, kExitInput or kExitInternalError
  std::vector<std::string> remedies;  // what a person can do, sentences and command lines
};

struct RunResult {
  std::vector<StepOutcome> steps;  // that apply, in the table's order
  Stop stop;
  bool whole = false;  // every step up to the pictures is done
};

// Prints the command lines as it goes. Throws Interrupted when a signal stops it.
RunResult RunSteps(Chain* chain, const Command::Context& context);

// Prints the command lines on stdout, as far as they are known before the steps have run.
void PrintSteps(Chain* chain);

}  // namespace roomtex
