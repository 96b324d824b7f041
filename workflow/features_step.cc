// Features of all photos: by camera, the user's and the scanner's.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <utility>

#include "core/error.h"
#include "core/input_guard.h"
#include "core/photo.h"
#include "core/photo_files.h"
#include "core/result_names.h"
#include "core/text.h"
#include "workflow/step_lines.h"

namespace roomtex {
namespace {

std::vector<std::string> Words(const std::string& text) {
  std::istringstream stream(text);
  return {std::istream_iterator<std::string>(stream), std::istream_iterator<std::string>()};
}

std::string ReadText(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// The calibration of these photos; none if there is none of their size.
std::optional<KnownCamera> CalibrationOf(const PhotoGroup& group, const PhotoGroup& largest,
                                         const AutoOptions& options) {
  if (!options.cameras_path.empty()) {
    for (const KnownCamera& camera : ReadKnownCameras(options.cameras_path)) {
      if (camera.width == group.width && camera.height == group.height) return camera;
    }
    return std::nullopt;
  }
  const bool is_meant = group.width == largest.width && group.height == largest.height;
  if (options.camera_params.empty() || !is_meant) return std::nullopt;
  return KnownCamera{options.camera_model, group.width, group.height, options.camera_params};
}

constexpr size_t kEnoughForOpencv = 10;  // photos

// Of a camera that nobody calibrated and few photos are of.
std::string ModelOfFew(const AutoOptions& options) {
  return options.camera_model.empty() ? "SIMPLE_RADIAL" : options.camera_model;
}

void AddCamera(const PhotoGroup& group, const PhotoGroup& largest, const AutoOptions& options,
               CommandLine* line, std::vector<std::string>* notes) {
  const std::optional<KnownCamera> known = CalibrationOf(group, largest, options);
  if (known) {
    AddOption("--ImageReader.camera_model", known->model, line);
    AddOption("--ImageReader.camera_params", known->params, line);
    notes->push_back(group.Text() + ": one camera, calibrated");
    return;
  }
  const bool enough = options.camera_model.empty() && group.names.size() >= kEnoughForOpencv;
  const std::string model = enough ? "OPENCV" : ModelOfFew(options);
  AddOption("--ImageReader.camera_model", model, line);
  notes->push_back(group.Text() + ": one camera, not calibrated (" + model + ")" +
                   (options.cameras_path.empty() ? "" : "; --cameras_path has none of their size"));
}

CommandLine ExtractorLine(Chain* chain, bool uses_gpu) {
  const AutoOptions& options = chain->options();
  const Quality& quality = QualityOf(options);
  const std::set<std::string>& known = chain->Colmap().Options("feature_extractor");
  CommandLine line = {options.colmap,    "feature_extractor",
                      "--database_path", chain->At(kPartialDatabase),
                      "--image_path",    chain->ColmapFolder()};
  AddSpelled(known, {"FeatureExtraction.use_gpu", "SiftExtraction.use_gpu"}, uses_gpu ? "1" : "0",
             &line);
  AddSpelled(known, {"FeatureExtraction.max_image_size", "SiftExtraction.max_image_size"},
             std::to_string(quality.max_image_size), &line);
  AddOption("--SiftExtraction.max_num_features", std::to_string(quality.max_num_features), &line);
  if (options.num_threads >= 0) {
    AddSpelled(known, {"FeatureExtraction.num_threads", "SiftExtraction.num_threads"},
               std::to_string(options.num_threads), &line);
  }
  return line;
}

// A list of photos that one command line is for. It is written, and counts as what the step was
// made from, also where these are all photos, so that COLMAP needs no list: hidden photos that come
// and go change the line then, but not what is made.
void AddList(const std::vector<std::string>& names, const std::string& path, bool is_needed,
             CommandLine* line, Step* step) {
  std::string list;
  for (const std::string& name : names) list += name + "\n";
  step->files.emplace_back(path, list);
  if (is_needed) AddOption("--image_list_path", path, line);
}

// The scanner's photos have the cameras of their file; where these are many, COLMAP guesses one for
// every photo, and roomtex-mapper takes those of the file all the same.
constexpr size_t kMostScannerCameras = 8;

CommandLine ScannerLine(const CommandLine& start, const Json& camera, bool is_told) {
  CommandLine line = start;
  AddOption("--ImageReader.camera_model", camera["model"], &line);
  if (!is_told) return line;
  std::string params;
  for (const Json& param : camera["params"]) params += (params.empty() ? "" : ",") + param.dump();
  AddOption("--ImageReader.single_camera", "1", &line);
  AddOption("--ImageReader.camera_params", params, &line);
  return line;
}

// Options for the lenses of the user's photos are not for them.
std::vector<std::string> WithoutLenses(const std::vector<std::string>& passed) {
  std::vector<std::string> kept;
  for (size_t i = 0; i + 1 < passed.size(); i += 2) {
    if (BeginsWith(passed[i], "--ImageReader.")) continue;
    kept.insert(kept.end(), {passed[i], passed[i + 1]});
  }
  return kept;
}

void AddScannerPhotos(Chain* chain, const CommandLine& start, Step* step) {
  if (!IsThere(chain->ReportOf("scanner"))) {
    throw InputError(chain->ReportOf("scanner"), "",
                     "is not there: the step scanner has to run first", "Start without --from");
  }
  const std::string folder = chain->ScannerFolder();
  const std::string below = folder.substr(folder.rfind('/') + 1) + "/";
  const Json cameras = chain->ScannerCameras();
  const bool are_told = cameras.size() <= kMostScannerCameras;
  size_t num_photos = 0, number = 0;
  std::vector<std::string> names;
  for (const Json& camera : cameras) {
    for (const Json& image : camera["images"]) names.push_back(below + image.get<std::string>());
    if (!are_told && ++number < cameras.size()) continue;
    num_photos += names.size();
    CommandLine line = ScannerLine(start, camera, are_told);
    if (are_told) ++number;
    AddList(names, chain->At("log/photos_of_scanner_" + std::to_string(number) + ".txt"), true,
            &line, step);
    AddPassed(WithoutLenses(chain->options().passed.features), &line);
    step->commands.push_back(line);
    names.clear();
  }
  step->notes.push_back(std::to_string(num_photos) + " photos of the scanner's own" +
                        (are_told ? ", by the cameras of their file" : ""));
}

}  // namespace

bool PhotosStandAlone(Chain* chain) {
  const AutoOptions& options = chain->options();
  if (options.image_path.empty() || HasPanoramas(chain) || chain->UsesScanner()) return false;
  const size_t count = chain->Photos(options.image_path).size();
  // Of two, picks in one may have to do for both: by a model.
  return count == 1 || (count == 2 && chain->PicksPath().empty());
}

void AddLensOfPhotosAlone(Chain* chain, CommandLine* line) {
  const std::vector<PhotoFacts>& photos = chain->Photos(chain->options().image_path);
  PhotoGroup group;
  group.width = photos[0].width;
  group.height = photos[0].height;
  const bool same_size = photos.back().width == group.width && photos.back().height == group.height;
  const auto known =
      same_size ? CalibrationOf(group, group, chain->options()) : std::optional<KnownCamera>();
  if (known) {
    AddOption("--camera_model", known->model, line);
    AddOption("--camera_params", known->params, line);
  } else {
    AddOption("--camera_model", chain->options().camera_model, line);
  }
}

bool CanBeRead(const std::string& path) {
  try {
    ReadGreyPhoto(path, 8);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

// Files that are empty, or no pictures at all; a size that their header does not tell says no more
// than that one has to look. True if there are some.
bool SetUnreadableAside(const std::string& folder, std::vector<PhotoGroup>* groups,
                        std::vector<std::string>* notes) {
  std::string unreadable;
  for (PhotoGroup& group : *groups) {
    if (group.width > 0) continue;
    std::vector<std::string> readable;
    for (const std::string& name : group.names) {
      if (CanBeRead(folder + "/" + name)) {
        readable.push_back(name);
      } else {
        unreadable += (unreadable.empty() ? "" : ", ") + name;
      }
    }
    group.names = readable;
  }
  groups->erase(std::remove_if(groups->begin(), groups->end(),
                               [](const PhotoGroup& group) { return group.names.empty(); }),
                groups->end());
  if (unreadable.empty()) return false;
  if (groups->empty()) {
    throw InputError(folder, "", "holds no photo that can be read: not " + unreadable,
                     "Copy the photos again");
  }
  notes->push_back("left out, since they cannot be read: " + unreadable);
  return true;
}

// The photos of one camera, as the step's next command.
void AddGroup(Chain* chain, const PhotoGroup& group, const PhotoGroup& largest,
              const CommandLine& start, bool with_list, Step* step) {
  CommandLine line = start;
  const std::string number = std::to_string(step->commands.size() + 1);
  AddList(group.names, chain->At("log/photos_of_camera_" + number + ".txt"), with_list, &line,
          step);
  AddOption("--ImageReader.single_camera", "1", &line);
  AddCamera(group, largest, chain->options(), &line, &step->notes);
  step->commands.push_back(line);
}

Step MakeFeatures(Chain* chain) {
  const AutoOptions& options = chain->options();
  Step step;
  const CommandLine start = ExtractorLine(chain, UsesGpu(chain, &step.notes));
  const std::string folder = chain->ColmapFolder();
  const bool has_scanner = !chain->KnownPath().empty();
  const std::string of_photos = has_scanner ? chain->PhotoFolder() : folder;
  const std::vector<PhotoFacts>& photos = chain->Photos(of_photos);
  std::vector<PhotoGroup> groups = GroupByCamera(photos);
  bool has_others = has_scanner || HasHiddenPhotos(folder);  // that these lines are not for
  has_others |= SetUnreadableAside(of_photos, &groups, &step.notes);
  step.inputs = {folder};
  step.outputs = {chain->At(kPartialDatabase)};
  if (!options.cameras_path.empty()) step.inputs.push_back(options.cameras_path);
  const std::string of_faces =
      HasPanoramas(chain) ? ReadText(chain->At(std::string("faces/") + kCameraOptionsName)) : "";
  if (!of_faces.empty()) {
    CommandLine line = start;
    const std::vector<std::string> words = Words(of_faces);
    line.insert(line.end(), words.begin(), words.end());
    step.commands = {line};
  } else if (groups.size() > std::max<size_t>(4, photos.size() / 3)) {
    std::map<std::pair<std::string, std::string>, PhotoGroup> calibrated;  // by model, parameters
    std::vector<std::string> others;
    for (const PhotoGroup& group : groups) {
      const auto known = CalibrationOf(group, groups[0], options);
      if (known) {
        const auto [alike, is_first] =
            calibrated.emplace(std::make_pair(known->model, known->params), group);
        if (is_first) continue;
        auto& names = alike->second.names;
        names.insert(names.end(), group.names.begin(), group.names.end());
      } else {
        others.insert(others.end(), group.names.begin(), group.names.end());
      }
    }
    for (const auto& [camera, group] : calibrated) {
      AddGroup(chain, group, groups[0], start, true, &step);
    }
    if (!others.empty()) {
      CommandLine line = start;
      AddList(others, chain->At("log/photos_of_other_cameras.txt"),
              has_others || !step.commands.empty(), &line, &step);
      const std::string model = ModelOfFew(options);
      AddOption("--ImageReader.camera_model", model, &line);
      step.commands.push_back(line);
      step.notes.push_back(std::to_string(groups.size()) +
                           " cameras or focal lengths: a camera for every photo that is not "
                           "calibrated (" +
                           model + ")");
    }
  } else {
    for (const PhotoGroup& group : groups) {
      AddGroup(chain, group, groups[0], start, groups.size() > 1 || has_others, &step);
    }
  }
  for (CommandLine& line : step.commands) AddPassed(options.passed.features, &line);
  if (has_scanner) AddScannerPhotos(chain, start, &step);
  return step;
}

Step MakeScanner(Chain* chain) {
  const AutoOptions& options = chain->options();
  Step step;
  CommandLine line = {"roomtex-import",          "--input_path",         chain->ScannerScan(),
                      "--images_path",           chain->ScannerFolder(), "--report_path",
                      chain->ReportOf("scanner")};
  AddOption("--units", options.units, &line);
  if (!options.e57_check) AddOption("--E57.check", "0", &line);
  step.inputs = {FileOf(chain->ScannerScan())};
  if (chain->OnlyScanner()) {
    step.outputs = {chain->ScannerFolder()};
    step.commands = {{"rm", "-rf", step.outputs[0]}, line};
    step.notes = {"no photos of yours: the colours come from the scanner's own"};
    return step;
  }
  // Links, since COLMAP takes one folder; panoramas as faces, since it has no model for them.
  AddOption("--E57.cut_panoramas", "1", &line);
  const std::string photos = std::filesystem::absolute(chain->PhotoFolder()).lexically_normal();
  step.inputs.push_back(chain->PhotoFolder());
  step.outputs = {chain->LinkFolder()};
  step.commands = {{"rm", "-rf", chain->LinkFolder()},
                   {"cp", "-r", "--symbolic-link", photos + "/.", chain->LinkFolder()},
                   line};
  step.notes = {FileOf(chain->ScannerScan()) +
                " has photos of its own, with poses: they go beside yours (--scanner_photos 0: "
                "without them)"};
  return step;
}

}  // namespace roomtex
