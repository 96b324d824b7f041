#pragma once
// The libraries installed into a folder, and projects of users built against them.

#include <string>
#include <thread>

#include "tests/support/folders.h"
#include "tests/support/run_command.h"

namespace roomtex {

// Libraries, headers and CMake package of this build, into `prefix`.
inline CommandResult InstallLibraries(const std::string& prefix) {
  return RunProgram("cmake --install " + BinFolder() + "/.. --component development --prefix " +
                    prefix);
}

// Configures and builds the project in `source` (a folder of the checkout) against the libraries in
// `prefix`. The answer of the step that failed, else of the last one.
inline CommandResult BuildProject(const std::string& source, const std::string& prefix,
                                  const std::string& build) {
  const CommandResult configured = RunProgram("cmake -S " + SourceFolder() + "/" + source + " -B " +
                                              build + " -DCMAKE_PREFIX_PATH=" + prefix);
  if (configured.exit_code != 0) return configured;
  return RunProgram("cmake --build " + build + " --parallel " +
                    std::to_string(std::thread::hardware_concurrency()));
}

}  // namespace roomtex
