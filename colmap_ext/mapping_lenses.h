#pragma once
// The lenses that the photos of a database are mapped with, group after group: as they are told, or
// as photos have found them; and which stay, whatever photos say.

#include <cstdint>
#include <map>
#include <set>

#include "colmap_ext/known_photos.h"
#include "colmap_ext/lens_check.h"
#include "colmap_ext/lens_labels.h"
#include "colmap_ext/lens_plan.h"
#include "colmap_ext/mapping_pass.h"
#include "core/colmap_program.h"
#include "core/command_line.h"

namespace roomtex {

// The photos know the focal lengths of all their lenses.
bool AreDetermined(const LensCheck& check);

class MappingLenses {
 public:
  // As the database has them, those of known photos as told with their poses. Says which are
  // several. All must outlive it but colmap. Throws InputError for a camera model that this COLMAP
  // does not know.
  MappingLenses(const MappingOptions& options, const Command::Context& context,
                const ColmapProgram& colmap, const MatchedImages& images, const KnownPhotos& known);

  RefineIntrinsics refine() const { return refine_; }
  const LensPlan& plan() const { return plan_; }  // as far as it is known
  LensPlan AsInDatabase() const;
  // In the plan.
  bool AreCalibrated(const std::set<uint32_t>& photos) const;
  // Lenses that a pass with others to be refined holds, by camera_id: --refine_intrinsics auto.
  std::map<uint32_t, Camera> Held(const LensPlan& plan) const;

  // What the photos of a pass say of theirs. Of a database whose rigs tie its cameras together none
  // is used.
  LensCheck Check(const MappingPass& pass) const;
  // Lenses that are calibrated, and that the photos hardly know better, stay.
  void KeepCalibrated(MappingPass* pass) const;
  // By photos that know it better. Says what they say of lenses that stay all the same.
  bool AreContradicted(const MappingPass& pass) const;
  // A lens that a group's photos have determined is a calibrated one for the next.
  void Learn(const MappingPass& pass);

  // Makes of the findings what the report says: of the lenses that the database tells, not of those
  // that this pass was told.
  void Tell(MappingPass* pass) const;
  // Warns of calibrated lenses that COLMAP has refined all the same.
  void SayWhatWasNotHeld(const MappingPass& pass) const;

 private:
  const Command::Context& context_;
  const MatchedImages& images_;
  RefineIntrinsics refine_;
  LensLabels labels_;
  LensPlan told_, plan_;
};

}  // namespace roomtex
