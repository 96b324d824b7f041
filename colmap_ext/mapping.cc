#include "colmap_ext/mapping.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <utility>

#include <fmt/core.h>

#include "colmap_ext/expected_sightings.h"
#include "colmap_ext/lookalike_rooms.h"
#include "colmap_ext/mapping_report.h"
#include "colmap_ext/model_check.h"
#include "colmap_ext/photo_groups.h"
#include "core/error.h"
#include "core/output_file.h"
#include "core/text.h"

namespace roomtex {
namespace {

bool Better(const MapperResult& a, const MapperResult& b) {
  if (a.model.images.size() != b.model.images.size()) {
    return a.model.images.size() > b.model.images.size();
  }
  return a.model.points.size() > b.model.points.size();
}

// The matches as rays by the intrinsics of the model, which may have been refined.
MatchedImages ImagesOfModel(const Database& database, const MatchedImages& images,
                            const SparseModel& model) {
  std::map<uint32_t, Camera> cameras = images.cameras();
  for (const auto& [camera_id, camera] : model.cameras) cameras[camera_id] = camera;
  return MatchedImages(cameras, images.images(), images.pairs(),
                       [&database](uint32_t image_id) { return database.ReadKeypoints(image_id); });
}

HypothesisOptions HypothesisOptionsOf(const MappingOptions& options,
                                      const Command::Context& context) {
  HypothesisOptions pair;
  pair.keypoint_noise_px = options.init.keypoint_noise_px;
  pair.max_error_px = options.init.max_error_px;
  pair.random_seed = static_cast<uint64_t>(context.options.random_seed);
  return pair;
}

// Registers what the mapper left out.
void ChainLeftOut(const Database& database, const MatchedImages& images, MapperRun* mapper,
                  const MappingOptions& options, const Command::Context& context,
                  MappingOutcome* outcome) {
  MatchedImages model_images = ImagesOfModel(database, images, outcome->result.model);
  context.progress.Stage("chain photos");
  ViewChainer chainer(&model_images, options.chain, HypothesisOptionsOf(options, context),
                      context.options.num_threads);
  ChainResult chain = chainer.Run(std::move(outcome->result), [&](const SparseModel& poses) {
    ThrowIfInterrupted();
    return mapper->Adjust(poses);
  });
  outcome->result = std::move(chain.result);
  outcome->chained = std::move(chain.chained);
  outcome->reasons = std::move(chain.reasons);
}

std::string OutcomeSentence(const MapperResult& result) {
  if (!result.problem.empty()) return result.problem;
  return std::to_string(result.model.images.size()) + " photos registered" +
         (result.grew ? "" : ", all of them of the seed");
}

// Seeds one after the other until COLMAP makes something of one.
std::vector<MappingOutcome> TrySeeds(const Database& database, MatchedImages* images,
                                     MapperRun* mapper, const MappingOptions& options,
                                     const Command::Context& context, Json* trials) {
  const int num_images = static_cast<int>(images->images().size());
  std::vector<MappingOutcome> best;  // at most one
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
    MappingOutcome outcome;
    outcome.result = mapper->Run(*seed, num_images, [&] { context.progress.Tick(); });
    outcome.seed = std::move(*seed);
    const int num_mapped = static_cast<int>(outcome.result.model.images.size());
    if (options.chain.enabled && !outcome.result.folder.empty() && num_mapped < num_images) {
      ChainLeftOut(database, *images, mapper, options, context, &outcome);
    }
    trials->push_back(TrialJson(outcome.seed.trial, *images, OutcomeSentence(outcome.result)));
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

std::map<uint32_t, DatabaseImage> ImagesOf(std::map<uint32_t, DatabaseImage> images,
                                           const std::set<uint32_t>& photos) {
  for (auto at = images.begin(); at != images.end();) {
    at = photos.count(at->first) > 0 ? std::next(at) : images.erase(at);
  }
  return images;
}

std::vector<DatabasePair> PairsOf(const MatchedImages& images, const std::set<uint32_t>& photos) {
  std::vector<DatabasePair> pairs;
  for (const DatabasePair& pair : images.pairs()) {
    if (photos.count(pair.image_id1) > 0 && photos.count(pair.image_id2) > 0) pairs.push_back(pair);
  }
  return pairs;
}

KnownPhotos KnownOf(KnownPhotos known, const std::set<uint32_t>& photos) {
  for (auto at = known.cam_from_scan.begin(); at != known.cam_from_scan.end();) {
    at = photos.count(at->first) > 0 ? std::next(at) : known.cam_from_scan.erase(at);
  }
  return known;
}

// As a share; larger is no determination.
constexpr double kMaxFocalSigma = 0.03;

// A calibrated lens stays unless the photos know theirs so well, or are so sure that it is wrong:
// of one plane, or of a walk along a wall, they take a bent room for another lens.
constexpr double kMaxFocalSigmaOfCalibrated = 0.004;
constexpr double kSureDeviations = 15, kClearFocalDeviations = 5;  // LensFinding's
// Nor for a focal length that it has already and a little more distortion: a camera that turns on
// the spot leaves that open by more than it seems.
constexpr double kSameFocalDeviations = 2, kOtherLensDeviations = 40;

constexpr int kMaxMoreMappings = 2;

// Photos that the others contradict are left out up to this share of all; of more, nobody knows
// which are right.
constexpr double kMaxLeftOut = 0.2;
constexpr int kMaxLeavings = 2;

bool IsDetermined(const LensCheck& check) {
  return std::all_of(check.lenses.begin(), check.lenses.end(), [](const LensFinding& lens) {
    return lens.focal_sigma < kMaxFocalSigma * lens.found.MeanFocalLength();
  });
}

// Of some photos of a model, without points.
SparseModel PosesOf(const SparseModel& model, const std::set<uint32_t>& photos) {
  SparseModel poses;
  poses.cameras = model.cameras;
  for (const uint32_t id : photos) {
    const SparseImage& image = model.images.at(id);
    poses.images[id] = {id, image.camera_id, image.name, image.cam_from_model, {}, {}};
  }
  return poses;
}

size_t NumPhotos(const MappingPass& pass) {
  return pass.best.empty() ? 0 : pass.model().images.size();
}

// From which version on COLMAP knows a camera model (major * 100 + minor).
int FirstVersionWith(CameraModel model) {
  if (model <= CameraModel::kThinPrismFisheye) return 0;
  return model == CameraModel::kRadTanThinPrismFisheye ? 311 : 400;
}

// COLMAP aborts where it meets the number of a camera model that it does not know.
void RequireKnownCameraModels(const ColmapProgram& colmap, const LensPlan& plan,
                              const std::string& database_path) {
  const int version = colmap.VersionNumber();
  for (const auto& [id, image] : plan.images()) {
    const CameraModel model = plan.cameras().at(image.camera_id).model;
    const int first = FirstVersionWith(model);
    if (version == 0 || version >= first) continue;
    throw InputError(
        database_path, "camera " + std::to_string(image.camera_id),
        fmt::format("is {}, which COLMAP {}.{} does not know", CameraModelName(model),
                    version / 100, version % 100),
        fmt::format("Name COLMAP {}.{} or newer by --colmap, or extract the features with another "
                    "--ImageReader.camera_model",
                    first / 100, first % 100));
  }
}

}  // namespace

std::vector<const MapperResult*> MappingOutcome::Models() const {
  std::vector<const MapperResult*> models = {&result};
  for (const MapperResult& room : other_rooms) models.push_back(&room);
  return models;
}

std::vector<MappedModel> ListModels(const std::vector<MappingPass>& passes) {
  std::vector<MappedModel> models;
  for (const MappingPass& pass : passes) {
    const std::vector<const MapperResult*> of_pass = pass.best[0].Models();
    for (size_t i = 0; i < of_pass.size(); ++i) {
      models.push_back({&pass, of_pass[i], i == 0 ? &pass.check : &pass.room_checks[i - 1], i > 0});
    }
  }
  return models;
}

std::vector<std::set<uint32_t>> PhotoGroups(const MatchedImages& images,
                                            const MappingOptions& options) {
  std::set<uint32_t> all;
  for (const auto& [id, image] : images.images()) all.insert(id);
  std::vector<std::set<uint32_t>> groups;
  if (options.map_all_groups) groups = ConnectedPhotos(images, all, kFewestOfModel);
  if (groups.size() < 2) groups = {all};
  return groups;
}

Mapping::Mapping(const MappingOptions& options, const Command::Context& context,
                 const Database& database, const MatchedImages& images, const KnownPhotos& known,
                 const ScratchFolder& scratch)
    : options_(options),
      context_(context),
      database_(database),
      images_(images),
      known_(known),
      scratch_(scratch),
      refine_(RefineIntrinsicsFromWord(options.refine_intrinsics)),
      colmap_(options.colmap, options.output_path + "/roomtex-mapper.log") {
  for (const auto& [id, image] : images.images()) names_[id] = image.name;
  labels_ = ReadLensLabels(names_, options.image_path);
}

LensPlan Mapping::PlanLenses() const {
  LensPlan plan = refine_ == RefineIntrinsics::kNever
                      ? LensPlan(images_.cameras(), images_.images())
                      : LensPlan(images_.cameras(), images_.images(), labels_);
  TellCameras(known_, &plan);
  return plan;
}

bool Mapping::IsCalibrated(const LensPlan& plan) const {
  return std::all_of(photos_.begin(), photos_.end(), [&](uint32_t id) {
    return plan.cameras().at(plan.images().at(id).camera_id).has_prior_focal_length;
  });
}

std::map<uint32_t, Camera> Mapping::CalibratedAsTold(const LensPlan& plan) const {
  std::map<uint32_t, Camera> calibrated;
  if (refine_ != RefineIntrinsics::kAuto) return calibrated;
  for (const auto& [id, camera] : plan.cameras()) {
    const auto told = plan_->cameras().find(id);
    const bool is_as_told = told != plan_->cameras().end() && told->second.model == camera.model &&
                            told->second.params == camera.params;
    if (camera.has_prior_focal_length && is_as_told) calibrated.emplace(id, camera);
  }
  return calibrated;
}

MappingPass Mapping::MapAsLensesAre() {
  if (!plan_) {
    plan_ = PlanLenses();
    told_ = plan_;
    for (const std::string& note : plan_->notes()) context_.Warn(note);
    RequireKnownCameraModels(colmap_, *plan_, options_.database_path);
  }
  LensPlan plan = *plan_;
  const bool calibrated = IsCalibrated(plan);
  const bool automatic = refine_ == RefineIntrinsics::kAuto;
  MappingPass best = Map(plan, refine_ == RefineIntrinsics::kAlways || (automatic && !calibrated));
  if (best.best.empty() || refine_ == RefineIntrinsics::kNever) return best;
  if (automatic && best.refine && !IsDetermined(best.lenses)) {
    MappingPass as_told = Map(plan, false);
    const bool loses = NumPhotos(as_told) < NumPhotos(best);
    context_.Warn(std::string("the photos do not determine the focal length") +
                  (loses ? ", but with that of the database fewer of them can be mapped: it is "
                           "what they made of it"
                         : ": it stays as the database has it"));
    return loses ? std::move(best) : std::move(as_told);
  }
  KeepCalibrated(&best);
  return automatic ? MapWithLensesFound(std::move(plan), std::move(best)) : std::move(best);
}

MappingPass Mapping::MapWithLensesFound(LensPlan plan, MappingPass best) {
  for (int i = 0; i < kMaxMoreMappings && IsContradicted(best); ++i) {
    const std::vector<LensFinding> taken = plan.Take(best.lenses, best.model());
    MappingPass again = Map(plan, true);
    const size_t num_before = NumPhotos(best), num_after = NumPhotos(again);
    // Of a bent room photos may have found a place that a straight one has not.
    const bool is_better =
        static_cast<double>(num_after) >= (1 - kMaxLeftOut) * static_cast<double>(num_before);
    for (LensFinding lens : taken) {
      lens.used = is_better;
      context_.Warn(
          lens.Sentence() +
          (num_after < num_before
               ? fmt::format(" With the lens found {} photos can be mapped, {} with that told.",
                             num_after, num_before)
               : "") +
          (best.refine || !is_better ? "" : " --refine_intrinsics 0 keeps what was told."));
    }
    if (!is_better) break;
    best = std::move(again);
    KeepCalibrated(&best);
  }
  return best;
}

void Mapping::TellLenses(MappingPass* pass) const {
  const LensPlan told =
      pass->can_set_lenses ? *told_ : LensPlan(images_.cameras(), images_.images());
  const SparseModel& model = pass->model();
  for (LensFinding& lens : pass->lenses.lenses) {
    // By whether they are calibrated: what COLMAP guessed counts where nothing else was told.
    std::map<bool, std::map<uint32_t, Camera>> told_cameras;
    std::map<bool, bool> is_another;
    for (const std::string& name : lens.photos) {
      const SparseImage& image = *model.FindImage(name);
      const Camera& camera = told.cameras().at(told.images().at(image.image_id).camera_id);
      const Camera& now = model.cameras.at(image.camera_id);
      const bool is_calibrated = camera.has_prior_focal_length;
      is_another[is_calibrated] |= now.model != camera.model || now.params != camera.params;
      told_cameras[is_calibrated].emplace(camera.camera_id, camera);
    }
    const bool any_calibrated = told_cameras.count(true) > 0;
    std::vector<Camera> cameras;
    for (const auto& [id, camera] : told_cameras[any_calibrated]) cameras.push_back(camera);
    lens.used = is_another[any_calibrated];
    lens.Tell(cameras);
  }
}

void Mapping::KeepCamerasOfRigs(LensCheck* check) const {
  bool any = false;
  for (LensFinding& lens : check->lenses) {
    any = any || lens.used;
    lens.used = false;
  }
  context_.Warn(
      std::string("The database holds rigs of several cameras: photos are mapped with its cameras, "
                  "not with the lenses that they were told or share by EXIF") +
      (any ? ", though the photos contradict them." : "."));
}

void Mapping::KeepCalibrated(MappingPass* pass) const {
  for (LensFinding& lens : pass->lenses.lenses) {
    const Camera& told = pass->plan.cameras().at(lens.camera_ids[0]);
    if (refine_ != RefineIntrinsics::kAuto || !lens.used || lens.apart) continue;
    if (!told.has_prior_focal_length) continue;
    const double sigma = lens.focal_sigma / told.MeanFocalLength();
    const bool vague = sigma >= kMaxFocalSigmaOfCalibrated && lens.deviations <= kSureDeviations &&
                       lens.FocalDeviations() < kClearFocalDeviations;
    const bool same =
        lens.FocalDeviations() < kSameFocalDeviations && lens.deviations < kOtherLensDeviations;
    if (!vague && !same) continue;
    lens.used = false;
    context_.Warn(fmt::format(
        "The photos would have a focal length of {:.1f} pixels instead of {:.1f}, but know it to "
        "{:.1f} % only: the calibrated lens stays.",
        lens.found.MeanFocalLength(), told.MeanFocalLength(), 100 * sigma));
  }
}

bool Mapping::IsContradicted(const MappingPass& pass) const {
  bool contradicted = false;
  const bool determined = IsDetermined(pass.lenses);
  for (LensFinding lens : pass.lenses.lenses) {
    if (pass.lenses.only_looked_at && lens.Contradicts()) {
      context_.Warn(lens.Sentence() + " It is for roomtex-align, which has the scan, to mend it.");
    }
    if (!lens.used) continue;
    contradicted = true;
    if (determined) continue;
    lens.used = false;
    context_.Warn(lens.Sentence() +
                  fmt::format(" The photos leave focal lengths open by more than {:.0f} %.",
                              100 * kMaxFocalSigma));
  }
  return contradicted && determined;
}

InitOptions Mapping::InitOfGroup(const MatchedImages& images) const {
  InitOptions init = options_.init;
  for (const std::string* name : {&options_.init.image_name1, &options_.init.image_name2}) {
    if (!name->empty() && images.FindImage(*name) == nullptr) {
      init.image_name1.clear();
      init.image_name2.clear();
    }
  }
  return init;
}

MappingPass Mapping::Map(const LensPlan& plan, bool refine) {
  const int number = ++num_passes_;
  const std::string database_copy = scratch_ / ("database_" + std::to_string(number) + ".db");
  const int version = colmap_.VersionNumber();
  database_.CopyForMapper(database_copy, version > 0 && version < 310 ? Database::Schema::kColmap39
                                                                      : Database::Schema::kAsIs);
  if (photos_.size() < names_.size()) Database::KeepPairsBetween(database_copy, photos_);
  const bool as_planned =
      plan.IsAsInDatabase() || Database::SetCameras(database_copy, plan.cameras(), plan.images());
  MappingPass pass(as_planned ? plan : LensPlan(images_.cameras(), images_.images()), refine);
  pass.can_set_lenses = as_planned;
  pass.images = std::make_unique<MatchedImages>(
      pass.plan.cameras(), ImagesOf(pass.plan.images(), photos_), PairsOf(images_, photos_),
      [this](uint32_t image_id) { return database_.ReadKeypoints(image_id); });
  const std::string folder = scratch_ / ("pass_" + std::to_string(number));
  MakeFolder(folder);
  mapper_options_ = options_.mapper;
  mapper_options_.refine_intrinsics = refine;
  mapper_options_.held_cameras = as_planned ? CalibratedAsTold(plan) : std::map<uint32_t, Camera>();
  mapper_options_.num_threads = context_.options.num_threads;
  mapper_options_.random_seed = context_.options.random_seed;
  pass.mapper = std::make_unique<MapperRun>(&colmap_, database_copy, options_.image_path, folder,
                                            mapper_options_);
  context_.progress.Stage("initialise");
  MappingOptions of_group = options_;
  of_group.init = InitOfGroup(*pass.images);
  pass.best =
      TrySeeds(database_, pass.images.get(), pass.mapper.get(), of_group, context_, &pass.trials);
  if (!pass.best.empty()) {
    context_.progress.Stage("check lenses");
    pass.lenses = CheckLenses(pass.model(), labels_, RefineIntrinsics::kAuto);
    if (!as_planned) KeepCamerasOfRigs(&pass.lenses);
  }
  return pass;
}

std::vector<MappingPass> Mapping::Run() {
  std::vector<std::set<uint32_t>> groups = PhotoGroups(images_, options_);
  std::vector<MappingPass> passes;
  for (size_t next = 0; next < groups.size(); ++next) {  // grows
    photos_ = groups[next];
    if (next > 0) {
      context_.progress.Note(fmt::format("another group: {} photos, e.g. {}", photos_.size(),
                                         names_.at(*photos_.begin())));
    }
    MappingPass pass = MapGroup();
    for (const Json& trial : pass.trials) trials_.push_back(trial);
    if (pass.best.empty()) continue;
    if (!passes.empty() && pass.model().images.size() < kFewestOfModel) continue;
    LearnLenses(pass);
    if (options_.map_all_groups) {
      std::set<uint32_t> rest = photos_;
      for (const MapperResult* result : pass.best[0].Models()) {
        for (const auto& [id, image] : result->model.images) rest.erase(id);
      }
      for (auto& group : ConnectedPhotos(images_, rest, kFewestOfModel)) {
        groups.push_back(std::move(group));
      }
    }
    passes.push_back(std::move(pass));
  }
  // The first was kept whatever it has, for it might have been the only one.
  const bool any_better = std::any_of(passes.begin(), passes.end(), [](const MappingPass& pass) {
    return pass.model().images.size() >= kFewestOfModel;
  });
  if (any_better && passes[0].model().images.size() < kFewestOfModel) passes.erase(passes.begin());
  const auto rank = [&](const MappingPass& pass) {
    size_t num_known = 0;
    for (const auto& [id, image] : pass.model().images) num_known += known_.cam_from_scan.count(id);
    return std::make_pair(num_known, pass.model().images.size());
  };
  std::stable_sort(passes.begin(), passes.end(),
                   [&](const auto& a, const auto& b) { return rank(a) > rank(b); });
  return passes;
}

void Mapping::LearnLenses(const MappingPass& pass) {
  plan_ = pass.plan;
  const bool knows = pass.can_set_lenses && pass.refine && !pass.lenses.lenses.empty() &&
                     IsDetermined(pass.lenses);
  if (knows) plan_->Calibrate(pass.model());
}

MappingPass Mapping::MapGroup() {
  MappingPass pass = MapAsLensesAre();
  if (pass.best.empty()) return pass;
  TellLenses(&pass);
  context_.progress.Stage("check model");
  pass.check = Check(pass, pass.model());
  for (int i = 0; i < kMaxLeavings && LeaveOutDoubtful(&pass); ++i) {
    pass.check = Check(pass, pass.model());
  }
  if (options_.take_rooms_apart && TakeRoomsApart(&pass)) {
    pass.check = Check(pass, pass.model());
    for (const MapperResult& room : pass.best[0].other_rooms) {
      pass.room_checks.push_back(Check(pass, room.model));
    }
  }
  const KnownPhotos known = KnownOf(known_, photos_);
  if (!known.cam_from_scan.empty()) {
    context_.progress.Stage("known poses");
    MappingOutcome& outcome = pass.best[0];
    outcome.known = PlaceByKnownPhotos(known, pass.plan.images(), pass.plan.cameras(),
                                       scratch_ / ("known_" + std::to_string(num_passes_)),
                                       pass.mapper.get(), &outcome.result);
  }
  SayWhatWasNotHeld(pass);
  return pass;
}

void Mapping::SayWhatWasNotHeld(const MappingPass& pass) const {
  const std::vector<const MapperResult*> models = pass.best[0].Models();
  if (std::none_of(models.begin(), models.end(),
                   [](const auto* one) { return one->could_not_hold; })) {
    return;
  }
  std::string list;
  for (const auto& [id, camera] : CalibratedAsTold(pass.plan)) {
    if (pass.model().cameras.count(id) == 0) continue;
    list += (list.empty() ? "" : ", ") + std::to_string(id);
  }
  context_.Warn("Calibrated cameras (" + list +
                ") could not be held beside those that are refined: the model has them as COLMAP "
                "refined them. Map the photos of calibrated cameras by themselves, or give "
                "--refine_intrinsics 0, which keeps all as told.");
}

ModelCheck Mapping::Check(const MappingPass& pass, const SparseModel& model) const {
  MatchedImages images = ImagesOfModel(database_, *pass.images, model);
  ModelCheckOptions check_options;
  check_options.pair = HypothesisOptionsOf(options_, context_);
  check_options.min_confidence = options_.init.min_confidence;
  const PairTrial& trial = pass.best[0].seed.trial;
  return CheckModel(&images, model, {trial.image_id1, trial.image_id2}, check_options,
                    context_.options.num_threads);
}

bool Mapping::TakeRoomsApart(MappingPass* pass) const {
  context_.progress.Stage("look for rooms");
  MappingOutcome& outcome = pass->best[0];
  const SparseModel& model = outcome.result.model;
  LookalikeRooms found =
      FindLookalikeRooms(model, FindExpectedSightings(model, HiddenByOwnPoints(model), {}));
  std::vector<std::set<uint32_t>>& rooms = found.rooms;
  if (rooms.size() < 2) return false;
  const auto num_known = [&](const std::set<uint32_t>& room) {
    return std::count_if(room.begin(), room.end(),
                         [&](uint32_t id) { return known_.cam_from_scan.count(id) > 0; });
  };
  std::stable_sort(rooms.begin(), rooms.end(),
                   [&](const auto& a, const auto& b) { return num_known(a) > num_known(b); });
  std::vector<MapperResult> results;
  for (const std::set<uint32_t>& room : rooms) {
    MapperResult result = pass->mapper->Adjust(PosesOf(model, room));
    // Rather one model of two rooms, which roomtex-align can refuse, than none.
    if (!result.problem.empty() || result.model.images.size() != room.size()) return false;
    result.grew = outcome.result.grew;
    results.push_back(std::move(result));
  }
  context_.Warn(fmt::format(
      "The photos show {} rooms that are alike, or a room before and after much was moved: of what "
      "those of one show ({} of what they ought to), those of another show {}. Each has a model of "
      "its own: one holds {} photos, e.g. {}, another {}, e.g. {}. --Rooms.enabled 0 leaves them "
      "together.",
      rooms.size(), Percent(found.share_within), Percent(found.share_between), rooms[0].size(),
      names_.at(*rooms[0].begin()), rooms[1].size(), names_.at(*rooms[1].begin())));
  outcome.result = std::move(results[0]);
  outcome.other_rooms.assign(std::make_move_iterator(results.begin() + 1),
                             std::make_move_iterator(results.end()));
  outcome.share_within = found.share_within;
  outcome.share_between = found.share_between;
  return true;
}

bool Mapping::LeaveOutDoubtful(MappingPass* pass) const {
  MappingOutcome& outcome = pass->best[0];
  const ModelCheck& check = pass->check;
  const auto num_photos = static_cast<double>(pass->model().images.size());
  if (check.doubtful.empty() ||
      static_cast<double>(check.doubtful.size()) > kMaxLeftOut * num_photos) {
    return false;
  }
  std::set<uint32_t> kept;
  for (const auto& [id, image] : pass->model().images) kept.insert(id);
  for (const uint32_t image_id : check.doubtful) kept.erase(image_id);
  const SparseModel poses = PosesOf(pass->model(), kept);
  MapperResult adjusted = pass->mapper->Adjust(poses);
  if (!adjusted.problem.empty() || adjusted.model.images.size() != poses.images.size()) {
    return false;
  }
  adjusted.grew = outcome.result.grew;
  outcome.result = std::move(adjusted);
  for (const uint32_t image_id : check.doubtful) {
    const std::string share = Percent(check.support.at(image_id));
    outcome.reasons[image_id] = "stood where only " + share + " of its own matches put it";
    context_.Warn(names_.at(image_id) + " is left out: only " + share +
                  " of its own matches obey the model. It may show a repeated pattern, another "
                  "room, or something that moved.");
  }
  return true;
}

}  // namespace roomtex
