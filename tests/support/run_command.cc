#include "tests/support/run_command.h"

#include <cstdlib>

#include <sys/wait.h>

#include "tests/support/folders.h"
#include "tests/support/temp_folder.h"

namespace roomtex {

CommandResult RunCommandLine(const std::string& line) {
  return RunProgram(BinFolder() + "/" + line);
}

CommandResult RunProgram(const std::string& line) {
  const TempFolder folder;
  const std::string full =
      line + " >" + (folder / "out") + " 2>" + (folder / "err") + " </dev/null";
  const int status = std::system(full.c_str());
  CommandResult result;
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.out = ReadBytes(folder / "out");
  result.err = ReadBytes(folder / "err");
  return result;
}

}  // namespace roomtex
