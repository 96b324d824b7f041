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
#include "colmap_ext/lens_check.h"
#include "colmap_ext/lens_labels.h"
#include "colmap_ext/lens_plan.h"
#include "colmap_ext/mapper_run.h"
#include "colmap_ext/mapper_verdict.h"
#include "colmap_ext/model_check.h"
#include "colmap_ext/model_output.h"
#include "colmap_ext/view_chaining.h"
#include "core/command_line.h"
#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

struct Options {
  std::string database_path, image_path, output_path;
  std::string colmap = "colmap";
  InitOptions init;
  MapperOptions mapper;
  ChainOptions chain;
  std::string refine_intrinsics = "auto";
};

void AddOptions(Options* options, Command* command) {
  using Kind = Command::Kind;
  command->AddInputPath(
      "database_path", &options->database_path,
      "COLMAP's database with verified matches (colmap exhaustive_matcher). Only read.");
  command->AddInputPath("image_path", &options->image_path,
                        "Folder of the photos, as given to colmap feature_extractor.");
  command->AddOutputPath(
      "output_path", &options->output_path,
      "Folder to write into: 0/ (the model), init/ (the two-view model it started "
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
  command->PassThrough(
      "--Mapper.", &options->mapper.mapper_arguments,
      "Handed on to colmap mapper (see colmap mapper -h). --Mapper.init_* have no effect: "
      "the pair is chosen here, by --Init.*.");
}

// Everything in the database that would make mapping senseless.
void CheckDatabase(const MatchedImages& images, const Options& options,
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

Json TrialJson(const PairTrial& trial, const MatchedImages& images, const std::string& outcome) {
  Json json;
  json["pair"] = {images.images().at(trial.image_id1).name,
                  images.images().at(trial.image_id2).name};
  json["num_matches"] = trial.num_matches;
  json["h_ratio"] = trial.analysis.h_ratio;
  json["num_hypotheses"] = trial.analysis.hypotheses.size();
  json["outcome"] = outcome;
  return json;
}

struct Outcome {
  Seed seed;
  MapperResult result;
  std::map<uint32_t, ChainedView> chained;
  std::map<uint32_t, std::string> reasons;  // of photos that could not be chained
};

// How a photo was registered, or why it was not.
Json ImageJson(const DatabaseImage& image, const Outcome& outcome, const MatchedImages& images) {
  const bool registered = outcome.result.model.images.count(image.image_id) > 0;
  const auto chained = outcome.chained.find(image.image_id);
  Json json;
  json["name"] = image.name;
  json["registered"] = registered;
  json["by"] = !registered                                           ? "none"
               : chained != outcome.chained.end()                    ? "chained"
               : outcome.seed.poses.images.count(image.image_id) > 0 ? "seed"
                                                                     : "mapper";
  if (registered && chained != outcome.chained.end()) {
    json["neighbor"] = images.images().at(chained->second.neighbor_id).name;
    json["num_common_points"] = chained->second.num_common_points;
    json["scale_spread"] = chained->second.scale_spread;
  }
  if (!registered) {
    const auto reason = outcome.reasons.find(image.image_id);
    json["reason"] = reason != outcome.reasons.end()
                         ? reason->second
                         : "too few points of the model for colmap mapper, and --Chain.enabled 0";
  }
  return json;
}

void FillReport(const Outcome& outcome, const MatchedImages& images, Report* report) {
  const PairTrial& trial = outcome.seed.trial;
  const SparseModel& model = outcome.result.model;
  Report& r = *report;
  r["pair"] = {images.images().at(trial.image_id1).name, images.images().at(trial.image_id2).name};
  r["num_f_inliers"] = trial.analysis.num_f_inliers;
  r["num_h_inliers"] = trial.analysis.num_h_inliers;
  r["h_ratio"] = trial.analysis.h_ratio;
  r["degenerate"] = trial.analysis.degenerate;
  r["num_points"] = model.points.size();
  r["num_reg_images"] = model.images.size();
  r["num_images"] = images.images().size();
  r["mean_reprojection_error_px"] = outcome.result.mean_reprojection_error_px;
  const ThirdViewDecision& decision = trial.decision;
  const TwoViewHypothesis& chosen = trial.analysis.hypotheses[decision.best];
  Json init;
  init["num_matches"] = trial.num_matches;
  init["num_points"] = outcome.seed.pair_model.points.size();
  init["origin"] = chosen.origin;
  init["median_angle_deg"] = chosen.median_angle_deg;
  init["num_off_plane"] = trial.analysis.num_off_plane;
  init["num_third_views"] = decision.num_views;
  init["num_hypotheses"] = trial.analysis.hypotheses.size();
  // null: there was no second hypothesis to compare with.
  init["confidence"] = std::isfinite(decision.confidence) ? Json(decision.confidence) : Json();
  init["seed_images"] = Json::array();
  for (const auto& [image_id, image] : outcome.seed.poses.images) {
    init["seed_images"].push_back(image.name);
  }
  r["init"] = init;
  r["images"] = Json::array();
  for (const auto& [image_id, image] : images.images()) {
    r["images"].push_back(ImageJson(image, outcome, images));
  }
}

// Names the pair, and the photo that would cure it.
std::string AmbiguousSentence(const PairTrial& trial, const MatchedImages& images) {
  const std::string name1 = images.images().at(trial.image_id1).name,
                    name2 = images.images().at(trial.image_id2).name;
  const std::string cure =
      " Add a photo that overlaps both, taken from another place (not in one "
      "line with them), best with something that stands off the wall.";
  if (trial.decision.num_views == 0) {
    return "planar-ambiguous: " + name1 + " and " + name2 +
           " show (almost) one plane, which allows two camera motions, and no third photo sees "
           "enough of what both see to tell which one is right." +
           cure;
  }
  return fmt::format(
      "planar-ambiguous: two camera motions explain {} and {} about equally well (ratio {:.2f}, {} "
      "third views), as happens before a wall.{}",
      name1, name2, trial.decision.confidence, trial.decision.num_views, cure);
}

// Not to be trusted. about: what roomtex-align goes by when it reads this (mapper_verdict.h).
void Refuse(const std::string& about, const std::string& reason, const Command::Context& context,
            Json* reasons) {
  context.report.SetUntrusted(reason);
  reasons->push_back({{"about", about}, {"reason", reason}});
}

void JudgeTrust(const Outcome& outcome, const MatchedImages& images,
                const Command::Context& context, Json* reasons) {
  const PairTrial& trial = outcome.seed.trial;
  if (outcome.seed.ambiguous) {
    Refuse("motion", AmbiguousSentence(trial, images), context, reasons);
  }
  const size_t num_registered = outcome.result.model.images.size();
  if (2 * num_registered < images.images().size()) {
    Refuse("photos",
           "only " + std::to_string(num_registered) + " of " +
               std::to_string(images.images().size()) +
               " photos could be registered. Take more photos between those that are "
               "missing, or match them more thoroughly.",
           context, reasons);
  }
}

bool Better(const MapperResult& a, const MapperResult& b) {
  if (a.model.images.size() != b.model.images.size()) {
    return a.model.images.size() > b.model.images.size();
  }
  return a.model.points.size() > b.model.points.size();
}

[[noreturn]] void ThrowNothingWorked(const std::string& database_path, const Json& trials) {
  std::string reasons;
  std::set<std::string> told;
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
                   "Add photos from other places that overlap well, or relax --Init.*");
}

// The matches as rays by the intrinsics of the model, which may have been refined.
MatchedImages ImagesOfModel(const Database& database, const MatchedImages& images,
                            const SparseModel& model) {
  std::map<uint32_t, Camera> cameras = images.cameras();
  for (const auto& [camera_id, camera] : model.cameras) cameras[camera_id] = camera;
  return MatchedImages(cameras, images.images(), images.pairs(),
                       [&database](uint32_t image_id) { return database.ReadKeypoints(image_id); });
}

HypothesisOptions PairOptions(const Options& options, const Command::Context& context) {
  HypothesisOptions pair;
  pair.keypoint_noise_px = options.init.keypoint_noise_px;
  pair.max_error_px = options.init.max_error_px;
  pair.random_seed = static_cast<uint64_t>(context.options.random_seed);
  return pair;
}

// Registers what the mapper left out.
void ChainLeftOut(const Database& database, const MatchedImages& images, MapperRun* mapper,
                  const Options& options, const Command::Context& context, Outcome* outcome) {
  MatchedImages model_images = ImagesOfModel(database, images, outcome->result.model);
  context.progress.Stage("chain photos");
  ViewChainer chainer(&model_images, options.chain, PairOptions(options, context),
                      context.options.num_threads);
  ChainResult chain = chainer.Run(std::move(outcome->result), [&](const SparseModel& poses) {
    ThrowIfInterrupted();
    return mapper->Adjust(poses);
  });
  outcome->result = std::move(chain.result);
  outcome->chained = std::move(chain.chained);
  outcome->reasons = std::move(chain.reasons);
}

// The third-view test on pairs that the model was not started from.
void CheckFinished(const Database& database, const MatchedImages& images, const Options& options,
                   const Command::Context& context, const Outcome& outcome, Json* reasons) {
  const SparseModel& model = outcome.result.model;
  MatchedImages model_images = ImagesOfModel(database, images, model);
  ModelCheckOptions check_options;
  check_options.pair = PairOptions(options, context);
  check_options.min_confidence = options.init.min_confidence;
  context.progress.Stage("check model");
  const PairTrial& trial = outcome.seed.trial;
  const ModelCheck check = CheckModel(&model_images, model, {trial.image_id1, trial.image_id2},
                                      check_options, context.options.num_threads);
  Json& json = context.report["check"];
  json["num_pairs"] = check.num_pairs;
  json["contradicting"] = Json::array();
  std::string names;
  for (const auto& [image_id1, image_id2] : check.contradicting) {
    const std::string name1 = images.images().at(image_id1).name,
                      name2 = images.images().at(image_id2).name;
    json["contradicting"].push_back({name1, name2});
    if (names.empty()) names = name1 + " and " + name2;
  }
  json["doubtful_images"] = Json::array();
  std::string doubtful;
  for (const uint32_t image_id : check.doubtful) {
    const std::string name = images.images().at(image_id).name;
    json["doubtful_images"].push_back(name);
    doubtful +=
        (doubtful.empty() ? "" : ", ") + name + " (" + Percent(check.support.at(image_id)) + ")";
  }
  for (Json& image : context.report["images"]) {
    const auto found = check.support.find(images.FindImage(image["name"])->image_id);
    if (found != check.support.end()) image["match_support"] = found->second;
  }
  if (!check.doubtful.empty()) {
    Refuse("photos",
           "photos stand where most of their own matches do not put them: " + doubtful +
               " of the matches obey the model. Take these photos out (they may show a repeated "
               "pattern, or something that moved) and map again.",
           context, reasons);
  }
  if (static_cast<double>(check.contradicting.size()) <=
      check_options.max_contradicting * check.num_pairs) {
    return;
  }
  Refuse("motion",
         "the model is contradicted by its own photos: for " +
             std::to_string(check.contradicting.size()) + " of " + std::to_string(check.num_pairs) +
             " pairs, e.g. " + names +
             ", a third photo supports another camera motion. Start from another pair "
             "(--Init.image_name1), or add photos that show something off the wall.",
         context, reasons);
}

// Whether the errors shrink when the lens may change. refined: the mapper did refine it.
void CheckLens(MapperRun* mapper, const Outcome& outcome, bool refined,
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

// Seeds one after the other until COLMAP makes something of one.
std::vector<Outcome> TrySeeds(const Database& database, MatchedImages* images, MapperRun* mapper,
                              const Options& options, const Command::Context& context,
                              Json* trials) {
  const int num_images = static_cast<int>(images->images().size());
  std::vector<Outcome> best;  // at most one
  Initializer initializer(images, options.init, context.options.num_threads,
                          static_cast<uint64_t>(context.options.random_seed));
  for (int tried = 0; tried < options.init.max_pairs; ++tried) {
    if (tried > 0) context.progress.Stage("initialise");
    std::optional<Seed> seed = initializer.Next();
    ThrowIfInterrupted();
    if (!seed) break;
    context.progress.Note("pair " + images->images().at(seed->trial.image_id1).name + ", " +
                          images->images().at(seed->trial.image_id2).name + ": " +
                          std::to_string(seed->pair_model.points.size()) + " points, " +
                          std::to_string(seed->poses.images.size() - 2) + " third views agree");
    context.progress.Stage("colmap mapper", num_images);
    Outcome outcome;
    outcome.result = mapper->Run(*seed, num_images, [&] { context.progress.Tick(); });
    outcome.seed = std::move(*seed);
    const int num_mapped = static_cast<int>(outcome.result.model.images.size());
    if (options.chain.enabled && !outcome.result.folder.empty() && num_mapped < num_images) {
      ChainLeftOut(database, *images, mapper, options, context, &outcome);
    }
    const bool all_in_seed = static_cast<int>(outcome.seed.poses.images.size()) == num_images;
    if (outcome.result.problem.empty() && !outcome.result.grew && !all_in_seed) {
      outcome.result.problem = "no further photo could be registered";
    }
    trials->push_back(
        TrialJson(outcome.seed.trial, *images,
                  outcome.result.problem.empty()
                      ? std::to_string(outcome.result.model.images.size()) + " photos registered"
                      : outcome.result.problem));
    if (!outcome.result.problem.empty()) {
      context.Warn("starting from " + images->images().at(outcome.seed.trial.image_id1).name +
                   " and " + images->images().at(outcome.seed.trial.image_id2).name + ": " +
                   outcome.result.problem);
    }
    if (outcome.result.folder.empty()) continue;
    const bool enough = 2 * outcome.result.model.images.size() >= images->images().size();
    if (best.empty() || Better(outcome.result, best[0].result)) {
      best.clear();
      best.push_back(std::move(outcome));
    }
    if (enough) break;
  }
  for (const PairTrial& trial : initializer.Rejected()) {
    trials->push_back(TrialJson(trial, *images, trial.problem));
  }
  return best;
}

// The photos of one way to see the lenses, mapped.
struct Pass {
  Pass(LensPlan planned, bool refined) : plan(std::move(planned)), refine(refined) {}

  LensPlan plan;
  bool refine;
  std::unique_ptr<MatchedImages> images;
  std::unique_ptr<MapperRun> mapper;
  std::vector<Outcome> best;  // at most one
  LensCheck lenses;
  Json trials = Json::array();

  const SparseModel& model() const { return best[0].result.model; }
};

class Mapping {
 public:
  Mapping(const Options& options, const Command::Context& context, const Database& database,
          const MatchedImages& images, const ScratchFolder& scratch)
      : options_(options),
        context_(context),
        database_(database),
        images_(images),
        scratch_(scratch),
        refine_(RefineIntrinsicsFromWord(options.refine_intrinsics)),
        colmap_(options.colmap, options.output_path + "/roomtex-mapper.log") {
    for (const auto& [id, image] : images.images()) names_[id] = image.name;
    labels_ = ReadLensLabels(names_, options.image_path);
  }

  // With the lenses as the database has them, and, if the photos know better, once more.
  Pass Run() {
    LensPlan plan = refine_ == RefineIntrinsics::kNever
                        ? LensPlan(images_.cameras(), images_.images())
                        : LensPlan(images_.cameras(), images_.images(), labels_);
    for (const std::string& note : plan.notes()) context_.Warn(note);
    const bool calibrated =
        std::all_of(plan.cameras().begin(), plan.cameras().end(),
                    [](const auto& one) { return one.second.has_prior_focal_length; });
    const bool automatic = refine_ == RefineIntrinsics::kAuto;
    Pass best = Map(plan, refine_ == RefineIntrinsics::kAlways || (automatic && !calibrated));
    if (best.best.empty() || refine_ == RefineIntrinsics::kNever) return best;
    if (automatic && best.refine && !IsDetermined(best.lenses)) {
      context_.Warn(
          "the photos do not determine the focal length: it stays as the database has it");
      return BetterOf(std::move(best), Map(plan, false));
    }
    KeepCalibrated(&best);
    for (int i = 0; automatic && i < kMaxMoreMappings && IsContradicted(best); ++i) {
      plan.Take(best.lenses, best.model());
      best = BetterOf(std::move(best), Map(plan, true));
      KeepCalibrated(&best);
    }
    return best;
  }

 private:
  // As a share; larger is no determination.
  static constexpr double kMaxFocalSigma = 0.03;

  // A calibrated lens stays unless the photos know theirs so well, or are so sure that it is wrong:
  // of one plane, or of a walk along a wall, they take a bent room for another lens.
  static constexpr double kMaxFocalSigmaOfCalibrated = 0.004;
  static constexpr double kSureDeviations = 15;  // LensFinding::deviations

  static constexpr int kMaxMoreMappings = 2;

  static bool IsDetermined(const LensCheck& check) {
    return std::all_of(check.lenses.begin(), check.lenses.end(), [](const LensFinding& lens) {
      return lens.focal_sigma < kMaxFocalSigma * lens.found.MeanFocalLength();
    });
  }

  void KeepCalibrated(Pass* pass) const {
    for (LensFinding& lens : pass->lenses.lenses) {
      const Camera& told = pass->plan.cameras().at(lens.camera_ids[0]);
      if (refine_ != RefineIntrinsics::kAuto || !lens.used || lens.apart) continue;
      if (!told.has_prior_focal_length || lens.deviations > kSureDeviations) continue;
      const double sigma = lens.focal_sigma / told.MeanFocalLength();
      if (sigma < kMaxFocalSigmaOfCalibrated) continue;
      lens.used = false;
      context_.Warn(fmt::format(
          "The photos would have a focal length of {:.1f} pixels instead of {:.1f}, but know it to "
          "{:.1f} % only: the calibrated lens stays.",
          lens.found.MeanFocalLength(), told.MeanFocalLength(), 100 * sigma));
    }
  }

  // And says so.
  bool IsContradicted(const Pass& pass) const {
    bool contradicted = false;
    for (const LensFinding& lens : pass.lenses.lenses) {
      if (!lens.used) continue;
      contradicted = true;
      context_.Warn(lens.Sentence() +
                    (pass.refine ? "" : " --refine_intrinsics 0 keeps what was told."));
    }
    return contradicted && IsDetermined(pass.lenses);
  }

  // The later one, if it lost no photos.
  static Pass BetterOf(Pass first, Pass second) {
    if (second.best.empty()) return first;
    if (second.model().images.size() < first.model().images.size()) return first;
    return second;
  }

  Pass Map(const LensPlan& plan, bool refine) {
    const int number = ++num_passes_;
    const std::string database_copy = scratch_ / ("database_" + std::to_string(number) + ".db");
    const int version = colmap_.VersionNumber();
    database_.CopyForMapper(database_copy, version > 0 && version < 310
                                               ? Database::Schema::kColmap39
                                               : Database::Schema::kAsIs);
    const bool as_planned =
        plan.IsAsInDatabase() || Database::SetCameras(database_copy, plan.cameras(), plan.images());
    Pass pass(as_planned ? plan : LensPlan(images_.cameras(), images_.images()), refine);
    pass.images = std::make_unique<MatchedImages>(
        pass.plan.cameras(), pass.plan.images(), images_.pairs(),
        [this](uint32_t image_id) { return database_.ReadKeypoints(image_id); });
    const std::string folder = scratch_ / ("pass_" + std::to_string(number));
    MakeFolder(folder);
    mapper_options_ = options_.mapper;
    mapper_options_.refine_intrinsics = refine;
    mapper_options_.num_threads = context_.options.num_threads;
    mapper_options_.random_seed = context_.options.random_seed;
    pass.mapper = std::make_unique<MapperRun>(&colmap_, database_copy, options_.image_path, folder,
                                              mapper_options_);
    context_.progress.Stage("initialise");
    pass.best =
        TrySeeds(database_, pass.images.get(), pass.mapper.get(), options_, context_, &pass.trials);
    if (!pass.best.empty()) {
      context_.progress.Stage("check lenses");
      pass.lenses = CheckLenses(pass.model(), labels_, RefineIntrinsics::kAuto);
    }
    return pass;
  }

  const Options& options_;
  const Command::Context& context_;
  const Database& database_;
  const MatchedImages& images_;
  const ScratchFolder& scratch_;
  const RefineIntrinsics refine_;
  ColmapProgram colmap_;
  MapperOptions mapper_options_;
  std::map<uint32_t, std::string> names_;
  LensLabels labels_;
  int num_passes_ = 0;
};

// Models with the cameras of the user's database.
void WriteModels(const Options& options, const Pass& pass, const ScratchFolder& scratch) {
  const Outcome& outcome = pass.best[0];
  const std::string init_scratch = scratch / "init";
  SparseModel pair_model = outcome.seed.pair_model;
  std::string folder = outcome.result.folder;
  if (!pass.plan.IsAsInDatabase()) {
    SparseModel model = outcome.result.model;
    pass.plan.Restore(&model);
    pass.plan.Restore(&pair_model);
    folder = scratch / "restored";
    WriteSparseModel(model, folder);
  }
  WriteSparseModel(pair_model, init_scratch);
  ThrowIfInterrupted();
  ReplaceFolder(init_scratch, options.output_path + "/init", scratch.path());
  ReplaceFolder(folder, options.output_path + "/0", scratch.path());
}

void MapPhotos(const Options& options, const Command::Context& context) {
  std::vector<std::string> problems = options.init.Problems();
  AppendProblems(options.chain.Problems(), &problems);
  ThrowIfProblems(problems);
  RequireFolder(options.image_path, "Check --image_path: the folder of the photos");
  context.progress.Stage("read database");
  const Database database(options.database_path);
  const MatchedImages images(database);
  CheckDatabase(images, options, context);

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

  Mapping mapping(options, context, database, images, scratch);
  Pass pass = mapping.Run();
  context.report["pairs_tried"] = pass.trials.size();
  context.report["pair_trials"] = pass.trials;
  if (pass.best.empty()) ThrowNothingWorked(options.database_path, pass.trials);
  const Outcome& outcome = pass.best[0];
  FillReport(outcome, *pass.images, &context.report);
  context.report["refined_intrinsics"] = pass.refine;
  context.report["cameras"] = Json::array();
  for (const LensFinding& lens : pass.lenses.lenses) {
    context.report["cameras"].push_back(LensToJson(lens));
  }
  Json reasons = Json::array();
  JudgeTrust(outcome, *pass.images, context, &reasons);
  CheckFinished(database, *pass.images, options, context, outcome, &reasons);
  CheckLens(pass.mapper.get(), outcome, pass.refine, context, &reasons);
  context.report["reasons"] = reasons;

  context.progress.Stage("write model");
  WriteModels(options, pass, scratch);
  context.report.AddCopy(model_path + "/" + kMapperReportName);
  std::printf("%s: %zu of %zu photos, %zu points, mean reprojection error %.3f px\n",
              model_path.c_str(), outcome.result.model.images.size(), images.images().size(),
              outcome.result.model.points.size(), outcome.result.mean_reprojection_error_px);
}

}  // namespace
}  // namespace roomtex

int main(int argc, char** argv) {
  using namespace roomtex;
  Options options;
  Command command(
      "roomtex-mapper",
      "COLMAP's mapper, started from a pair that this command chooses and solves: right also "
      "before walls, where two photos alone have two solutions.",
      "roomtex-mapper --database_path database.db --image_path photos --output_path sparse");
  AddOptions(&options, &command);
  return command.Run(argc, argv, [&](const Command::Context& context) {
    try {
      MapPhotos(options, context);
    } catch (const Interrupted& interrupted) {
      DieBySignal(interrupted.signal);  // everything on the way is tidied up by now
    }
  });
}
