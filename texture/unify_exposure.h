#pragma once
// From what the photos say of the samples to one exposure for all of them (thesis 8.2.1).

#include <vector>

#include "texture/exposure.h"
#include "texture/mesh_tiles.h"
#include "texture/observations.h"
#include "texture/photo_view.h"

namespace roomtex {

// tiles: the samples that the store's slots come from. Gains are as to be applied: the output scale
// is in them.
ExposureSolution UnifyExposure(const std::vector<SampleTile>& tiles,
                               const std::vector<PhotoView>& photos, const ExposureOptions& options,
                               int num_threads, ObservationStore* store);

}  // namespace roomtex
