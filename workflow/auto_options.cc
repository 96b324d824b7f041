#include "workflow/auto_options.h"

#include <algorithm>

#include "core/camera_model.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "workflow/scanner_photos.h"
#include "workflow/step.h"

namespace roomtex {
namespace {

const std::vector<std::string> kAutoWords = {"auto", "1", "0"};

void RequireStepName(const std::string& option, const std::string& name,
                     std::vector<std::string>* problems) {
  const std::vector<std::string> names = StepNames();
  if (name.empty() || std::find(names.begin(), names.end(), name) != names.end()) return;
  std::string all;
  for (const std::string& one : names) all += (all.empty() ? "" : ", ") + one;
  problems->push_back("--" + option + " is \"" + name + "\", expected one of " + all);
}

}  // namespace

void AutoOptions::Declare(OptionFields* fields) {
  fields->Choice("quality", &quality, {"low", "medium", "high"},
                 "low: smaller pictures, fewer features, colours at the scan's samples only; high: "
                 "more features, guided matching, 60 % more time and more.");
  fields->Choice("patterned", &patterned, kAutoWords,
                 "Every place was photographed twice, with a projected pattern and without: COLMAP "
                 "gets the one, the colours come from the other; auto = look.");
  fields->Choice("use_gpu", &use_gpu, kAutoWords,
                 "COLMAP's features and matches on the graphics card; auto = where there is one "
                 "and COLMAP is built for it.");
  fields->Choice("sequence", &sequence, kAutoWords,
                 "The photos follow each other, as those of a video: only neighbours are matched; "
                 "auto = of a video with more than 150 pictures.");
  fields->Choice(
      "pairs", &pairs, kAutoWords,
      "Of loose photos, match the pairs that roomtex-pairs finds; auto = of more than 60 "
      "photos; 0 = every photo with every other.");
  fields->Choice(
      "scanner_photos", &scanner_photos, kAutoWords,
      "The scanner's own photos in an E57, those with a pose: beside yours, they put the model "
      "into the scan (roomtex-mapper --known_path); without any of yours, the colours come from "
      "them. auto = where the scan has some.");
  fields->Choice(
      "refine_intrinsics", &refine_intrinsics, kAutoWords,
      "The photos' lens, as roomtex-mapper and roomtex-align have it: 1 = adjusted in any "
      "case, 0 = never, auto = where photos or scan contradict what was told.");
  fields->Bool("register_stations", &register_stations,
               "Move scans that do not fit the others, as roomtex-align has it.");
  fields->Bool("strict", &strict,
               "Stop at a photo that is missing, unreadable or of another shape than its camera; 0 "
               "= leave it out and name it.");
  fields
      ->Number("max_range", &max_range,
               "Metres; samples farther from the scanner count as missing. 0 = the limit that the "
               "file gives, if any.")
      .NotNegative()
      .Finite()
      .Says("must be 0 (no limit) or a number of metres");
  fields->Bool("E57.check", &e57_check,
               "Compare the checksums of an E57 file before it is read; 0 = take a damaged file as "
               "it is.");
  fields
      ->Int("video_frames", &video_frames,
            "Pictures to take out of a video; 0 = 60, 120 or 240 by the quality.")
      .Within(0, 100000);
  fields->Bool("accept_untrusted", &accept_untrusted,
               "Go on behind a step whose answer is not to be trusted, with a warning; 0 = stop "
               "there with exit 4.");
  fields->Bool("dry_run", &dry_run,
               "Print the command lines on stdout as far as they are known, and run none.");
}

std::vector<std::string> AutoOptions::Problems() const {
  std::vector<std::string> problems = ProblemsOf(*this);
  const int num_sources = !image_path.empty() + !panoramas_path.empty() + !video_path.empty();
  if (num_sources > 1 || (num_sources == 0 && FindScannerScan(*this).empty())) {
    problems.emplace_back(
        "give one of --image_path, --panoramas_path and --video_path; only an E57 that has photos "
        "with poses needs none");
  } else if (scanner_photos == "1" && FindScannerScan(*this).empty()) {
    const std::string why = WhyNoScannerPhotos(*this);
    problems.push_back("--scanner_photos is 1, but " +
                       (why.empty() ? "no scan is an E57 that has photos with poses" : why));
  }
  if (!near.empty() && num_sources == 0) {
    problems.emplace_back("--near says where photos of yours belong: give --image_path");
  }
  if (!camera_model.empty() && !CameraModelFromName(camera_model)) {
    problems.push_back("--camera_model " + camera_model + " is no model of COLMAP's");
  }
  if (!camera_params.empty() && camera_model.empty()) {
    problems.emplace_back("--camera_params needs --camera_model, e.g. OPENCV");
  }
  if (!camera_params.empty() && !cameras_path.empty()) {
    problems.emplace_back("give --camera_params or --cameras_path, not both");
  }
  if (!only.empty() && !(from.empty() && until.empty())) {
    problems.emplace_back("--only goes with neither --from nor --until");
  }
  RequireStepName("from", from, &problems);
  RequireStepName("until", until, &problems);
  RequireStepName("only", only, &problems);
  const std::vector<std::string> names = StepNames();
  const auto last = std::find(names.begin(), names.end(), until);
  if (last != names.end() && std::find(last + 1, names.end(), from) != names.end()) {
    problems.push_back("--from " + from + " comes after --until " + until + ": nothing would run");
  }
  for (size_t i = 0; i < scan_paths.size(); ++i) {
    if (std::count(scan_paths.begin(), scan_paths.begin() + static_cast<long>(i), scan_paths[i])) {
      problems.push_back("--scan_path " + scan_paths[i] + " is given twice");
    }
  }
  return problems;
}

}  // namespace roomtex
