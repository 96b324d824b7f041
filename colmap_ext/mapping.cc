#include "colmap_ext/mapping.h"

#include <algorithm>
#include <iterator>
#include <memory>
#include <utility>

#include <fmt/core.h>

#include "colmap_ext/known_placement.h"
#include "colmap_ext/misplaced_photos.h"
#include "colmap_ext/photo_groups.h"
#include "colmap_ext/seed_trials.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

constexpr int kMaxMoreMappings = 2;
// A mapping with other lenses may lose so many of the photos: as a share.
constexpr double kMaxLost = 0.2;

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

}  // namespace

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
      colmap_(options.colmap, options.output_path + "/roomtex-mapper.log"),
      lenses_(options, context, colmap_, images, known) {
  for (const auto& [id, image] : images.images()) names_[id] = image.name;
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
    lenses_.Learn(pass);
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

MappingPass Mapping::MapGroup() {
  MappingPass pass = MapWithLenses();
  if (pass.best.empty()) return pass;
  lenses_.Tell(&pass);
  context_.progress.Stage("check model");
  PartMisplacedPhotos(options_, context_, database_, known_, &pass);
  const KnownPhotos known = KnownOf(known_, photos_);
  if (!known.cam_from_scan.empty()) {
    context_.progress.Stage("known poses");
    MappingOutcome& outcome = pass.best[0];
    outcome.known = PlaceByKnownPhotos(known, pass.plan.images(), pass.plan.cameras(),
                                       scratch_ / ("known_" + std::to_string(num_passes_)),
                                       pass.mapper.get(), &outcome.result);
  }
  lenses_.SayWhatWasNotHeld(pass);
  return pass;
}

MappingPass Mapping::MapWithLenses() {
  const LensPlan plan = lenses_.plan();
  const RefineIntrinsics refine = lenses_.refine();
  const bool calibrated = lenses_.AreCalibrated(photos_);
  const bool automatic = refine == RefineIntrinsics::kAuto;
  MappingPass best = Map(plan, refine == RefineIntrinsics::kAlways || (automatic && !calibrated));
  if (best.best.empty() || refine == RefineIntrinsics::kNever) return best;
  if (automatic && best.refine && !AreDetermined(best.lenses)) {
    MappingPass as_told = Map(plan, false);
    const bool loses = as_told.NumPhotos() < best.NumPhotos();
    context_.Warn(std::string("the photos do not determine the focal length") +
                  (loses ? ", but with that of the database fewer of them can be mapped: it is "
                           "what they made of it"
                         : ": it stays as the database has it"));
    return loses ? std::move(best) : std::move(as_told);
  }
  lenses_.KeepCalibrated(&best);
  return automatic ? MapWithLensesFound(plan, std::move(best)) : std::move(best);
}

MappingPass Mapping::MapWithLensesFound(LensPlan plan, MappingPass best) {
  for (int i = 0; i < kMaxMoreMappings && lenses_.AreContradicted(best); ++i) {
    const std::vector<LensFinding> taken = plan.Take(best.lenses, best.model());
    MappingPass again = Map(plan, true);
    const size_t num_before = best.NumPhotos(), num_after = again.NumPhotos();
    // Of a bent room photos may have found a place that a straight one has not.
    const bool is_better =
        static_cast<double>(num_after) >= (1 - kMaxLost) * static_cast<double>(num_before);
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
    lenses_.KeepCalibrated(&best);
  }
  return best;
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
  MappingPass pass(as_planned ? plan : lenses_.AsInDatabase(), refine);
  pass.can_set_lenses = as_planned;
  pass.images = std::make_unique<MatchedImages>(
      pass.plan.cameras(), ImagesOf(pass.plan.images(), photos_), PairsOf(images_, photos_),
      [this](uint32_t image_id) { return database_.ReadKeypoints(image_id); });
  const std::string folder = scratch_ / ("pass_" + std::to_string(number));
  MakeFolder(folder);
  mapper_options_ = options_.mapper;
  mapper_options_.refine_intrinsics = refine;
  mapper_options_.held_cameras = as_planned ? lenses_.Held(plan) : std::map<uint32_t, Camera>();
  mapper_options_.num_threads = context_.options.num_threads;
  mapper_options_.random_seed = context_.options.random_seed;
  pass.mapper = std::make_unique<MapperRun>(&colmap_, database_copy, options_.image_path, folder,
                                            mapper_options_);
  context_.progress.Stage("initialise");
  pass.best = TrySeeds(database_, pass.images.get(), pass.mapper.get(), options_,
                       InitOfGroup(*pass.images), context_, &pass.trials);
  if (!pass.best.empty()) {
    context_.progress.Stage("check lenses");
    pass.lenses = lenses_.Check(pass);
  }
  return pass;
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

}  // namespace roomtex
