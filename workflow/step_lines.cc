// What the rows of the table share (step_lines.h).

#include "workflow/step_lines.h"

#include <algorithm>

#include "core/error.h"
#include "core/input_guard.h"

namespace roomtex {
namespace {

constexpr Quality kQualities[] = {
    {"low", 1600, 4096, false, "1", 60},
    {"medium", 3200, 8192, false, "auto", 120},
    {"high", 6400, 16384, true, "auto", 240},
};

std::string Spelled(const std::set<std::string>& options, const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    if (options.count("--" + name) > 0) return "--" + name;
  }
  return "";
}

}  // namespace

const Quality& QualityOf(const AutoOptions& options) {
  for (const Quality& quality : kQualities) {
    if (options.quality == quality.name) return quality;
  }
  throw UsageError("--quality is \"" + options.quality + "\"");
}

void AddPassed(const std::vector<std::string>& passed, CommandLine* line) {
  for (size_t i = 0; i + 1 < passed.size(); i += 2) {
    const auto ours = std::find(line->begin(), line->end(), passed[i]);
    if (ours != line->end()) line->erase(ours, ours + 2);
    AddOption(passed[i], passed[i + 1], line);
  }
}

void AddCommon(const AutoOptions& options, CommandLine* line) {
  if (options.num_threads >= 0)
    AddOption("--num_threads", std::to_string(options.num_threads), line);
  if (options.random_seed != 0)
    AddOption("--random_seed", std::to_string(options.random_seed), line);
}

void AddSpelled(const std::set<std::string>& options, const std::vector<std::string>& names,
                const std::string& value, CommandLine* line) {
  const std::string name = Spelled(options, names);
  if (!name.empty()) AddOption(name, value, line);
}

bool UsesGpu(Chain* chain, std::vector<std::string>* notes) {
  const std::string& word = chain->options().use_gpu;
  const bool uses = word == "1" || (word == "auto" && chain->Colmap().CanUseGpu());
  if (word == "auto") {
    notes->push_back(uses ? "COLMAP is built with CUDA and a graphics card is there: it is used"
                          : "no graphics card that this COLMAP can use: on the processor");
  }
  return uses;
}

void AddScans(const AutoOptions& options, CommandLine* line, std::vector<std::string>* inputs) {
  for (const std::string& path : options.scan_paths) {
    AddOption("--scan_path", path, line);
    inputs->push_back(FileOf(path));
  }
  AddScanReading(options, line);
  if (!options.scan_poses.empty()) inputs->push_back(options.scan_poses);
}

bool HasPanoramas(Chain* chain) { return !chain->options().panoramas_path.empty(); }

bool HasOwnPhotos(Chain* chain) { return !chain->OnlyScanner(); }

}  // namespace roomtex
