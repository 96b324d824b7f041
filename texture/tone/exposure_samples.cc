#include "texture/tone/exposure_samples.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "texture/sampling/photo_tone.h"

namespace roomtex {
namespace {

// Of the weight of the sample's best view. Not a weight of its own: where samples lie closer than
// pixels, all views of a sample weigh little.
constexpr float kLeastShareOfBest = 0.002f;

// 0 at `from`, 1 at `to`.
float Ramp(float value, float from, float to) {
  return std::clamp((value - from) / (to - from), 0.0f, 1.0f);
}

// Adds the usable views of one sample; none if fewer than two photos have one.
void AddSample(const ObservationStore& store, size_t slot, ExposureSamples* samples) {
  const Observation* observations = store.Begin(slot);
  float best = 0;
  for (int i = 0; i < store.Count(slot); ++i) {
    if (observations[i].at_boundary) continue;
    const float weight = UnpackWeight(observations[i].weight);
    best = std::max(best, weight);
    if (weight < kLeastShareOfBest * best) continue;
    ExposureView view;
    view.light = UnpackColor(observations[i].color);
    view.trust = ExposureTrust(view.light);
    view.photo = observations[i].photo;
    if (view.trust > 0) samples->views.push_back(view);
  }
  if (samples->views.size() < samples->begin.back() + 2) {
    samples->views.resize(samples->begin.back());
  } else {
    samples->begin.push_back(samples->views.size());
  }
}

// Projects the samples of one tile into the photos that see them.
class RadiusFinder {
 public:
  explicit RadiusFinder(const std::vector<PhotoView>& photos) {
    for (const PhotoView& photo : photos) {
      projectors_.emplace_back(photo);
      radii_.emplace_back(projectors_.back().camera());
    }
  }

  // slots[k]: number in the tile of sample first + k.
  void FindRadii(const SampleTile& tile, const std::vector<int>& slots, size_t first,
                 ExposureSamples* samples) const {
    PointBlock block;
    block.origin = tile.points.origin;
    std::vector<int> photos;
    for (size_t k = 0; k < slots.size(); ++k) {
      block.x.push_back(tile.points.x[slots[k]]);
      block.y.push_back(tile.points.y[slots[k]]);
      block.z.push_back(tile.points.z[slots[k]]);
      for (size_t v = samples->begin[first + k]; v < samples->begin[first + k + 1]; ++v) {
        photos.push_back(samples->views[v].photo);
      }
    }
    std::sort(photos.begin(), photos.end());
    photos.erase(std::unique(photos.begin(), photos.end()), photos.end());
    ProjectedBlock projected;
    for (const int photo : photos) {
      projectors_[photo].Project(block, &projected);
      for (size_t k = 0; k < slots.size(); ++k) {
        for (size_t v = samples->begin[first + k]; v < samples->begin[first + k + 1]; ++v) {
          ExposureView& view = samples->views[v];
          if (view.photo == photo) {
            view.radius2 = radii_[photo].Squared(projected.x[k], projected.y[k]);
          }
        }
      }
    }
  }

 private:
  std::vector<PhotoProjector> projectors_;
  std::vector<LensRadius> radii_;
};

}  // namespace

float ExposureTrust(const Eigen::Vector3f& light) {
  return Ramp(light.minCoeff(), 0.0024f, 0.02f) * Ramp(light.maxCoeff(), 0.92f, 0.8f);
}

size_t SampleStride(const ObservationStore& store, size_t num_photos) {
  const size_t wanted = std::max<size_t>(60000, 1000 * num_photos);
  return store.num_samples() / wanted + 1;
}

ExposureSamples SelectSamples(const ObservationStore& store, int num_photos) {
  ExposureSamples samples;
  samples.num_photos = num_photos;
  const size_t stride = SampleStride(store, num_photos);
  for (size_t slot = 0; slot < store.num_samples(); slot += stride) {
    AddSample(store, slot, &samples);
  }
  return samples;
}

ExposureSamples SelectSamples(const ObservationStore& store, const std::vector<SampleTile>& tiles,
                              const std::vector<PhotoView>& photos, int num_threads) {
  ExposureSamples samples;
  samples.num_photos = static_cast<int>(photos.size());
  const size_t stride = SampleStride(store, photos.size());
  struct TilePart {
    std::vector<int> slots;
    size_t first = 0;
  };
  std::vector<TilePart> parts(tiles.size());
  size_t slot = 0;
  for (size_t t = 0; t < tiles.size(); ++t) {
    const size_t first_slot = tiles[t].first_slot, end = first_slot + tiles[t].points.size();
    parts[t].first = samples.size();
    for (; slot < end; slot += stride) {
      const size_t before = samples.size();
      AddSample(store, slot, &samples);
      if (samples.size() > before) parts[t].slots.push_back(static_cast<int>(slot - first_slot));
    }
  }
  const RadiusFinder finder(photos);
  ParallelFor(num_threads, 0, static_cast<int>(tiles.size()), [&](int t) {
    if (!parts[t].slots.empty()) {
      finder.FindRadii(tiles[t], parts[t].slots, parts[t].first, &samples);
    }
  });
  return samples;
}

}  // namespace roomtex
