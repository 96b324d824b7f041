#pragma once
// Runs a built command as a user would.

#include <cstdio>
#include <cstdlib>
#include <string>

#include <sys/wait.h>

#include "tests/support/temp_folder.h"

#ifndef ROOMTEX_BIN
#error "ROOMTEX_BIN must name the folder of the built commands"
#endif

namespace roomtex {

struct CommandResult {
  int exit_code = -1;  // 128 + signal when killed
  std::string out, err;
};

// arguments as in a shell, e.g. Run("roomtex-import --help"); the command is taken from the build
// folder.
inline CommandResult RunCommandLine(const std::string& line) {
  const TempFolder folder;
  const std::string full = std::string(ROOMTEX_BIN) + "/" + line + " >" + (folder / "out") + " 2>" +
                           (folder / "err") + " </dev/null";
  const int status = std::system(full.c_str());
  CommandResult result;
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.out = ReadBytes(folder / "out");
  result.err = ReadBytes(folder / "err");
  return result;
}

}  // namespace roomtex
