#pragma once
// Photos that do not belong into a model: doubtful ones are left out, those of rooms that are alike
// get models of their own.

#include "colmap_ext/database.h"
#include "colmap_ext/known_photos.h"
#include "colmap_ext/mapping_pass.h"
#include "core/command_line.h"

namespace roomtex {

// Of the best model of a pass, whose checks this fills. Photos that stand where most of their own
// matches do not put them are left out, if they are few; of rooms that are alike those with known
// photos come first.
void PartMisplacedPhotos(const MappingOptions& options, const Command::Context& context,
                         const Database& database, const KnownPhotos& known, MappingPass* pass);

}  // namespace roomtex
