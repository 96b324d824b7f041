#pragma once
// The one pass over the photos: every photo is decoded once and says what it sees of the samples.

#include <vector>

#include "core/progress.h"
#include "texture/sampling/blend.h"
#include "texture/sampling/mesh_tiles.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_view.h"
#include "texture/sampling/visibility.h"

namespace roomtex {

struct PhotoPassInput {
  std::vector<OccluderTiles> occluders;  // of all scans
  std::vector<SampleTile> samples;       // of all scans; first_slot numbers them through
  double angular_spacing = 0;            // of the finest scan, radians; 0 = not known
};

// Adds every photo's observations to the store. Returns how many samples each photo sees.
std::vector<size_t> ObservePhotos(const PhotoPassInput& input, const std::vector<PhotoView>& photos,
                                  const OcclusionOptions& occlusion, const BlendOptions& blend,
                                  int num_threads, Progress* progress, ObservationStore* store);

}  // namespace roomtex
