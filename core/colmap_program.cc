#include "core/colmap_program.h"

#include <cstdio>
#include <filesystem>
#include <utility>

#include "core/error.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr char kInstallRemedy[] =
    "Install COLMAP (apt install colmap), or name the program with --colmap";

}  // namespace

int ColmapVersionNumber(const std::string& version) {
  int major = 0, minor = 0;
  if (std::sscanf(version.c_str(), "COLMAP %d.%d", &major, &minor) != 2) return 0;
  return 100 * major + minor;
}

ColmapProgram::ColmapProgram(const std::string& program, const std::string& log_path)
    : path_(FindProgram(program, kInstallRemedy)), log_path_(log_path) {
  bool has_cuda = false;
  const ColmapRun help = RunArguments({"help"}, -1, [&](const std::string& line) {
    if (version_.empty() && BeginsWith(line, "COLMAP ")) version_ = line;
    has_cuda |= line.find("with CUDA") != std::string::npos;
  });
  if (!help.success || version_.empty()) {
    throw InputError(path_, "", "does not answer `help` as COLMAP does (" + help.LastLines() + ")",
                     kInstallRemedy);
  }
  std::error_code ignored;
  can_use_gpu_ = has_cuda && std::filesystem::exists("/dev/nvidia0", ignored);
}

const std::set<std::string>& ColmapProgram::Options(const std::string& command) {
  const auto found = options_of_command_.find(command);
  if (found != options_of_command_.end()) return found->second;
  std::set<std::string> options;
  RunArguments({command, "-h"}, -1, [&](const std::string& line) {
    const size_t begin = line.find("--");
    if (begin == std::string::npos || line.find_first_not_of(" \t") != begin) return;
    options.insert(line.substr(begin, line.find_first_of(" \t=", begin) - begin));
  });
  if (options.empty()) {
    throw InputError(path_, "", "has no command `" + command + "` (" + version_ + ")",
                     "Use COLMAP 3.7 or newer");
  }
  return options_of_command_[command] = options;
}

ColmapRun ColmapProgram::Run(const std::string& command, const ColmapOptions& options,
                             int max_processors,
                             const std::function<void(const std::string&)>& on_line) {
  std::vector<std::string> arguments = {command};
  for (const auto& [name, value] : options) {
    arguments.push_back(name);
    arguments.push_back(value);
  }
  return RunArguments(arguments, max_processors, on_line);
}

ColmapRun ColmapProgram::RunArguments(const std::vector<std::string>& arguments, int max_processors,
                                      const std::function<void(const std::string&)>& on_line) {
  std::vector<std::string> all = {path_};
  all.insert(all.end(), arguments.begin(), arguments.end());
  ChildSettings settings;
  settings.log_path = log_path_;
  settings.max_processors = max_processors;
  settings.on_line = on_line;
  return RunChild(std::move(all), settings);
}

}  // namespace roomtex
