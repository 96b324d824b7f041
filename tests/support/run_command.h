#pragma once
#include <string>

namespace roomtex {

struct CommandResult {
  int exit_code = -1;  // 128 + signal when killed
  std::string out, err;
};

// Runs a built command as a user would, arguments as in a shell, e.g.
// RunCommandLine("roomtex-import --help"); the command is taken from the build folder.
CommandResult RunCommandLine(const std::string& line);
// The same for any program, by its path or found on PATH: RunProgram("cmake --version").
CommandResult RunProgram(const std::string& line);

}  // namespace roomtex
