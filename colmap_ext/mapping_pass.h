#pragma once
// What is asked of a mapping, and what a group of photos, mapped with one way to see the lenses,
// has come to.

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "colmap_ext/database.h"
#include "colmap_ext/initializer.h"
#include "colmap_ext/known_placement.h"
#include "colmap_ext/lens_check.h"
#include "colmap_ext/lens_plan.h"
#include "colmap_ext/mapper_run.h"
#include "colmap_ext/matched_images.h"
#include "colmap_ext/model_check.h"
#include "colmap_ext/sparse_model.h"
#include "colmap_ext/two_view_hypotheses.h"
#include "colmap_ext/view_chaining.h"
#include "core/command_line.h"
#include "core/report.h"

namespace roomtex {

struct MappingOptions {
  std::string database_path, image_path, output_path;
  std::string known_path;  // model of photos with known poses; "" = none
  std::string colmap = "colmap";
  InitOptions init;
  MapperOptions mapper;
  ChainOptions chain;
  std::string refine_intrinsics = "auto";
  bool take_rooms_apart = true;  // that are alike
  bool map_all_groups = true;    // of photos that no pair connects
};

struct MappingOutcome {
  Seed seed;
  MapperResult result;
  std::map<uint32_t, ChainedView> chained;
  std::map<uint32_t, std::string> reasons;  // of photos that could not be chained, or were left out
  std::optional<KnownPlacement> known;      // with photos of known poses
  // Photos of other rooms that are alike, which matching had put into the same model: models of
  // their own, in frames of their own.
  std::vector<MapperResult> other_rooms;
  double share_within = 0, share_between = 0;  // LookalikeRooms, if there are others

  std::vector<const MapperResult*> Models() const;  // result, other_rooms
};

// A group of photos, mapped with one way to see the lenses.
struct MappingPass {
  MappingPass(LensPlan planned, bool refined) : plan(std::move(planned)), refine(refined) {}

  LensPlan plan;  // of all photos
  bool refine;
  bool can_set_lenses = true;             // of `plan`, in the copy of the database that COLMAP gets
  std::unique_ptr<MatchedImages> images;  // of the group, and the pairs between them
  std::unique_ptr<MapperRun> mapper;
  std::vector<MappingOutcome> best;  // at most one
  LensCheck lenses;                  // told and used: MappingLenses::Tell
  // Of the best model, and of its other rooms', once Mapping::Run() is done.
  ModelCheck check;
  std::vector<ModelCheck> room_checks;
  Json trials = Json::array();

  const SparseModel& model() const { return best[0].result.model; }
  size_t NumPhotos() const { return best.empty() ? 0 : model().images.size(); }
};

// As it is written: 0/, 1/ ...
struct MappedModel {
  const MappingPass* pass;
  const MapperResult* result;
  const ModelCheck* check;
  bool is_room;  // one of other_rooms

  // It shows one of several rooms that are alike.
  bool IsAlike() const { return !pass->best[0].other_rooms.empty(); }
};
// Of the passes one after the other, each with its other rooms behind it.
std::vector<MappedModel> ListModels(const std::vector<MappingPass>& passes);

// Of one way to look at a pair, in seeds, chains and checks.
HypothesisOptions HypothesisOptionsOf(const MappingOptions& options,
                                      const Command::Context& context);

// The matches as rays by the intrinsics of the model, which may have been refined.
MatchedImages ImagesOfModel(const Database& database, const MatchedImages& images,
                            const SparseModel& model);

}  // namespace roomtex
