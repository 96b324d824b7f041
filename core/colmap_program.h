#pragma once
// The program `colmap`: found, asked which options it speaks (3.8 and 4.x differ), and run.

#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/child_program.h"

namespace roomtex {

// Options of one call in order, e.g. {"--Mapper.multiple_models", "0"}.
using ColmapOptions = std::vector<std::pair<std::string, std::string>>;

using ColmapRun = ChildRun;

// Major * 100 + minor of "COLMAP 3.8 (Commit ...)", e.g. 308; 0 if it cannot be read.
int ColmapVersionNumber(const std::string& version);

class ColmapProgram {
 public:
  // program: a path, or a name to look for on PATH. Throws InputError if it is not there, cannot be
  // run or is not COLMAP. All that runs print is appended to the file log_path; "" = nowhere.
  explicit ColmapProgram(const std::string& program, const std::string& log_path = "");

  const std::string& path() const { return path_; }
  const std::string& version() const { return version_; }  // "COLMAP 3.8 (Commit ...)"
  int VersionNumber() const { return ColmapVersionNumber(version_); }
  // Built with CUDA, and there is a card.
  bool CanUseGpu() const { return can_use_gpu_; }
  const std::string& log_path() const { return log_path_; }

  // The options `colmap COMMAND -h` lists, with their dashes. Throws InputError if it has no such
  // command.
  const std::set<std::string>& Options(const std::string& command);

  // Runs `colmap COMMAND OPTIONS` without a shell and without a display, and waits. on_line is
  // called for every line it prints. max_processors: it sees no more than these (-1 = all), for its
  // commands that have no option for threads. Throws Interrupted when a signal stops us: the
  // program is killed first.
  ColmapRun Run(const std::string& command, const ColmapOptions& options, int max_processors = -1,
                const std::function<void(const std::string&)>& on_line = nullptr);

 private:
  ColmapRun RunArguments(const std::vector<std::string>& arguments, int max_processors,
                         const std::function<void(const std::string&)>& on_line);

  std::string path_, log_path_, version_;
  bool can_use_gpu_ = false;
  std::map<std::string, std::set<std::string>> options_of_command_;
};

}  // namespace roomtex
