#pragma once
// A selection of the samples for finding exposures, white balance, vignetting and response: what
// the photos say about each, and where in the photo they say it.

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "texture/sampling/mesh_tiles.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

// One photo's word on one sample.
struct ExposureView {
  int photo = 0;
  Eigen::Vector3f light;  // linear r, g, b, 0..1, as photographed
  float trust = 0;        // 0..1: fades out towards black and towards clipping
  float radius2 = 0;  // squared distance from the principal point; 1 = half the photo's diagonal
};

// The views of the k-th sample are views[begin[k]] ... views[begin[k + 1] - 1]; at least two each.
struct ExposureSamples {
  std::vector<ExposureView> views;
  std::vector<size_t> begin = {0};
  int num_photos = 0;

  size_t size() const { return begin.size() - 1; }
};

// 1 for light that is neither noise (below byte 38) nor near clipping (above byte 231), fading to 0
// towards byte 8 and byte 246.
float ExposureTrust(const Eigen::Vector3f& light);

// Every n-th sample so that about max(60000, 1000 a photo) are looked at: time stays bounded. Views
// in depth-boundary bands are left out.
ExposureSamples SelectSamples(const ObservationStore& store, int num_photos);

// The same with radius2. samples: the tiles that the store's slots come from.
ExposureSamples SelectSamples(const ObservationStore& store, const std::vector<SampleTile>& tiles,
                              const std::vector<PhotoView>& photos, int num_threads);

// One in this many samples is looked at.
size_t SampleStride(const ObservationStore& store, size_t num_photos);

}  // namespace roomtex
