#pragma once
// From what the photos say of the samples to one exposure for all of them (thesis 8.2.1).

#include <vector>

#include "texture/sampling/mesh_tiles.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_view.h"
#include "texture/tone/exposure.h"

namespace roomtex {

// The response curve that the options name, on every photo. With "estimate" photos are taken for
// sRGB until UnifyExposure. Throws InputError for a curve or a bracket that cannot be used.
void SetResponse(const ExposureOptions& options, std::vector<PhotoView>* photos);

// tiles: the samples that the store's slots come from. Gains are as to be applied: the output scale
// is in them. A response curve or vignetting that is found goes into the photos' tones, and the
// store's colours are corrected by it.
ExposureSolution UnifyExposure(const std::vector<SampleTile>& tiles, const ExposureOptions& options,
                               int num_threads, std::vector<PhotoView>* photos,
                               ObservationStore* store);

}  // namespace roomtex
