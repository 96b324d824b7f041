// Every step, in order (step.h).

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "core/error.h"
#include "core/output_file.h"
#include "core/text.h"
#include "workflow/step.h"
#include "workflow/video_frames.h"

namespace roomtex {
namespace {

// By the quality asked for.
struct Quality {
  const char* name;
  int max_image_size, max_num_features;
  bool guided_matching;
  const char* texture_scale;
  int video_frames;
};
constexpr Quality kQualities[] = {
    {"low", 1600, 4096, false, "1", 60},
    {"medium", 3200, 8192, false, "auto", 120},
    {"high", 6400, 16384, true, "auto", 240},
};

const Quality& QualityOf(const AutoOptions& options) {
  for (const Quality& quality : kQualities) {
    if (options.quality == quality.name) return quality;
  }
  throw UsageError("--quality is \"" + options.quality + "\"");
}

// Options that the user handed on take the place of ours.
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

// COLMAP's names of one option, old and new; the one that this version has.
std::string Spelled(const std::set<std::string>& options, const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    if (options.count("--" + name) > 0) return "--" + name;
  }
  return "";
}

void AddSpelled(const std::set<std::string>& options, const std::vector<std::string>& names,
                const std::string& value, CommandLine* line) {
  const std::string name = Spelled(options, names);
  if (!name.empty()) AddOption(name, value, line);
}

bool UsesGpu(Chain* chain, std::vector<std::string>* notes) {
  const std::string& word = chain->options().use_gpu;
  const bool uses = word == "1" || (word == "auto" && chain->Colmap().can_use_gpu);
  if (word == "auto") {
    notes->push_back(uses ? "COLMAP is built with CUDA and a graphics card is there: it is used"
                          : "no graphics card that this COLMAP can use: on the processor");
  }
  return uses;
}

bool Always(Chain*) { return true; }

// ---- frames, faces, associate

bool HasVideo(Chain* chain) { return !chain->options().video_path.empty(); }

Step MakeFrames(Chain* chain) {
  const AutoOptions& options = chain->options();
  const int wanted =
      options.video_frames > 0 ? options.video_frames : QualityOf(options).video_frames;
  Step step;
  CommandLine line = chain->AutoCommand();
  AddOption("--only", "frames", &line);
  step.commands = {line};
  step.inputs = {options.video_path};
  step.outputs = {chain->At("frames")};
  step.notes = {"the sharpest of neighbouring pictures, evenly spaced, " + std::to_string(wanted) +
                " at most"};
  step.action = [video = options.video_path, folder = step.outputs[0],
                 wanted](const std::function<void(double)>& share) {
    WriteSharpFrames(video, folder, wanted, share);
  };
  return step;
}

bool HasPanoramas(Chain* chain) { return !chain->options().panoramas_path.empty(); }

Step MakeFaces(Chain* chain) {
  Step step;
  CommandLine line = {"roomtex-import",        "--input_path",     chain->options().panoramas_path,
                      "--output_path",         chain->At("faces"), "--report_path",
                      chain->ReportOf("faces")};
  AddCommon(chain->options(), &line);
  step.commands = {line};
  step.inputs = {chain->options().panoramas_path};
  step.outputs = {chain->At("faces")};
  step.notes = {"COLMAP gets faces of the panoramas, the colours come from the panoramas"};
  return step;
}

bool MayBePatterned(Chain* chain) {
  const AutoOptions& options = chain->options();
  if (options.image_path.empty() || options.patterned == "0") return false;
  return options.patterned == "1" || chain->SeemsPatterned();
}

Step MakeAssociate(Chain* chain) {
  const AutoOptions& options = chain->options();
  Step step;
  CommandLine line = {
      "roomtex-associate",           "--image_path", options.image_path,  "--output_path",
      chain->At("associations.csv"), "--links_path", chain->At("linked"), "--report_path",
      chain->ReportOf("associate")};
  AddCommon(options, &line);
  step.commands = {line};
  step.inputs = {options.image_path};
  step.outputs = {chain->At("associations.csv"), chain->At("linked")};
  if (options.patterned == "auto") {
    step.notes = {
        "neighbouring photos show the same view in different light, as where a pattern was "
        "projected (--patterned 0: they are ordinary photos)"};
  }
  return step;
}

// ---- features

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

void AddCamera(const PhotoGroup& group, const PhotoGroup& largest, const AutoOptions& options,
               CommandLine* line, std::vector<std::string>* notes) {
  const std::optional<KnownCamera> known = CalibrationOf(group, largest, options);
  if (known) {
    AddOption("--ImageReader.camera_model", known->model, line);
    AddOption("--ImageReader.camera_params", known->params, line);
    notes->push_back(group.Text() + ": one camera, calibrated");
    return;
  }
  const std::string model = !options.camera_model.empty()            ? options.camera_model
                            : group.names.size() >= kEnoughForOpencv ? "OPENCV"
                                                                     : "SIMPLE_RADIAL";
  AddOption("--ImageReader.camera_model", model, line);
  notes->push_back(group.Text() + ": one camera, not calibrated (" + model + ")" +
                   (options.cameras_path.empty() ? "" : "; --cameras_path has none of their size"));
}

CommandLine ExtractorLine(Chain* chain, bool uses_gpu) {
  const AutoOptions& options = chain->options();
  const Quality& quality = QualityOf(options);
  const std::set<std::string>& known = chain->ColmapOptions("feature_extractor");
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

Step MakeFeatures(Chain* chain) {
  const AutoOptions& options = chain->options();
  Step step;
  const CommandLine start = ExtractorLine(chain, UsesGpu(chain, &step.notes));
  const std::string folder = chain->ColmapFolder();
  const std::vector<PhotoFacts>& photos = chain->Photos(folder);
  const std::vector<PhotoGroup> groups = GroupByCamera(photos);
  step.inputs = {folder};
  step.outputs = {chain->At(kPartialDatabase)};
  if (!options.cameras_path.empty()) step.inputs.push_back(options.cameras_path);
  const std::string of_faces =
      HasPanoramas(chain) ? ReadText(chain->At("faces/camera_options.txt")) : "";
  if (!of_faces.empty()) {
    CommandLine line = start;
    const std::vector<std::string> words = Words(of_faces);
    line.insert(line.end(), words.begin(), words.end());
    step.commands = {line};
  } else if (groups.size() > std::max<size_t>(4, photos.size() / 3)) {
    step.commands = {start};
    step.notes.push_back(std::to_string(groups.size()) +
                         " cameras or focal lengths: a camera for every photo");
  } else {
    for (size_t i = 0; i < groups.size(); ++i) {
      CommandLine line = start;
      if (groups.size() > 1) {
        std::string list;
        for (const std::string& name : groups[i].names) list += name + "\n";
        const std::string path =
            chain->At("log/photos_of_camera_" + std::to_string(i + 1) + ".txt");
        step.files.emplace_back(path, list);
        AddOption("--image_list_path", path, &line);
      }
      AddOption("--ImageReader.single_camera", "1", &line);
      AddCamera(groups[i], groups[0], options, &line, &step.notes);
      step.commands.push_back(line);
    }
  }
  for (CommandLine& line : step.commands) AddPassed(options.passed.features, &line);
  return step;
}

// ---- matches

constexpr size_t kManyFrames = 150;
// Of 36 photos of a kitchen two thirds of the pairs are worth matching, of 100 photos of four rooms
// an eighth (docs/pairs.md).
constexpr size_t kManyPhotos = 60;

bool HasBlank(const PhotoFacts& photo) {
  return photo.name.find_first_of(" \t") != std::string::npos;
}

// Which of COLMAP's matchers, and why.
std::string ChooseMatcher(Chain* chain, std::vector<std::string>* notes) {
  const AutoOptions& options = chain->options();
  const std::vector<PhotoFacts>& photos = chain->Photos(chain->ColmapFolder());
  if (options.sequence == "1" ||
      (options.sequence == "auto" && HasVideo(chain) && photos.size() > kManyFrames)) {
    notes->push_back("photos in a row: neighbours are matched");
    return "sequential_matcher";
  }
  const std::string number = std::to_string(photos.size()) + " loose photos: ";
  const bool may_choose = std::none_of(
      options.passed.matches.begin(), options.passed.matches.end(),
      [](const std::string& word) { return word.rfind("--ExhaustiveMatching.", 0) == 0; });
  if (options.pairs == "1" ||
      (options.pairs == "auto" && may_choose && photos.size() > kManyPhotos)) {
    if (std::none_of(photos.begin(), photos.end(), HasBlank)) {
      notes->push_back(number + "the pairs that roomtex-pairs finds are matched");
      return "matches_importer";
    }
    notes->push_back(number +
                     "every one is matched with every other, since COLMAP's list of pairs cannot "
                     "hold names with blanks");
    return "exhaustive_matcher";
  }
  notes->push_back(number + "every one is matched with every other");
  return "exhaustive_matcher";
}

CommandLine PairsLine(Chain* chain) {
  CommandLine line = {
      "roomtex-pairs",        "--database_path",       chain->At(kPartialDatabase),
      "--image_path",         chain->ColmapFolder(),   "--output_path",
      chain->At("pairs.txt"), "--graph_path",          chain->At("log/pairs_graph.json"),
      "--report_path",        chain->ReportOf("pairs")};
  AddCommon(chain->options(), &line);
  AddPassed(chain->options().passed.pairs, &line);
  return line;
}

Step MakeMatches(Chain* chain) {
  const AutoOptions& options = chain->options();
  Step step;
  const bool uses_gpu = UsesGpu(chain, &step.notes);
  step.notes.clear();  // said with the features
  const std::string matcher = ChooseMatcher(chain, &step.notes);
  const std::set<std::string>& known = chain->ColmapOptions(matcher);
  CommandLine line = {options.colmap, matcher, "--database_path", chain->At(kPartialDatabase)};
  AddSpelled(known, {"FeatureMatching.use_gpu", "SiftMatching.use_gpu"}, uses_gpu ? "1" : "0",
             &line);
  if (QualityOf(options).guided_matching) {
    AddSpelled(known, {"FeatureMatching.guided_matching", "SiftMatching.guided_matching"}, "1",
               &line);
  }
  if (matcher == "sequential_matcher") {
    AddOption("--SequentialMatching.overlap", "12", &line);
  } else if (matcher == "exhaustive_matcher") {
    // Several blocks, so that COLMAP's log says how far it is.
    const size_t num_photos = chain->Photos(chain->ColmapFolder()).size();
    const size_t block = std::clamp<size_t>(num_photos / 6, 5, 50);
    AddOption("--ExhaustiveMatching.block_size", std::to_string(block), &line);
  } else {
    step.commands = {PairsLine(chain)};
    AddOption("--match_list_path", chain->At("pairs.txt"), &line);
    AddOption("--match_type", "pairs", &line);
  }
  if (options.num_threads >= 0) {
    AddSpelled(known, {"FeatureMatching.num_threads", "SiftMatching.num_threads"},
               std::to_string(options.num_threads), &line);
  }
  AddPassed(options.passed.matches, &line);
  step.commands.push_back(line);
  step.commands.push_back({"mv", chain->At(kPartialDatabase), chain->At("database.db")});
  step.outputs = {chain->At("database.db")};
  return step;
}

// ---- mapper, align, texture, pictures

Step MakeMapper(Chain* chain) {
  const AutoOptions& options = chain->options();
  Step step;
  CommandLine line = {"roomtex-mapper",    "--database_path",     chain->At("database.db"),
                      "--image_path",      chain->ColmapFolder(), "--output_path",
                      chain->At("sparse"), "--report_path",       chain->ReportOf("mapper")};
  if (options.colmap != "colmap") AddOption("--colmap", options.colmap, &line);
  AddCommon(options, &line);
  AddPassed(options.passed.mapper, &line);
  step.commands = {line};
  step.inputs = {chain->At("database.db"), chain->ColmapFolder()};
  step.outputs = {chain->At("sparse/0"), chain->At("sparse/init")};
  return step;
}

constexpr char kNumOverlays[] = "4";

Step MakeAlign(Chain* chain) {
  const AutoOptions& options = chain->options();
  Step step;
  CommandLine line = {"roomtex-align", "--input_path", chain->At("sparse/0")};
  step.inputs = {chain->At("sparse/0"), chain->ColorFolder()};
  for (const std::string& path : options.scan_paths) {
    AddOption("--scan_path", path, &line);
    step.inputs.push_back(path.substr(0, path.find('#')));
  }
  AddOption("--scan_poses", options.scan_poses, &line);
  if (!options.scan_poses.empty()) step.inputs.push_back(options.scan_poses);
  if (options.azimuth != "auto") AddOption("--azimuth", options.azimuth, &line);
  if (options.up_axis != "auto") AddOption("--up_axis", options.up_axis, &line);
  AddOption("--units", options.units, &line);
  const std::string picks = chain->PicksPath();
  if (picks.empty()) {
    step.notes.emplace_back("no picks: without clicks");
  } else {
    AddOption("--picks_path", picks, &line);
    step.inputs.push_back(picks);
  }
  AddOption("--image_path", chain->ColorFolder(), &line);
  if (HasPanoramas(chain)) AddOption("--panoramas_path", chain->At("faces/panoramas.json"), &line);
  AddOption("--output_path", chain->At("aligned"), &line);
  AddOption("--overlays", kNumOverlays, &line);
  AddOption("--report_path", chain->ReportOf("align"), &line);
  AddCommon(options, &line);
  AddPassed(options.passed.align, &line);
  step.commands = {line};
  step.outputs = {chain->At("aligned")};
  return step;
}

Step MakeTexture(Chain* chain) {
  const AutoOptions& options = chain->options();
  Step step;
  CommandLine line = {"roomtex-texture",    "--input_path",  chain->AlignedPath(), "--image_path",
                      chain->ColorFolder(), "--output_path", chain->At("textured")};
  AddOption("--Texture.scale", QualityOf(options).texture_scale, &line);
  if (options.accept_untrusted) AddOption("--accept_untrusted", "1", &line);
  AddOption("--report_path", chain->ReportOf("texture"), &line);
  AddCommon(options, &line);
  AddPassed(options.passed.texture, &line);
  step.commands = {line};
  step.inputs = {chain->AlignedPath(), chain->ColorFolder()};
  step.outputs = {chain->At("textured")};
  return step;
}

Step MakePictures(Chain* chain) {
  Step step;
  CommandLine line = {"roomtex-render",
                      "--glb_path",
                      chain->At("textured/model.glb"),
                      "--input_path",
                      chain->AlignedPath(),
                      "--image_path",
                      chain->ColorFolder(),
                      "--folder_path",
                      chain->At("pictures"),
                      "--num_ring",
                      "0",
                      "--width",
                      "720",
                      "--report_path",
                      chain->ReportOf("pictures")};
  AddCommon(chain->options(), &line);
  step.commands = {line};
  step.inputs = {chain->At("textured/model.glb"), chain->AlignedPath()};
  step.outputs = {chain->At("pictures")};
  return step;
}

// Its page is made behind all steps, whatever became of them.
Step MakeReport(Chain* chain) {
  Step step;
  step.outputs = {chain->At("report.html"), chain->At("report.json")};
  return step;
}

}  // namespace

const std::vector<StepRow>& StepTable() {
  static const std::vector<StepRow> kTable = {
      {"frames", "sharp pictures out of the video", HasVideo, MakeFrames},
      {"faces", "faces cut out of the panoramas", HasPanoramas, MakeFaces},
      {"associate", "photos with the pattern, and without", MayBePatterned, MakeAssociate},
      {"features", "features of every photo (COLMAP)", Always, MakeFeatures},
      {"matches", "which photos see the same (COLMAP)", Always, MakeMatches},
      {"mapper", "where the photos stand to each other", Always, MakeMapper},
      {"align", "where they stand in the scan", Always, MakeAlign},
      {"texture", "the scan in the photos' colours", Always, MakeTexture},
      {"pictures", "pictures of the coloured scan", Always, MakePictures},
      {"report", "report.html and report.json", Always, MakeReport},
  };
  return kTable;
}

std::vector<std::string> StepNames() {
  std::vector<std::string> names;
  for (const StepRow& row : StepTable()) names.emplace_back(row.name);
  return names;
}

}  // namespace roomtex
