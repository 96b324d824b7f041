#pragma once
// The photos of a database mapped: seeds tried one after the other, what COLMAP leaves out chained,
// and all of it once more where the photos know their lenses better than the database.

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
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

struct MappingOptions {
  std::string database_path, image_path, output_path;
  std::string known_path;  // model of photos with known poses; "" = none
  std::string colmap = "colmap";
  InitOptions init;
  MapperOptions mapper;
  ChainOptions chain;
  std::string refine_intrinsics = "auto";
  bool take_rooms_apart = true;  // that are alike
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
};

// The photos of one way to see the lenses, mapped.
struct MappingPass {
  MappingPass(LensPlan planned, bool refined) : plan(std::move(planned)), refine(refined) {}

  LensPlan plan;
  bool refine;
  std::unique_ptr<MatchedImages> images;
  std::unique_ptr<MapperRun> mapper;
  std::vector<MappingOutcome> best;  // at most one
  LensCheck lenses;
  // Of the best model, and of its other rooms', once Mapping::Run() is done.
  ModelCheck check;
  std::vector<ModelCheck> room_checks;
  Json trials = Json::array();

  const SparseModel& model() const { return best[0].result.model; }
};

class Mapping {
 public:
  // All must outlive it. images: of the database, with its cameras. known: may hold nothing.
  Mapping(const MappingOptions& options, const Command::Context& context, const Database& database,
          const MatchedImages& images, const KnownPhotos& known, const ScratchFolder& scratch);

  // With the lenses as the database has them (those of known photos as told with their poses), and,
  // if the photos know better, once more. Photos that stand where most of their own matches do not
  // put them are left out, if they are few; rooms that are alike get models of their own. Known
  // photos then put the model where they stand.
  MappingPass Run();

 private:
  void KeepCalibrated(MappingPass* pass) const;
  // And says so.
  bool IsContradicted(const MappingPass& pass) const;
  MappingPass Map(const LensPlan& plan, bool refine);
  MappingPass MapAsLensesAre();
  LensPlan PlanLenses() const;
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
  int num_passes_ = 0;
};

}  // namespace roomtex
