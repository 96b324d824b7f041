#pragma once
// What speaks against the models that were mapped, as roomtex-align goes by it (mapper_verdict.h).

#include <vector>

#include "colmap_ext/known_photos.h"
#include "colmap_ext/mapping_pass.h"
#include "core/command_line.h"
#include "core/report.h"

namespace roomtex {

// Of one of the models: `check` (with `calibration`), `known` where its photos hold some, and
// `reasons` [{about, reason}].
struct ModelTrust {
  Json check, known;
  Json reasons = Json::array();
};

// Of every model, in the order of ListModels(). images: all of the database. refine: as asked for.
// Says on the way what is worth a warning. Adjusts every model twice, by COLMAP, to see whether its
// lens fits; the other rooms of a model have that of the first.
std::vector<ModelTrust> JudgeModels(const std::vector<MappingPass>& passes,
                                    const MatchedImages& images, const KnownPhotos& known,
                                    RefineIntrinsics refine, const Command::Context& context);

}  // namespace roomtex
