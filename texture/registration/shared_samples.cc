#include "texture/registration/shared_samples.h"

#include <algorithm>

#include "core/parallel.h"
#include "texture/registration/shift_patch.h"

namespace roomtex {
namespace {

constexpr double kMostShared = 400000;  // samples

}  // namespace

SharedSamples::SharedSamples(const PhotoPassInput& input, const std::vector<GridOfSamples>& grids,
                             const std::vector<std::vector<uint8_t>>& intensities,
                             const ObservationStore& store, int num_photos)
    : sightings_(num_photos) {
  const double share = static_cast<double>(store.num_samples()) / kMostShared;
  const int stride = std::max(1, static_cast<int>(std::ceil(std::sqrt(share) - 1e-9)));
  for (size_t g = 0; g < grids.size(); ++g) {
    const GridOfSamples& grid = grids[g];
    for (size_t t = grid.first_tile; t < grid.end_tile; ++t) {
      const SampleTile& tile = input.samples[t];
      PointBlock block;
      block.origin = tile.points.origin;
      first_of_block_.push_back(static_cast<int>(normals_.size()));
      for (int i = 0; i < tile.points.size(); ++i) {
        const int column = tile.index[i] % grid.num_columns, row = tile.index[i] / grid.num_columns;
        const size_t slot = static_cast<size_t>(tile.first_slot) + i;
        const Observation* const seen = store.Begin(slot);
        const bool is_line = grid.num_rows == 1;  // a cloud or mesh has no rows to thin
        if (is_line ? column % (stride * stride) != 0 : column % stride != 0 || row % stride != 0) {
          continue;
        }
        if (store.Count(slot) < 2 || seen[1].in_doubt != 0) continue;
        const auto sample = static_cast<int>(normals_.size());
        for (int k = 0; k < store.Count(slot) && seen[k].in_doubt == 0; ++k) {
          Sighting sighting;
          sighting.sample = sample;
          sighting.weight = UnpackWeight(seen[k].weight);
          sightings_[seen[k].photo].push_back(sighting);
        }
        block.Add(block.origin +
                  Eigen::Vector3d(tile.points.x[i], tile.points.y[i], tile.points.z[i]));
        normals_.push_back(tile.normals[i]);
        intensities_.push_back(intensities[g][tile.index[i]]);
      }
      blocks_.push_back(std::move(block));
    }
  }
  first_of_block_.push_back(static_cast<int>(normals_.size()));
  ListBySample();
}

void SharedSamples::ListBySample() {
  first_of_sample_.assign(normals_.size() + 1, 0);
  for (const auto& sightings : sightings_) {
    for (const Sighting& s : sightings) ++first_of_sample_[s.sample + 1];
  }
  for (size_t i = 1; i < first_of_sample_.size(); ++i) {
    first_of_sample_[i] += first_of_sample_[i - 1];
  }
  of_sample_.resize(first_of_sample_.back() + 1);  // End() of the last one is a place in it
  std::vector<int> next = first_of_sample_;
  for (int photo = 0; photo < num_photos(); ++photo) {
    for (size_t k = 0; k < sightings_[photo].size(); ++k) {
      of_sample_[next[sightings_[photo][k].sample]++] = {photo, static_cast<int>(k)};
    }
  }
}

void SharedSamples::LookFrom(const PhotoView& photo, const LevelPicture& picture, float gain,
                             std::vector<Sighting>* sightings) const {
  const PhotoProjector projector(photo);
  ProjectedBlock projected;
  size_t at = 0;
  for (size_t b = 0; b < blocks_.size() && at < sightings->size(); ++b) {
    if ((*sightings)[at].sample >= first_of_block_[b + 1]) continue;
    projector.Project(blocks_[b], &projected);
    for (; at < sightings->size() && (*sightings)[at].sample < first_of_block_[b + 1]; ++at) {
      Sighting& s = (*sightings)[at];
      const int i = s.sample - first_of_block_[b];
      s.grey = NAN;
      if (!(projected.depth[i] > 0)) continue;
      s.place = {projected.x[i], projected.y[i]};
      Eigen::Vector2f shown = s.place;
      if (photo.warp) shown += photo.warp->At(s.place.x(), s.place.y());
      const float grey = GreyAt(picture.grey, picture.Place(shown));
      if (grey >= 0) s.grey = grey * gain;
    }
  }
}

void SharedSamples::Look(const std::vector<PhotoView>& photos,
                         const std::vector<LevelPicture>& pictures, const std::vector<float>& gains,
                         int num_threads) {
  ParallelFor(num_threads, 0, num_photos(),
              [&](int i) { LookFrom(photos[i], pictures[i], gains[i], &sightings_[i]); });
  weight_.assign(normals_.size(), 0.0f);
  sum_.assign(normals_.size(), 0.0f);
  for (const auto& sightings : sightings_) {
    for (const Sighting& s : sightings) {
      if (std::isnan(s.grey)) continue;
      weight_[s.sample] += s.weight;
      sum_[s.sample] += s.weight * s.grey;
    }
  }
}

void SharedSamples::KeepAside(double edge) {
  kept_aside_.clear();
  if (!(edge > 0)) return;
  kept_aside_.reserve(normals_.size());
  for (const PointBlock& block : blocks_) {
    for (int i = 0; i < block.size(); ++i) {
      const Eigen::Vector3d point =
          block.origin + Eigen::Vector3d(block.x[i], block.y[i], block.z[i]);
      const Eigen::Array3d cube = (point / edge).array().floor();
      // Apart from each other on walls along all three axes, like a knight's moves.
      const double number = cube.x() + 2 * cube.y() + 4 * cube.z();
      kept_aside_.push_back(number - 7 * std::floor(number / 7) == 0 ? 1 : 0);
    }
  }
}

Eigen::Vector3d SharedSamples::Point(int sample) const {
  const auto after = std::upper_bound(first_of_block_.begin(), first_of_block_.end(), sample);
  const auto b = static_cast<size_t>(after - first_of_block_.begin() - 1);
  const PointBlock& block = blocks_[b];
  const int i = sample - first_of_block_[b];
  return block.origin + Eigen::Vector3d(block.x[i], block.y[i], block.z[i]);
}

}  // namespace roomtex
