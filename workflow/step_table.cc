// Every step, in order (step.h).

#include <algorithm>

#include "core/error.h"
#include "core/result_names.h"
#include "core/text.h"
#include "workflow/step_lines.h"
#include "workflow/video_frames.h"

namespace roomtex {
namespace {

bool Always(Chain*) { return true; }
bool UsesScanner(Chain* chain) { return chain->UsesScanner(); }
bool IsReconstructed(Chain* chain) { return HasOwnPhotos(chain) && !PhotosStandAlone(chain); }

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
      [](const std::string& word) { return BeginsWith(word, "--ExhaustiveMatching."); });
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
  const std::set<std::string>& known = chain->Colmap().Options(matcher);
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
  step.commands.push_back({"mv", chain->At(kPartialDatabase), chain->At(kDatabase)});
  step.outputs = {chain->At(kDatabase)};
  return step;
}

// ---- mapper, align, texture, pictures

Step MakeMapper(Chain* chain) {
  const AutoOptions& options = chain->options();
  Step step;
  CommandLine line = {"roomtex-mapper",    "--database_path",     chain->At(kDatabase),
                      "--image_path",      chain->ColmapFolder(), "--output_path",
                      chain->At("sparse"), "--report_path",       chain->ReportOf("mapper")};
  const std::string known = chain->KnownPath();
  AddOption("--known_path", known, &line);
  if (options.colmap != "colmap") AddOption("--colmap", options.colmap, &line);
  if (options.refine_intrinsics != "auto") {
    AddOption("--refine_intrinsics", options.refine_intrinsics, &line);
  }
  AddCommon(options, &line);
  AddPassed(options.passed.mapper, &line);
  step.commands = {line};
  step.inputs = {chain->At(kDatabase), chain->ColmapFolder()};
  if (!known.empty()) {
    step.inputs.push_back(known);
    step.notes.emplace_back("the scanner's photos stand where the scan's file has them");
  }
  step.outputs = chain->SparseModels();
  step.outputs.push_back(chain->At("sparse/init"));
  return step;
}

constexpr char kNumOverlays[] = "4";

Step MakeAlign(Chain* chain) {
  const AutoOptions& options = chain->options();
  Step step;
  CommandLine line = {"roomtex-align"};
  if (PhotosStandAlone(chain)) {
    AddLensOfPhotosAlone(chain, &line);
    step.notes.emplace_back("so few photos make no sparse model: each is placed by itself");
  } else {
    const std::vector<std::string> models = chain->SparseModels();
    for (const std::string& model : models) {
      AddOption("--input_path", model, &line);
      step.inputs.push_back(model);
    }
    if (models.size() > 1) {
      step.notes.push_back(std::to_string(models.size()) +
                           " sparse models: each is put into the scan by itself");
    }
    // Its matches tell which photos are right; those of panoramas are their faces'.
    if (!HasPanoramas(chain)) {
      AddOption("--database_path", chain->At(kDatabase), &line);
      step.inputs.push_back(chain->At(kDatabase));
    }
  }
  step.inputs.push_back(chain->ColorFolder());
  AddScans(options, &line, &step.inputs);
  const std::string picks = chain->PicksPath();
  AddOption("--near", options.near, &line);
  if (!options.near.empty()) {
    step.notes.emplace_back("the search keeps to where --near puts the photos");
  } else if (picks.empty() && !chain->KnownPath().empty()) {
    step.notes.emplace_back(
        "no picks: where the scanner's photos stand, if the mapper could use it");
  } else if (picks.empty()) {
    step.notes.emplace_back("no picks: without clicks");
  }
  if (!picks.empty()) {
    AddOption("--picks_path", picks, &line);
    step.inputs.push_back(picks);
  }
  AddOption("--image_path", chain->ColorFolder(), &line);
  if (HasPanoramas(chain))
    AddOption("--panoramas_path", chain->At(std::string("faces/") + kPanoramaSetName), &line);
  AddOption("--output_path", chain->At("aligned"), &line);
  AddOption("--overlays", kNumOverlays, &line);
  AddOption("--report_path", chain->ReportOf("align"), &line);
  if (options.refine_intrinsics != "auto") {
    AddOption("--refine_intrinsics", options.refine_intrinsics, &line);
  }
  if (options.register_stations) AddOption("--register_stations", "1", &line);
  if (options.strict) AddOption("--strict", "1", &line);
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
  step.inputs = {chain->AlignedPath(), chain->ColorFolder()};
  if (chain->OnlyScanner()) {
    AddScans(options, &line, &step.inputs);
  } else if (!options.e57_check) {
    AddOption("--E57.check", "0", &line);  // the aligned model remembers how else to read its scans
  }
  if (options.strict) AddOption("--strict", "1", &line);
  AddOption("--Texture.scale", QualityOf(options).texture_scale, &line);
  if (options.accept_untrusted) AddOption("--accept_untrusted", "1", &line);
  AddOption("--report_path", chain->ReportOf("texture"), &line);
  AddCommon(options, &line);
  AddPassed(options.passed.texture, &line);
  step.commands = {line};
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
      {"scanner", "the scanner's own photos, out of the scan's file", UsesScanner, MakeScanner},
      {"features", "features of every photo (COLMAP)", IsReconstructed, MakeFeatures},
      {"matches", "which photos see the same (COLMAP)", IsReconstructed, MakeMatches},
      {"mapper", "where the photos stand to each other", IsReconstructed, MakeMapper},
      {"align", "where they stand in the scan", HasOwnPhotos, MakeAlign},
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

int IndexOfStep(const std::string& name) {
  const std::vector<std::string> names = StepNames();
  return static_cast<int>(std::find(names.begin(), names.end(), name) - names.begin());
}

StepRange StepsAskedFor(const AutoOptions& options) {
  const std::string& first = options.only.empty() ? options.from : options.only;
  const std::string& last = options.only.empty() ? options.until : options.only;
  return {first.empty() ? 0 : IndexOfStep(first),
          static_cast<int>(last.empty() ? StepTable().size() : IndexOfStep(last))};
}

bool IsAskedFor(const std::string& step, const AutoOptions& options) {
  return StepsAskedFor(options).Holds(IndexOfStep(step));
}

}  // namespace roomtex
