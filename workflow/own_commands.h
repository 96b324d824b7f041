#pragma once
// Commands of roomtex, called as programs.

#include <string>

#include "core/child_program.h"

namespace roomtex {

// The path of roomtex-import, say. Throws InputError if it is not there.
std::string FindOwnCommand(const std::string& name);

// Why it did not end with 0: what its report says, or what it said last.
std::string ReasonOf(const std::string& name, const std::string& report_path, const ChildRun& run);

}  // namespace roomtex
