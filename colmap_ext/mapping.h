#pragma once
// The photos of a database mapped: seeds tried one after the other, what COLMAP leaves out chained,
// and all of it once more where the photos know their lenses better than the database. Groups of
// photos that no pair connects get models of their own.

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "colmap_ext/known_placement.h"
#include "colmap_ext/lens_check.h"
#include "colmap_ext/lens_labels.h"
#include "colmap_ext/lens_plan.h"
#include "colmap_ext/mapper_run.h"
#include "colmap_ext/model_check.h"
#include "colmap_ext/model_output.h"
#include "colmap_ext/view_chaining.h"
#include "core/command_line.h"

namespace roomtex {

// Rooms and groups of fewer photos get no model of their own.
inline constexpr size_t kFewestOfModel = 4;

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
  LensCheck lenses;                  // told and used: Mapping::TellLenses
  // Of the best model, and of its other rooms', once Mapping::Run() is done.
  ModelCheck check;
  std::vector<ModelCheck> room_checks;
  Json trials = Json::array();

  const SparseModel& model() const { return best[0].result.model; }
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

// What is mapped one after the other: groups of photos that pairs connect, if there are several of
// kFewestOfModel and more; else, or if only one model is wanted, all photos.
std::vector<std::set<uint32_t>> PhotoGroups(const MatchedImages& images,
                                            const MappingOptions& options);

class Mapping {
 public:
  // All must outlive it. images: of the database, with its cameras. known: may hold nothing.
  Mapping(const MappingOptions& options, const Command::Context& context, const Database& database,
          const MatchedImages& images, const KnownPhotos& known, const ScratchFolder& scratch);

  // Every group that gives a model, with the most known photos first, then with the most photos.
  // What COLMAP could not reach from where it started in a group is another group.
  std::vector<MappingPass> Run();
  // One of `pair_trials` for each pair that was started from, of all groups.
  const Json& trials() const { return trials_; }

 private:
  // With the lenses as the database has them (those of known photos as told with their poses), and,
  // if the photos know better, once more. Photos that stand where most of their own matches do not
  // put them are left out, if they are few; rooms that are alike get models of their own. Known
  // photos then put the model where they stand.
  MappingPass MapGroup();
  // A lens that a group's photos have determined is a calibrated one for the next.
  void LearnLenses(const MappingPass& pass);
  // Of a database whose rigs tie its cameras together.
  void KeepCamerasOfRigs(LensCheck* check) const;
  void KeepCalibrated(MappingPass* pass) const;
  // By photos that know it better. Says what they say of lenses that stay all the same.
  bool IsContradicted(const MappingPass& pass) const;
  // Once more with the lenses that contradict the plan's, if they are, and says which are used.
  MappingPass MapWithLensesFound(LensPlan plan, MappingPass best);
  // Makes of the findings what the report says: of the lenses that the database tells, not of those
  // that this pass was told.
  void TellLenses(MappingPass* pass) const;
  void SayWhatWasNotHeld(const MappingPass& pass) const;
  MappingPass Map(const LensPlan& plan, bool refine);
  MappingPass MapAsLensesAre();
  LensPlan PlanLenses() const;
  bool IsCalibrated(const LensPlan& plan) const;
  // Lenses that a pass with others to be refined holds, by camera_id: --refine_intrinsics auto.
  std::map<uint32_t, Camera> CalibratedAsTold(const LensPlan& plan) const;
  // Photos to start from that are told are those of their own group.
  InitOptions InitOfGroup(const MatchedImages& images) const;
  // False: nothing was to be left out, or could be.
  bool LeaveOutDoubtful(MappingPass* pass) const;
  // True: there were several, and the model is that of one.
  bool TakeRoomsApart(MappingPass* pass) const;
  ModelCheck Check(const MappingPass& pass, const SparseModel& model) const;

  const MappingOptions& options_;
  const Command::Context& context_;
  const Database& database_;
  const MatchedImages& images_;
  const KnownPhotos& known_;
  const ScratchFolder& scratch_;
  const RefineIntrinsics refine_;
  ColmapProgram colmap_;
  MapperOptions mapper_options_;
  std::map<uint32_t, std::string> names_;
  LensLabels labels_;
  std::optional<LensPlan> plan_;  // as far as it is known
  std::optional<LensPlan> told_;  // what plan_ was at first
  std::set<uint32_t> photos_;     // of the group that is mapped
  int num_passes_ = 0;
  Json trials_ = Json::array();
};

}  // namespace roomtex
