#pragma once
// The photos of a database mapped: seeds tried one after the other, what COLMAP leaves out chained,
// and all of it once more where the photos know their lenses better than the database. Groups of
// photos that no pair connects get models of their own.

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "colmap_ext/known_photos.h"
#include "colmap_ext/mapping_lenses.h"
#include "colmap_ext/mapping_pass.h"
#include "colmap_ext/model_output.h"
#include "core/colmap_program.h"
#include "core/command_line.h"

namespace roomtex {

// Rooms and groups of fewer photos get no model of their own.
inline constexpr size_t kFewestOfModel = 4;

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
  // Its photos mapped, those that do not belong there set apart, and put where known photos stand.
  MappingPass MapGroup();
  // With the lenses as they are told, and, if the photos know better, once more.
  MappingPass MapWithLenses();
  // Once more with the lenses that contradict the plan's, if they are, and says which are used.
  MappingPass MapWithLensesFound(LensPlan plan, MappingPass best);
  MappingPass Map(const LensPlan& plan, bool refine);
  // Photos to start from that are told are those of their own group.
  InitOptions InitOfGroup(const MatchedImages& images) const;

  const MappingOptions& options_;
  const Command::Context& context_;
  const Database& database_;
  const MatchedImages& images_;
  const KnownPhotos& known_;
  const ScratchFolder& scratch_;
  ColmapProgram colmap_;
  MappingLenses lenses_;
  MapperOptions mapper_options_;
  std::map<uint32_t, std::string> names_;
  std::set<uint32_t> photos_;  // of the group that is mapped
  int num_passes_ = 0;
  Json trials_ = Json::array();
};

}  // namespace roomtex
