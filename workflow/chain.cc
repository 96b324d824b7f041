#include "workflow/chain.h"

#include <algorithm>
#include <filesystem>

#include "core/child_program.h"
#include "core/json_text.h"
#include "core/report.h"
#include "core/result_names.h"
#include "core/text.h"
#include "workflow/scanner_photos.h"

namespace roomtex {
namespace fs = std::filesystem;

bool IsThere(const std::string& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

Json ReadJsonFile(const std::string& path) {
  const Json json = ReadJsonIfAny(path);
  return json.is_object() ? json : Json();
}

void AddOption(const std::string& name, const std::string& value, CommandLine* line) {
  if (value.empty()) return;
  line->push_back(name);
  line->push_back(value);
}

void AddScanReading(const AutoOptions& options, CommandLine* line) {
  AddOption("--scan_poses", options.scan_poses, line);
  if (options.azimuth != "auto") AddOption("--azimuth", options.azimuth, line);
  if (options.up_axis != "auto") AddOption("--up_axis", options.up_axis, line);
  AddOption("--units", options.units, line);
  if (options.max_range > 0) AddOption("--max_range", Exact(options.max_range), line);
  if (!options.e57_check) AddOption("--E57.check", "0", line);
}

Chain::Chain(const AutoOptions& options)
    : options_(options), scanner_scan_(FindScannerScan(options)) {}

std::string Chain::PhotoFolder() const {
  if (!options_.video_path.empty()) return At("frames");
  if (!options_.panoramas_path.empty()) return At("faces");
  return options_.image_path;
}

bool Chain::IsAssociated() const {
  if (options_.patterned == "0" || options_.image_path.empty()) return false;
  if (options_.patterned == "auto" && !seems_patterned_.value_or(false)) return false;
  const Json report = ReadJsonFile(ReportOf("associate"));
  return report.is_object() && report.value("trusted", false) && IsThere(At("linked/patterned"));
}

std::string Chain::ColmapFolder() const {
  if (IsAssociated()) return At("linked/patterned");
  return KnownPath().empty() ? PhotoFolder() : LinkFolder();
}

std::string Chain::ColorFolder() const {
  if (!options_.panoramas_path.empty()) return options_.panoramas_path;
  if (OnlyScanner()) return ScannerFolder();
  if (IsAssociated()) return At("linked/plain");
  return KnownPath().empty() ? PhotoFolder() : LinkFolder();
}

bool Chain::IsPhotoFolder(const std::string& path) const {
  return !path.empty() &&
         (path == options_.image_path || path == options_.panoramas_path || path == PhotoFolder() ||
          path == ColmapFolder() || path == ColorFolder());
}

bool Chain::OnlyScanner() const { return !HasPhotoSource(options_); }

std::string Chain::ScannerFolder() const {
  if (OnlyScanner()) return At("scanner");
  std::string name = "scanner";
  while (IsThere(PhotoFolder() + "/" + name)) name += "_";  // of the user's
  return LinkFolder() + "/" + name;
}

Json Chain::ScannerCameras() const {
  if (!UsesScanner()) return Json::array();
  const Json report = ReadJsonFile(ReportOf("scanner"));
  return report.is_object() && report.contains("cameras") ? report["cameras"] : Json::array();
}

std::string Chain::KnownPath() const {
  if (OnlyScanner() || !UsesScanner()) return "";
  const bool has_none = IsThere(ReportOf("scanner")) && ScannerCameras().empty();
  return has_none ? "" : ScannerFolder() + "/sparse";
}

std::string Chain::PicksPath() const {
  if (!options_.picks_path.empty()) return options_.picks_path;
  return IsThere(At("picks.csv")) ? At("picks.csv") : "";
}

std::string Chain::AlignedPath() const {
  if (OnlyScanner()) return ScannerFolder() + "/sparse";
  const std::string aside = At("aligned.untrusted");
  if (!options_.accept_untrusted || !IsThere(aside + "/images.bin")) return At("aligned");
  // A result that is not trusted lies aside where there is one that is. Which one is the last, its
  // report says: the times of files do not outlive a copy, and a later trusted run leaves it there.
  const auto is_trusted = [](const std::string& path, bool otherwise) {
    const Json report = ReadJsonFile(path);
    const Json trusted = report.is_object() ? report.value("trusted", Json()) : Json();
    return trusted.is_boolean() ? trusted.get<bool>() : otherwise;
  };
  const bool last_is_trusted = is_trusted(ReportOf("align"), true);
  const bool has_trusted = is_trusted(At(std::string("aligned/") + kAlignReportName), true);
  return !last_is_trusted && has_trusted ? aside : At("aligned");
}

const std::vector<PhotoFacts>& Chain::Photos(const std::string& folder) {
  const auto known = std::find_if(photos_.begin(), photos_.end(),
                                  [&](const auto& one) { return one.first == folder; });
  if (known != photos_.end()) return known->second;
  photos_.reserve(8);  // few folders: references stay
  photos_.emplace_back(folder, ReadPhotoFacts(folder));
  return photos_.back().second;
}

ColmapProgram& Chain::Colmap() {
  if (!colmap_) colmap_.emplace(options_.colmap);
  return *colmap_;
}

bool Chain::SeemsPatterned() {
  if (!seems_patterned_) {
    seems_patterned_ = LooksPatterned(options_.image_path, Photos(options_.image_path));
  }
  return *seems_patterned_;
}

std::vector<std::string> Chain::SparseModels() const {
  std::vector<std::string> models = {At("sparse/0")};
  for (int number = 1;; ++number) {
    const std::string model = At("sparse/" + std::to_string(number));
    const Json report = ReadJsonFile(model + "/" + kMapperReportName);
    if (!report.is_object() || report.value("model", Json()) != number) break;
    models.push_back(model);
  }
  return models;
}

CommandLine Chain::PickCommand() const {
  CommandLine line = {"roomtex-pick"};
  for (const std::string& model : SparseModels()) {
    if (IsThere(model)) AddOption("--input_path", model, &line);  // not of photos by themselves
  }
  AddOption("--image_path", ColorFolder(), &line);
  if (!options_.panoramas_path.empty()) {
    AddOption("--panoramas_path", At(std::string("faces/") + kPanoramaSetName), &line);
  }
  for (const std::string& path : options_.scan_paths) AddOption("--scan_path", path, &line);
  AddScanReading(options_, &line);
  AddOption("--output_path", options_.picks_path.empty() ? At("picks.csv") : options_.picks_path,
            &line);
  return line;
}

CommandLine Chain::AutoCommand() const {
  CommandLine line = {"roomtex-auto"};
  AddOption("--image_path", options_.image_path, &line);
  AddOption("--panoramas_path", options_.panoramas_path, &line);
  AddOption("--video_path", options_.video_path, &line);
  for (const std::string& path : options_.scan_paths) AddOption("--scan_path", path, &line);
  AddScanReading(options_, &line);
  AddOption("--output_path", options_.output_path, &line);
  AddOption("--picks_path", options_.picks_path, &line);
  AddOption("--near", options_.near, &line);
  AddOption("--camera_model", options_.camera_model, &line);
  AddOption("--camera_params", options_.camera_params, &line);
  AddOption("--cameras_path", options_.cameras_path, &line);
  if (options_.quality != "medium") AddOption("--quality", options_.quality, &line);
  if (options_.patterned != "auto") AddOption("--patterned", options_.patterned, &line);
  if (options_.use_gpu != "auto") AddOption("--use_gpu", options_.use_gpu, &line);
  if (options_.sequence != "auto") AddOption("--sequence", options_.sequence, &line);
  if (options_.pairs != "auto") AddOption("--pairs", options_.pairs, &line);
  if (options_.scanner_photos != "auto") {
    AddOption("--scanner_photos", options_.scanner_photos, &line);
  }
  if (options_.refine_intrinsics != "auto") {
    AddOption("--refine_intrinsics", options_.refine_intrinsics, &line);
  }
  if (options_.register_stations) AddOption("--register_stations", "1", &line);
  if (options_.strict) AddOption("--strict", "1", &line);
  if (options_.video_frames > 0) {
    AddOption("--video_frames", std::to_string(options_.video_frames), &line);
  }
  if (options_.accept_untrusted) AddOption("--accept_untrusted", "1", &line);
  if (options_.colmap != "colmap") AddOption("--colmap", options_.colmap, &line);
  AddCommon(options_, &line);
  const PassedOptions& passed = options_.passed;
  for (const auto* more : {&passed.features, &passed.pairs, &passed.matches, &passed.mapper,
                           &passed.align, &passed.texture}) {
    line.insert(line.end(), more->begin(), more->end());
  }
  return line;
}

}  // namespace roomtex
