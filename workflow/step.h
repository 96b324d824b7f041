#pragma once
// The steps from photos and a scan to a coloured room: one table. A step is commands, as a user
// would type them; roomtex-auto runs them and remembers what came out (run_state.h).

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "workflow/auto_options.h"
#include "workflow/chain.h"

namespace roomtex {

struct Step {
  std::string name;
  std::vector<CommandLine> commands;
  // Written before the commands run: path and content of lists that they read.
  std::vector<std::pair<std::string, std::string>> files;
  std::vector<std::string> notes;            // what was chosen, and why
  std::vector<std::string> inputs, outputs;  // files and folders
  // Instead of commands, for what has no command of its own; told how much is done.
  std::function<void(const std::function<void(double)>&)> action;
};

// A row of the table.
struct StepRow {
  const char* name;
  const char* does;
  bool (*applies)(Chain*);
  Step (*make)(Chain*);
};
const std::vector<StepRow>& StepTable();
std::vector<std::string> StepNames();
// The steps that --from, --until and --only ask for, by their places in the table.
struct StepRange {
  int first = 0, last = 0;
  bool Holds(int index) const { return index >= first && index <= last; }
};
int IndexOfStep(const std::string& name);
StepRange StepsAskedFor(const AutoOptions& options);
bool IsAskedFor(const std::string& step, const AutoOptions& options);

}  // namespace roomtex
