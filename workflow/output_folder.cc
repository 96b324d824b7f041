#include "workflow/output_folder.h"

#include <algorithm>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "core/error.h"
#include "core/input_guard.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

struct Result {
  const char* name;
  const char* step;  // that has run, or runs, before it is there; "" = every run
};
constexpr Result kResults[] = {
    {"frames", "frames"},
    {"faces", "faces"},
    {"associations.csv", "associate"},
    {"linked", "associate"},
    {"scanner", "scanner"},
    {"with_scanner", "scanner"},
    {kPartialDatabase, "features"},
    {kDatabase, "matches"},
    {"pairs.txt", "features"},
    {"sparse", "mapper"},
    {"aligned", "align"},
    {"aligned.untrusted", "align"},
    {"textured", "texture"},
    {"pictures", "pictures"},
    {"report.html", ""},
    {"report.json", ""},
    {"log", ""},
    {"steps.json", ""},
};

// Whether this run may make the step's results.
bool MayRun(const std::string& step, Chain* chain) {
  if (step.empty()) return true;
  for (const StepRow& row : StepTable()) {
    if (row.name == step) return row.applies(chain);
  }
  return false;
}

bool LiesIn(const std::string& path, const std::string& outer) {
  std::error_code error;
  const fs::path inside = fs::weakly_canonical(path, error);
  const fs::path outside = fs::weakly_canonical(outer, error);
  // Links in a circle lead nowhere; the first step that writes there says so.
  if (inside.empty() || outside.empty()) return false;
  return std::mismatch(outside.begin(), outside.end(), inside.begin(), inside.end()).first ==
         outside.end();
}

struct Input {
  const char* option;
  std::string path;
};

std::vector<Input> InputsOf(const AutoOptions& o) {
  std::vector<Input> inputs = {
      {"--image_path", o.image_path}, {"--panoramas_path", o.panoramas_path},
      {"--video_path", o.video_path}, {"--scan_poses", o.scan_poses},
      {"--picks_path", o.picks_path}, {"--cameras_path", o.cameras_path}};
  for (const std::string& path : o.scan_paths) inputs.push_back({"--scan_path", FileOf(path)});
  inputs.erase(std::remove_if(inputs.begin(), inputs.end(),
                              [](const Input& input) { return input.path.empty(); }),
               inputs.end());
  return inputs;
}

bool HoldsSomething(const std::string& path) {
  std::error_code error;
  return fs::is_directory(path, error) ? !fs::is_empty(path, error) : fs::exists(path, error);
}

}  // namespace

void RequireInputsApart(Chain* chain) {
  const AutoOptions& options = chain->options();
  for (const std::string& photos : {options.image_path, options.panoramas_path}) {
    RequireOutsidePhotos(options.output_path, photos);
  }
  for (const Result& result : kResults) {
    const std::string made = chain->At(result.name);
    for (const Input& input : InputsOf(options)) {
      if (!LiesIn(input.path, made) || !MayRun(result.step, chain)) continue;
      throw UsageError(std::string(input.option) + " " + input.path + " lies in " + made +
                       ", which is made anew here: put it elsewhere, or give another "
                       "--output_path");
    }
  }
}

void RequireOwnResults(Chain* chain, const RunState& state) {
  if (state.is_lost()) return;
  for (const Result& result : kResults) {
    const std::string made = chain->At(result.name);
    const std::string step = result.step;
    if (step.empty() || state.Find(step) != nullptr || !HoldsSomething(made)) continue;
    if (!IsAskedFor(step, chain->options()) || !MayRun(step, chain)) continue;
    throw InputError(made, "", "is there already, and roomtex-auto has not made it",
                     "It would be replaced: move it away, or give another --output_path");
  }
}

}  // namespace roomtex
