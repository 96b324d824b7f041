#pragma once
// How fine a texture image should be.

#include <vector>

#include "core/scan.h"
#include "texture/sampling/blend.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_pass.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

// Pixels between neighbouring samples in the photo that gives a sample most of its colour: median
// over an even selection of the samples. 0 = no sample is seen, or no scan has a grid.
double MedianPixelsPerSample(const PhotoPassInput& input, const ObservationStore& store,
                             const std::vector<PhotoView>& photos);

inline constexpr int kMaxTextureScale = 16;

// Texels per sample and direction, the --Texture.scale 0 of roomtex-texture: pixels per sample,
// rounded up, so that half of the samples lose nothing of the photos. At most kMaxAutoScale, at
// most what fits into max_bytes in kMaxAutoBands bands, and at most kMaxAutoTexels in all, so that
// an ordinary run takes about a minute.
inline constexpr int kMaxAutoScale = 4, kMaxAutoBands = 4;
inline constexpr double kMaxAutoTexels = 40e6;
int ChooseTextureScale(const std::vector<Scan>& scans, double pixels_per_sample,
                       const BlendOptions& blend, double max_bytes);

}  // namespace roomtex
