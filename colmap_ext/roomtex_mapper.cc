// roomtex-mapper: COLMAP's mapper behind an initialiser that is not fooled by walls.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <fmt/core.h>

#include "colmap_ext/known_photos.h"
#include "colmap_ext/mapper_verdict.h"
#include "colmap_ext/mapping.h"
#include "colmap_ext/mapping_report.h"
#include "colmap_ext/mapping_trust.h"
#include "colmap_ext/model_output.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/input_guard.h"
#include "core/json_text.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/result_names.h"
#include "core/standard_files.h"
#include "core/text.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

void AddOptions(MappingOptions* options, Command* command) {
  using Kind = Command::Kind;
  command->AddInputPath(
      "database_path", &options->database_path,
      "COLMAP's database with verified matches (colmap exhaustive_matcher). Only read.");
  command->AddInputPath("image_path", &options->image_path,
                        "Folder of the photos, as given to colmap feature_extractor.");
  command->AddInputPath(
      "known_path", &options->known_path,
      "COLMAP model of photos whose poses are known in the frame of a scan, among those of "
      "--image_path: what roomtex-import --images_path writes for the photos of an E57 "
      "(DIR/sparse). Two or more of them that stand apart put the model into that frame, metric; "
      "those of one standpoint leave that to roomtex-align. It needs no picks either way.",
      Command::Kind::kOptional);
  command->AddOutputPath("output_path", &options->output_path,
                         "Folder to write into: 0/ (the model; 1/ ... those of other rooms), init/ "
                         "(the two-view model that 0/ started from), roomtex-mapper.log (what "
                         "COLMAP said).");
  command->AddString("colmap", &options->colmap, "COLMAP's program: a path, or a name on the PATH.",
                     Kind::kOptional);
  command->AddChoice(
      "refine_intrinsics", &options->refine_intrinsics, kRefineIntrinsicsWords,
      "Refine focal length and distortion: auto = of a calibrated camera where its photos "
      "contradict it, which is said, and of an uncalibrated one (prior_focal_length = 0, or a "
      "focal "
      "length from EXIF without any distortion) where they determine it; 1 = always; 0 = never.");
  command->Add(FieldsOf(&options->init));
  command->Add(FieldsOf(&options->chain));
  command->AddBool(
      "Groups.enabled", &options->map_all_groups,
      "Give groups of photos that nothing connects models of their own, 0/, 1/ ... (of four photos "
      "and more), the one with the most photos first; 0 = only one of them is mapped.");
  command->AddBool(
      "Rooms.enabled", &options->take_rooms_apart,
      "Give rooms that are alike (the same wallpaper and furniture) models of their own, 0/, 1/ "
      "...: photos that find each other's points, and not those of the others at the same places.");
  command->PassThrough(
      "--Mapper.", &options->mapper.mapper_arguments,
      "Handed on to colmap mapper (see colmap mapper -h). --Mapper.init_* have no effect: "
      "the pair is chosen here, by --Init.*.");
}

std::string GroupText(const std::set<uint32_t>& group, const MatchedImages& images) {
  return fmt::format("a group of {} photos, e.g. {}", group.size(),
                     images.images().at(*group.begin()).name);
}

// Throws InputError for photos to start from that no group holds (together), which would be passed
// over.
void CheckStartPhotos(const MatchedImages& images, const MappingOptions& options) {
  const std::vector<std::set<uint32_t>> groups = PhotoGroups(images, options);
  const std::set<uint32_t>* first = nullptr;
  for (const std::string* name : {&options.init.image_name1, &options.init.image_name2}) {
    if (name->empty()) continue;
    const uint32_t id = images.FindImage(*name)->image_id;
    const auto group = std::find_if(groups.begin(), groups.end(),
                                    [id](const auto& one) { return one.count(id) > 0; });
    if (group == groups.end()) {
      throw InputError(options.database_path, *name,
                       fmt::format("is connected by verified matches with fewer than {} photos, "
                                   "which get no model beside the larger groups",
                                   kFewestOfModel),
                       "Name a photo of a larger group by --Init.image_name1 and 2, or match this "
                       "one with more photos");
    }
    if (first != nullptr && first != &*group) {
      throw InputError(options.database_path, "",
                       "holds no verified matches that connect " + options.init.image_name1 +
                           " (of " + GroupText(*first, images) + ") with " + *name + " (of " +
                           GroupText(*group, images) + ")",
                       "Give two photos of one group by --Init.image_name1 and 2, or match photos "
                       "between the two");
    }
    first = &*group;
  }
}

// Everything in the database that would make mapping senseless.
void CheckDatabase(const MatchedImages& images, const MappingOptions& options,
                   const Command::Context& context) {
  const std::string& path = options.database_path;
  if (images.images().empty()) {
    throw InputError(path, "", "holds no images", "Run colmap feature_extractor first");
  }
  if (images.pairs().empty()) {
    throw InputError(path, "", "holds no verified matches",
                     "Run colmap exhaustive_matcher (or another matcher) first");
  }
  for (const std::string* name : {&options.init.image_name1, &options.init.image_name2}) {
    if (name->empty() || images.FindImage(*name) != nullptr) continue;
    throw InputError(path, "", "holds no image " + *name,
                     "Give --Init.image_name1 and 2 as the database names them, e.g. " +
                         images.images().begin()->second.name);
  }
  CheckStartPhotos(images, options);
  std::string missing;
  int num_missing = 0;
  for (const auto& [image_id, image] : images.images()) {
    std::error_code error;
    if (fs::is_regular_file(fs::path(options.image_path) / image.name, error)) continue;
    if (num_missing++ == 0) missing = image.name;
  }
  if (num_missing > 0) {
    throw InputError(options.image_path, "",
                     "lacks " + std::to_string(num_missing) + " of the " +
                         std::to_string(images.images().size()) + " photos of the database, e.g. " +
                         missing,
                     "Give the folder that was given to colmap feature_extractor");
  }
  const bool refines =
      RefineIntrinsicsFromWord(options.refine_intrinsics) != RefineIntrinsics::kNever;
  for (const auto& [camera_id, camera] : images.cameras()) {
    if (camera.IsPanorama()) {
      throw InputError(path, "camera " + std::to_string(camera_id),
                       "is EQUIRECTANGULAR: panoramas have no picture plane to start from",
                       "Cut them into faces with roomtex-import, or use colmap mapper of COLMAP "
                       "4.1");
    }
    if (camera.has_prior_focal_length || refines) continue;
    context.Warn(
        "camera " + std::to_string(camera_id) +
        " has prior_focal_length = 0: COLMAP guessed its focal length and verified its pairs "
        "as uncalibrated. Give --ImageReader.camera_params to colmap feature_extractor, or "
        "--refine_intrinsics auto here");
  }
}

KnownPhotos ReadKnownPhotos(const MappingOptions& options, const MatchedImages& images,
                            const Command::Context& context) {
  if (options.known_path.empty()) return {};
  KnownPhotos known = FindKnownPhotos(options.known_path, ReadSparseModel(options.known_path),
                                      images.images(), images.cameras());
  if (!known.unmatched.empty()) {
    context.Warn(std::to_string(known.unmatched.size()) + " of the photos of " +
                 options.known_path + " are not in the database, e.g. " + known.unmatched[0]);
  }
  return known;
}

[[noreturn]] void ThrowNothingWorked(const std::string& database_path, const Json& trials) {
  std::string reasons;
  std::set<std::string> told;
  bool colmap_fails = !trials.empty(), says_why = false;  // no photo helps then
  for (const Json& trial : trials) {
    const std::string outcome = trial["outcome"].get<std::string>();
    colmap_fails &= outcome.find("was killed by signal") != std::string::npos;
    says_why |= outcome.find("Check failed") != std::string::npos;
  }
  constexpr size_t kNumShown = 3;
  for (size_t i = 0; i < trials.size() && i < kNumShown; ++i) {
    const std::string outcome = trials[i]["outcome"].get<std::string>();
    reasons += "; " + trials[i]["pair"][0].get<std::string>() + " and " +
               trials[i]["pair"][1].get<std::string>() + ": " +
               (told.insert(outcome).second ? outcome : "the same");
  }
  if (trials.empty()) {
    reasons = "; no pair has --Init.min_num_inliers verified matches";
  } else if (trials.size() > kNumShown) {
    reasons += "; and " + std::to_string(trials.size() - kNumShown) + " more pairs";
  }
  throw InputError(database_path, "", "gives no pair to start from" + reasons,
                   colmap_fails && says_why
                       ? "This is COLMAP's own failure, for the reason that it gives: name another "
                         "version of it with --colmap"
                   : colmap_fails ? "This is COLMAP's own failure: give it more memory or threads "
                                    "(ulimit -v, ulimit -u), or name another one with --colmap"
                                  : "Add photos from other places that overlap well, or relax "
                                    "--Init.*");
}

std::string ModelPath(const MappingOptions& options, size_t number) {
  return options.output_path + "/" + std::to_string(number);
}

// Of photos that may fall apart into more groups, and rooms, than pairs tell.
size_t MostModels(const MatchedImages& images, const MappingOptions& options) {
  if (!options.map_all_groups && !options.take_rooms_apart) return 1;
  return std::max<size_t>(1, images.images().size() / kFewestOfModel);
}

bool IsOfEarlierRun(const MappingOptions& options, size_t number) {
  const Json report = ReadJsonIfAny(ModelPath(options, number) + "/" + kMapperReportName);
  return report.is_object() && report.value("model", Json()) == number;
}

// With the cameras of the user's database, as outputs/name.
void WriteModel(const MappedModel& model, const std::string& name, const ScratchFolder& scratch,
                OutputSet* outputs) {
  std::string folder = model.result->folder;
  if (!model.pass->plan.IsAsInDatabase()) {
    SparseModel restored = model.result->model;
    model.pass->plan.Restore(&restored);
    folder = scratch / ("restored_" + name);
    WriteSparseModel(restored, folder);
  }
  std::error_code error;
  fs::copy(folder, outputs->aside() + "/" + name, error);
  if (error) {
    throw InputError(outputs->folder(), "", "cannot be written into (" + error.message() + ")",
                     "Check the rights of this folder and the space on the disk");
  }
  outputs->ReplaceFolder(name);
}

// Of a model beside the first, for its folder.
Json ReportOfModel(const MappedModel& model, size_t number, const ModelTrust& trust) {
  Json json;
  json["command"] = "roomtex-mapper";
  json["model"] = number;
  json["is_alike"] = model.IsAlike();
  json["num_reg_images"] = model.result->model.images.size();
  json["num_points"] = model.result->model.points.size();
  json["mean_reprojection_error_px"] = model.result->mean_reprojection_error_px;
  json["refined_intrinsics"] = model.pass->refine;
  json["reasons"] = trust.reasons;
  json["check"] = trust.check;
  if (!trust.known.is_null()) json["known"] = trust.known;
  return json;
}

// The models appear with the report.
void WriteModels(const MappingOptions& options, const std::vector<MappedModel>& models,
                 const std::vector<ModelTrust>& trusts, const ScratchFolder& scratch) {
  const auto outputs = std::make_shared<OutputSet>(options.output_path);
  const MappingPass& first = *models[0].pass;
  SparseModel pair_model = first.best[0].seed.pair_model;
  if (!first.plan.IsAsInDatabase()) first.plan.Restore(&pair_model);
  WriteSparseModel(pair_model, outputs->aside() + "/init");
  outputs->ReplaceFolder("init");
  for (size_t number = 0; number < models.size(); ++number) {
    const std::string name = std::to_string(number);
    WriteModel(models[number], name, scratch, outputs.get());
    if (number == 0) continue;
    WriteJson(outputs->aside() + "/" + name + "/" + kMapperReportName,
              ReportOfModel(models[number], number, trusts[number]));
  }
  // Models of an earlier run are none of this one; what somebody has put there stays.
  for (size_t number = models.size(); IsOfEarlierRun(options, number); ++number) {
    outputs->ReplaceFolder(std::to_string(number));
  }
  ThrowIfInterrupted();
  CommitWithReport(std::string("0/") + kMapperReportName, outputs);
}

// That there are several, and what is not to be trusted of those beside the first, whose trust is
// that of the command.
void SayWhatModelsThereAre(const std::vector<MappedModel>& models,
                           const std::vector<ModelTrust>& trusts, const Command::Context& context) {
  constexpr size_t kNumShown = 4;
  std::string list;
  size_t num_groups = 0;
  for (size_t i = 0; i < models.size(); ++i) {
    if (models[i].is_room) continue;
    const SparseModel& model = models[i].result->model;
    if (++num_groups > kNumShown) continue;
    list += fmt::format("{}{} holds {} photos, e.g. {}", list.empty() ? "" : ", ", i,
                        model.images.size(), model.images.begin()->second.name);
  }
  if (num_groups > 1) {
    context.Warn(fmt::format(
        "The photos make {} models that too little connects to each other: {}{}. Each has a frame "
        "of its own, and roomtex-align puts each into the scan by itself. Of rooms that were meant "
        "to be one model, take and match photos between.",
        num_groups, list,
        num_groups > kNumShown ? fmt::format(" and {} more", num_groups - kNumShown) : ""));
  }
  for (const Json& reason : trusts[0].reasons) {
    context.report.SetUntrusted(reason["reason"].get<std::string>());
  }
  for (size_t i = 1; i < models.size(); ++i) {
    for (const Json& reason : trusts[i].reasons) {
      const bool is_told = std::count(trusts[0].reasons.begin(), trusts[0].reasons.end(), reason);
      if (is_told) continue;
      context.Warn(
          fmt::format("Model {} is not to be trusted: {}", i, reason["reason"].get<std::string>()));
    }
  }
}

void MapPhotos(const MappingOptions& options, const Command::Context& context) {
  std::vector<std::string> problems = options.init.Problems();
  AppendProblems(options.chain.Problems(), &problems);
  ThrowIfProblems(problems);
  RequireFolder(options.image_path, "Check --image_path: the folder of the photos");
  RequireOutsidePhotos(options.output_path, options.image_path);
  context.progress.Stage("read database");
  const Database database(options.database_path);
  const MatchedImages images(database);
  CheckDatabase(images, options, context);
  const KnownPhotos known = ReadKnownPhotos(options, images, context);

  MakeFolder(options.output_path);
  const size_t most_models = MostModels(images, options);
  for (size_t i = 0; i < most_models; ++i) RequireReplaceableModel(ModelPath(options, i));
  RequireReplaceableModel(options.output_path + "/init");
  const SignalGuard signals;
  const ScratchFolder scratch(options.output_path);
  const std::string log_path = options.output_path + "/roomtex-mapper.log";
  std::ofstream(log_path, std::ios::trunc) << "roomtex-mapper " << Version() << "\n";
  NoteLog(log_path);
  const std::vector<std::string>& passed = options.mapper.mapper_arguments;
  for (size_t i = 0; i < passed.size(); i += 2) {
    if (!BeginsWith(passed[i], "--Mapper.init_")) continue;
    context.Warn(passed[i] + " has no effect: the first pair is chosen here, by --Init.*");
  }

  Mapping mapping(options, context, database, images, known, scratch);
  const std::vector<MappingPass> passes = mapping.Run();
  context.report["pairs_tried"] = mapping.trials().size();
  context.report["pair_trials"] = mapping.trials();
  if (passes.empty()) ThrowNothingWorked(options.database_path, mapping.trials());
  FillMappingReport(passes, images, &context.report);
  const std::vector<MappedModel> models = ListModels(passes);
  const std::vector<ModelTrust> trusts = JudgeModels(
      passes, images, known, RefineIntrinsicsFromWord(options.refine_intrinsics), context);
  context.report["check"] = trusts[0].check;
  if (!trusts[0].known.is_null()) context.report["known"] = trusts[0].known;
  context.report["reasons"] = trusts[0].reasons;
  SayWhatModelsThereAre(models, trusts, context);

  context.progress.Stage("write model");
  for (size_t i = 0; i < models.size(); ++i) RequireReplaceableModel(ModelPath(options, i));
  WriteModels(options, models, trusts, scratch);
  for (size_t i = 0; i < models.size(); ++i) {
    const MapperResult& result = *models[i].result;
    AnswerAtEnd(fmt::format("{}: {} of {} photos{}, {} points, mean reprojection error {:.3f} px\n",
                            ModelPath(options, i), result.model.images.size(),
                            images.images().size(),
                            models[i].is_room ? ", of another room that is alike" : "",
                            result.model.points.size(), result.mean_reprojection_error_px));
  }
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  MappingOptions options;
  Command command(
      "roomtex-mapper",
      "COLMAP's mapper, started from a pair that this command chooses and solves: right also "
      "before walls, where two photos alone have two solutions.",
      "roomtex-mapper --database_path database.db --image_path photos --output_path sparse");
  AddOptions(&options, &command);
  return command.Run(argc, argv,
                     [&](const Command::Context& context) { MapPhotos(options, context); });
}
