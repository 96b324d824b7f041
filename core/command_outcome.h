#pragma once
// How the body of a command ended: its exception as exit code and sentence. For command_line.cc.

#include <functional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/input_guard.h"
#include "core/progress.h"

namespace roomtex {

struct Outcome {
  int exit_code = kExitDone;
  std::string failure;
  int signal = 0;  // that stopped it

  bool IsOutOfMemory() const;
};
// Runs it and catches whatever it throws.
Outcome RunBody(const std::function<void()>& body);

// Who ran out of memory, at what, with which inputs, and what to do.
std::string TellMemory(const Progress& progress,
                       const std::vector<GuardedPaths::OptionPath>& inputs);

}  // namespace roomtex
