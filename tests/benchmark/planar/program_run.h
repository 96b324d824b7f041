#pragma once
// A program run to its end, with the CPU time of it and all it started.

#include <string>
#include <vector>

namespace roomtex {

struct ProgramRun {
  int exit_code = -1;      // 128 + signal when killed
  double cpu_seconds = 0;  // user + system, the program and the children it waited for
};

// arguments[0] is a path or a name on the PATH. No display; what it prints goes to the file
// log_path. Throws std::runtime_error if it cannot be started. Safe from several threads.
ProgramRun RunProgram(const std::vector<std::string>& arguments, const std::string& log_path);

}  // namespace roomtex
