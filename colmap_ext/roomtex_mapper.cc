// roomtex-mapper: COLMAP's mapper behind an initialiser that is not fooled by walls.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include <fmt/core.h>

#include "colmap_ext/calibration_check.h"
#include "colmap_ext/known_photos.h"
#include "colmap_ext/lens_check.h"
#include "colmap_ext/mapper_verdict.h"
#include "colmap_ext/mapping.h"
#include "colmap_ext/mapping_report.h"
#include "colmap_ext/model_check.h"
#include "colmap_ext/model_output.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/json_text.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/output_set.h"
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
                         "Folder to write into: 0/ (the model; 1/ ... those of rooms that are "
                         "alike), init/ (the two-view model it started "
                         "from), roomtex-mapper.log (what COLMAP said).");
  command->AddString("colmap", &options->colmap, "COLMAP's program: a path, or a name on the PATH.",
                     Kind::kOptional);
  command->AddChoice(
      "refine_intrinsics", &options->refine_intrinsics, kRefineIntrinsicsWords,
      "Refine focal length and distortion: auto = of a calibrated camera where its photos "
      "contradict "
      "it, which is said, and of an uncalibrated one (prior_focal_length = 0) where they determine "
      "it; 1 = always; 0 = never.");
  command->Add(FieldsOf(&options->init));
  command->Add(FieldsOf(&options->chain));
  command->AddBool(
      "Rooms.enabled", &options->take_rooms_apart,
      "Give rooms that are alike (the same wallpaper and furniture) models of their own, 0/, 1/ "
      "...: photos that find each other's points, and not those of the others at the same places.");
  command->PassThrough(
      "--Mapper.", &options->mapper.mapper_arguments,
      "Handed on to colmap mapper (see colmap mapper -h). --Mapper.init_* have no effect: "
      "the pair is chosen here, by --Init.*.");
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
  if (RefineIntrinsicsFromWord(options.refine_intrinsics) != RefineIntrinsics::kNever) return;
  for (const auto& [camera_id, camera] : images.cameras()) {
    if (camera.IsPanorama()) {
      throw InputError(path, "camera " + std::to_string(camera_id),
                       "is EQUIRECTANGULAR: panoramas have no picture plane to start from",
                       "Cut them into faces with roomtex-import, or use colmap mapper of COLMAP "
                       "4.1");
    }
    if (camera.has_prior_focal_length) continue;
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

// Not to be trusted. about: what roomtex-align goes by when it reads this (mapper_verdict.h).
void Refuse(const std::string& about, const std::string& reason, const Command::Context& context,
            Json* reasons) {
  context.report.SetUntrusted(reason);
  reasons->push_back({{"about", about}, {"reason", reason}});
}

void JudgeTrust(const MappingOutcome& outcome, const MatchedImages& images,
                const Command::Context& context, Json* reasons) {
  const PairTrial& trial = outcome.seed.trial;
  if (outcome.seed.ambiguous) {
    Refuse("motion", AmbiguousSentence(trial, images), context, reasons);
  }
  size_t num_registered = outcome.result.model.images.size();
  for (const MapperResult& room : outcome.other_rooms) num_registered += room.model.images.size();
  const std::string groups = SeparateGroupsSentence(images);
  if (2 * num_registered < images.images().size()) {
    Refuse("photos",
           fmt::format("only {} of {} photos could be registered. {}", num_registered,
                       images.images().size(),
                       groups.empty() ? "Take more photos between those that are missing, or match "
                                        "them more thoroughly."
                                      : groups),
           context, reasons);
  } else if (!groups.empty()) {
    context.Warn(groups);
  }
}

[[noreturn]] void ThrowNothingWorked(const std::string& database_path, const Json& trials) {
  std::string reasons;
  std::set<std::string> told;
  bool colmap_fails = !trials.empty();  // no photo helps then
  for (const Json& trial : trials) {
    colmap_fails &=
        trial["outcome"].get<std::string>().find("was killed by signal") != std::string::npos;
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
                   colmap_fails ? "This is COLMAP's own failure: give it more memory or threads "
                                  "(ulimit -v, ulimit -u), or name another one with --colmap"
                                : "Add photos from other places that overlap well, or relax "
                                  "--Init.*");
}

// What becomes of a model beside photos with known poses.
void ReportKnown(const MappingOutcome& outcome, const KnownPhotos& known,
                 const std::map<uint32_t, DatabaseImage>& images, const Command::Context& context,
                 Json* reasons) {
  if (!outcome.known) return;
  const KnownPlacement& placement = *outcome.known;
  const KnownFit& fit = placement.fit;
  context.report["known"] = KnownToJson(placement, known, images);
  const char by_scan[] =
      " The model keeps a frame of its own; roomtex-align puts it into the scan by what the scan "
      "shows in these photos.";
  switch (fit.kind) {
    case KnownFit::Kind::kTooFew:
      context.Warn(std::string("Fewer than two of the photos with known poses could be mapped.") +
                   by_scan);
      return;
    case KnownFit::Kind::kOnePlace:
      context.Warn(std::string("The photos with known poses stand too near each other to tell the "
                               "scale.") +
                   by_scan);
      return;
    case KnownFit::Kind::kContradicts:
      Refuse("motion",
             "the known poses contradict the photos: no similarity brings more than half of them "
             "to where the photos were mapped. Check --known_path, or map without it.",
             context, reasons);
      return;
    case KnownFit::Kind::kPlaced:
      break;
  }
  const auto names = [&images](const std::set<uint32_t>& ids) {
    std::string list;
    for (const uint32_t id : ids) list += (list.empty() ? "" : ", ") + images.at(id).name;
    return list;
  };
  if (!fit.contradicting.empty()) {
    context.Warn("Photos that were not taken where --known_path has them, as the others tell: " +
                 names(fit.contradicting) + ". Their poses are those of their matches.");
  }
  if (placement.held) {
    if (placement.rough.empty()) return;
    context.Warn("Known poses that are not exact enough to be held, and were adjusted: " +
                 names(placement.rough));
    return;
  }
  context.Warn(
      "The known poses are not exact enough to be held: most of the photos would lose most of "
      "their "
      "points, or the keypoints fit much worse. The model was moved to them, and no more.");
}

// A sentence on what roomtex-align goes by (mapper_verdict.h).
struct Doubt {
  const char* about;
  std::string reason;
};

// What a model's own photos say against it, the third-view test on pairs that it was not started
// from among it. json: the numbers.
std::vector<Doubt> DoubtsOf(const ModelCheck& check, const MatchedImages& images, Json* json) {
  std::vector<Doubt> doubts;
  const auto name_of = [&](uint32_t image_id) { return images.images().at(image_id).name; };
  (*json)["num_pairs"] = check.num_pairs;
  (*json)["contradicting"] = Json::array();
  for (const auto& [image_id1, image_id2] : check.contradicting) {
    (*json)["contradicting"].push_back({name_of(image_id1), name_of(image_id2)});
  }
  (*json)["doubtful_images"] = Json::array();
  std::string doubtful;
  for (const uint32_t image_id : check.doubtful) {
    (*json)["doubtful_images"].push_back(name_of(image_id));
    doubtful += (doubtful.empty() ? "" : ", ") + name_of(image_id) + " (" +
                Percent(check.support.at(image_id)) + ")";
  }
  if (!check.doubtful.empty()) {
    doubts.push_back(
        {"photos", "photos stand where most of their own matches do not put them: " + doubtful +
                       " of the matches obey the model. Take these photos out (they may show a "
                       "repeated pattern, or something that moved) and map again."});
  }
  const size_t num_contradicting = check.contradicting.size();
  if (static_cast<double>(num_contradicting) >
      ModelCheckOptions().max_contradicting * check.num_pairs) {
    const auto& [image_id1, image_id2] = check.contradicting.front();
    doubts.push_back(
        {"motion",
         fmt::format("the model is contradicted by its own photos: for {} of {} pairs, "
                     "e.g. {} and {}, a third photo supports another camera motion. "
                     "Start from another pair (--Init.image_name1), or add photos that "
                     "show something off the wall.",
                     num_contradicting, check.num_pairs, name_of(image_id1), name_of(image_id2))});
  }
  return doubts;
}

void ReportCheck(const MappingPass& pass, const Command::Context& context, Json* reasons) {
  const MatchedImages& images = *pass.images;
  for (Json& image : context.report["images"]) {
    const uint32_t image_id = images.FindImage(image["name"])->image_id;
    const auto add = [&](const ModelCheck& check) {
      const auto found = check.support.find(image_id);
      if (found != check.support.end()) image["match_support"] = found->second;
    };
    add(pass.check);
    for (const ModelCheck& check : pass.room_checks) add(check);
  }
  for (const auto& [about, reason] : DoubtsOf(pass.check, images, &context.report["check"])) {
    Refuse(about, reason, context, reasons);
  }
}

// Whether the errors shrink when the lens may change. refined: the mapper did refine it.
void CheckLens(MapperRun* mapper, const MappingOutcome& outcome, bool refined,
               const Command::Context& context, Json* reasons) {
  context.progress.Stage("check calibration");
  const CalibrationCheck check =
      CheckCalibration(outcome.result.model, [&](const SparseModel& model, bool refine) {
        ThrowIfInterrupted();
        return mapper->BundleAdjust(model, refine);
      });
  Json& json = context.report["check"]["calibration"];
  json["rms_fixed_px"] = check.rms_fixed_px;
  json["rms_free_px"] = check.rms_free_px;
  if (check.Fits()) return;
  Refuse(
      "calibration",
      fmt::format("the camera's calibration does not fit the photos: their error falls from {:.2f} "
                  "to {:.2f} px "
                  "when focal length and distortion may change, so the model is bent. {}",
                  check.rms_fixed_px, check.rms_free_px,
                  refined ? "Extract the features with a camera model that can describe the lens "
                            "(--ImageReader.camera_model OPENCV)."
                          : "Calibrate the camera, or give --refine_intrinsics auto."),
      context, reasons);
}

std::string RoomPath(const MappingOptions& options, int number) {
  return options.output_path + "/" + std::to_string(number);
}

bool IsRoomOfEarlierRun(const MappingOptions& options, int number) {
  const Json report = ReadJsonIfAny(RoomPath(options, number) + "/" + kMapperReportName);
  return report.is_object() && report.value("room", Json()) == number;
}

// With the cameras of the user's database, as outputs/name.
void WriteModel(const MapperResult& result, const std::string& name, const LensPlan& plan,
                const ScratchFolder& scratch, OutputSet* outputs) {
  std::string folder = result.folder;
  if (!plan.IsAsInDatabase()) {
    SparseModel model = result.model;
    plan.Restore(&model);
    folder = scratch / ("restored_" + name);
    WriteSparseModel(model, folder);
  }
  std::error_code error;
  fs::copy(folder, outputs->aside() + "/" + name, error);
  if (error) {
    throw InputError(outputs->folder(), "", "cannot be written into (" + error.message() + ")",
                     "Check the rights of this folder and the space on the disk");
  }
  outputs->ReplaceFolder(name);
}

// A room beside the first: its own photos are asked, what is common to all rooms is handed on.
Json ReportOfRoom(const MappingPass& pass, int number, const Json& common,
                  const Command::Context& context) {
  const MapperResult& room = pass.best[0].other_rooms[number - 1];
  Json json;
  json["command"] = "roomtex-mapper";
  json["room"] = number;
  json["num_reg_images"] = room.model.images.size();
  json["num_points"] = room.model.points.size();
  json["mean_reprojection_error_px"] = room.mean_reprojection_error_px;
  json["refined_intrinsics"] = pass.refine;
  json["reasons"] = common;
  const ModelCheck& check = pass.room_checks[number - 1];
  for (const auto& [about, reason] : DoubtsOf(check, *pass.images, &json["check"])) {
    json["reasons"].push_back({{"about", about}, {"reason", reason}});
    context.Warn(fmt::format("Model {} is not to be trusted: {}", number, reason));
  }
  return json;
}

// The models appear with the report. rooms: reports of those beside the first.
void WriteModels(const MappingOptions& options, const MappingPass& pass,
                 const ScratchFolder& scratch, const std::vector<Json>& rooms) {
  const MappingOutcome& outcome = pass.best[0];
  const auto outputs = std::make_shared<OutputSet>(options.output_path);
  SparseModel pair_model = outcome.seed.pair_model;
  if (!pass.plan.IsAsInDatabase()) pass.plan.Restore(&pair_model);
  WriteSparseModel(pair_model, outputs->aside() + "/init");
  outputs->ReplaceFolder("init");
  WriteModel(outcome.result, "0", pass.plan, scratch, outputs.get());
  int number = 1;
  for (const MapperResult& room : outcome.other_rooms) {
    const std::string name = std::to_string(number++);
    WriteModel(room, name, pass.plan, scratch, outputs.get());
    WriteJson(outputs->aside() + "/" + name + "/" + kMapperReportName, rooms[number - 2]);
  }
  // Rooms of an earlier run are none of this one; what somebody has put there stays.
  for (; IsRoomOfEarlierRun(options, number); ++number) {
    outputs->ReplaceFolder(std::to_string(number));
  }
  ThrowIfInterrupted();
  CommitWithReport(std::string("0/") + kMapperReportName, outputs);
}

void MapPhotos(const MappingOptions& options, const Command::Context& context) {
  std::vector<std::string> problems = options.init.Problems();
  AppendProblems(options.chain.Problems(), &problems);
  ThrowIfProblems(problems);
  RequireFolder(options.image_path, "Check --image_path: the folder of the photos");
  context.progress.Stage("read database");
  const Database database(options.database_path);
  const MatchedImages images(database);
  CheckDatabase(images, options, context);
  const KnownPhotos known = ReadKnownPhotos(options, images, context);

  MakeFolder(options.output_path);
  const std::string model_path = options.output_path + "/0";
  RequireReplaceableModel(model_path);
  RequireReplaceableModel(options.output_path + "/init");
  const SignalGuard signals;
  const ScratchFolder scratch(options.output_path);
  std::ofstream(options.output_path + "/roomtex-mapper.log", std::ios::trunc)
      << "roomtex-mapper " << Version() << "\n";
  const std::vector<std::string>& passed = options.mapper.mapper_arguments;
  for (size_t i = 0; i < passed.size(); i += 2) {
    if (passed[i].rfind("--Mapper.init_", 0) != 0) continue;
    context.Warn(passed[i] + " has no effect: the first pair is chosen here, by --Init.*");
  }

  Mapping mapping(options, context, database, images, known, scratch);
  MappingPass pass = mapping.Run();
  context.report["pairs_tried"] = pass.trials.size();
  context.report["pair_trials"] = pass.trials;
  if (pass.best.empty()) ThrowNothingWorked(options.database_path, pass.trials);
  const MappingOutcome& outcome = pass.best[0];
  FillMappingReport(outcome, *pass.images, &context.report);
  context.report["refined_intrinsics"] = pass.refine;
  if (!pass.lenses.not_checked.empty()) context.Warn(pass.lenses.not_checked);
  context.report["cameras"] = Json::array();
  for (const LensFinding& lens : pass.lenses.lenses) {
    context.report["cameras"].push_back(LensToJson(lens));
  }
  Json common = Json::array(), own = Json::array();  // to all rooms, and of the first model
  JudgeTrust(outcome, *pass.images, context, &common);
  ReportCheck(pass, context, &own);
  ReportKnown(outcome, known, images.images(), context, &own);
  CheckLens(pass.mapper.get(), outcome, pass.refine, context, &common);
  context.report["reasons"] = common;
  for (const Json& reason : own) context.report["reasons"].push_back(reason);
  std::vector<Json> rooms;
  for (size_t i = 1; i <= outcome.other_rooms.size(); ++i) {
    rooms.push_back(ReportOfRoom(pass, static_cast<int>(i), common, context));
  }

  context.progress.Stage("write model");
  for (size_t i = 1; i <= outcome.other_rooms.size(); ++i) {
    RequireReplaceableModel(RoomPath(options, static_cast<int>(i)));
  }
  WriteModels(options, pass, scratch, rooms);
  std::printf("%s: %zu of %zu photos, %zu points, mean reprojection error %.3f px\n",
              model_path.c_str(), outcome.result.model.images.size(), images.images().size(),
              outcome.result.model.points.size(), outcome.result.mean_reprojection_error_px);
  int number = 1;
  for (const MapperResult& room : outcome.other_rooms) {
    std::printf("%s: %zu photos of another room that is alike, %zu points, %.3f px\n",
                RoomPath(options, number++).c_str(), room.model.images.size(),
                room.model.points.size(), room.mean_reprojection_error_px);
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
