#include "texture/sampling/grid_colors.h"

#include <algorithm>

#include "core/cpu_stages.h"
#include "core/parallel.h"
#include "core/photo.h"

namespace roomtex {

size_t NumSlots(const PhotoPassInput& input) {
  if (input.samples.empty()) return 0;
  const SampleTile& last = input.samples.back();
  return static_cast<size_t>(last.first_slot) + last.points.size();
}

GridOfSamples AddGrid(int columns, int rows, const std::vector<Eigen::Vector3d>& points,
                      const std::vector<Eigen::Vector3f>& normals, const Eigen::Vector3d& station,
                      PhotoPassInput* input) {
  const int first_slot = static_cast<int>(NumSlots(*input));
  GridOfSamples grid{input->samples.size(), 0, columns, rows};
  for (SampleTile& tile : MakeSampleTiles(columns, rows, points, normals, station)) {
    tile.first_slot += first_slot;
    input->samples.push_back(std::move(tile));
  }
  grid.end_tile = input->samples.size();
  input->grid_ends.push_back(grid.end_tile);
  return grid;
}

// Blend of a grid's samples, scattered from slots to grid cells.
struct GridColorizer::BlendedGrid {
  std::vector<Eigen::Vector3f> blend;
  DominantMap dominant;
};

GridColorizer::BlendedGrid GridColorizer::Blend(const GridOfSamples& grid) const {
  const CpuTimer timer(CpuStage::kBlend, CpuTimer::Scope::kProcess);
  const size_t count = static_cast<size_t>(grid.num_columns) * grid.num_rows;
  BlendedGrid result;
  result.blend.assign(count, Eigen::Vector3f::Zero());
  result.dominant.color.assign(count, Eigen::Vector3f::Zero());
  result.dominant.photo.assign(count, -1);
  result.dominant.fits.assign(count, 0);
  const int first = static_cast<int>(grid.first_tile), end = static_cast<int>(grid.end_tile);
  ParallelFor(num_threads_, first, end, [&](int t) {
    const SampleTile& tile = input_.samples[t];
    for (int i = 0; i < tile.points.size(); ++i) {
      const size_t slot = static_cast<size_t>(tile.first_slot) + i;
      const BlendedSample sample =
          BlendSample(store_.Begin(slot), store_.Count(slot), gains_, blend_.outlier);
      result.blend[tile.index[i]] = sample.blend;
      result.dominant.color[tile.index[i]] = sample.dominant;
      result.dominant.photo[tile.index[i]] = static_cast<int16_t>(sample.dominant_photo);
      result.dominant.fits[tile.index[i]] = sample.dominant_fits;
    }
  });
  return result;
}

// The photos chosen in place of the dominant ones.
void GridColorizer::Choose(const GridOfSamples& grid, BlendedGrid* blended) const {
  DominantMap& dominant = blended->dominant;
  dominant.fits.assign(blended->blend.size(), 0);
  dominant.strength.assign(blended->blend.size(), 0.0f);
  const int first = static_cast<int>(grid.first_tile), end = static_cast<int>(grid.end_tile);
  ParallelFor(num_threads_, first, end, [&](int t) {
    const SampleTile& tile = input_.samples[t];
    const PointBlock& points = tile.points;
    PhotoChoice::Reader reader(*choice_);
    for (int i = 0; i < points.size(); ++i) {
      const int index = tile.index[i];
      if (dominant.photo[index] < 0) continue;
      const Eigen::Vector3f point(points.x[i], points.y[i], points.z[i]);
      const PhotoChoice::Place& place = reader.At(points.origin + point.cast<double>());
      if (!(place.strength > 0)) continue;
      const size_t slot = static_cast<size_t>(tile.first_slot) + i;
      const Observation* seen = store_.Begin(slot);
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      float shares = 0;
      for (int k = 0; k < store_.Count(slot) && MayGiveDetail(seen[k], seen[0]); ++k) {
        for (int p = 0; p < place.count; ++p) {
          if (numbers_[place.photos[p]] != seen[k].photo) continue;
          shares += place.shares[p];
          sum += place.shares[p] * UnpackColor(seen[k].color).cwiseProduct(gains_[seen[k].photo]);
        }
      }
      if (!(shares > 0)) continue;
      dominant.color[index] = sum / shares;
      dominant.fits[index] = 1;
      dominant.strength[index] = place.strength;
    }
  });
}

namespace {

ColorGrid EmptyColors(const GridOfSamples& grid) {
  const size_t count = static_cast<size_t>(grid.num_columns) * grid.num_rows;
  ColorGrid colors;
  colors.num_columns = grid.num_columns;
  colors.num_rows = grid.num_rows;
  colors.rgb.assign(count, {0, 0, 0});
  colors.views.assign(count, 0);
  return colors;
}

void PutColor(const Eigen::Vector3f& linear, int views, const std::vector<Rgb>& unseen, int index,
              ColorGrid* colors) {
  colors->views[index] = static_cast<uint8_t>(std::min(views, 255));
  if (views == 0) {
    if (!unseen.empty()) colors->rgb[index] = unseen[index];
    return;
  }
  for (int k = 0; k < 3; ++k) colors->rgb[index][k] = SrgbByteFromLinear(linear[k]);
}

}  // namespace

ColorGrid GridColorizer::Encode(const GridOfSamples& grid, const BlendedGrid& blended,
                                const std::vector<Rgb>& unseen) const {
  const CpuTimer timer(CpuStage::kBlend, CpuTimer::Scope::kProcess);
  ColorGrid result = EmptyColors(grid);
  const int first = static_cast<int>(grid.first_tile), end = static_cast<int>(grid.end_tile);
  ParallelFor(num_threads_, first, end, [&](int t) {
    const SampleTile& tile = input_.samples[t];
    for (int i = 0; i < tile.points.size(); ++i) {
      const int index = tile.index[i];
      const int views = blended.dominant.photo[index] < 0
                            ? 0
                            : store_.NumViews(static_cast<size_t>(tile.first_slot) + i);
      PutColor(blended.blend[index], views, unseen, index, &result);
    }
  });
  return result;
}

// Without a grid no sample needs its neighbours, and what all of them have at once is not kept.
ColorGrid GridColorizer::BlendAlone(const GridOfSamples& grid,
                                    const std::vector<Rgb>& unseen) const {
  const CpuTimer timer(CpuStage::kBlend, CpuTimer::Scope::kProcess);
  ColorGrid result = EmptyColors(grid);
  const int first = static_cast<int>(grid.first_tile), end = static_cast<int>(grid.end_tile);
  ParallelFor(num_threads_, first, end, [&](int t) {
    const SampleTile& tile = input_.samples[t];
    for (int i = 0; i < tile.points.size(); ++i) {
      const size_t slot = static_cast<size_t>(tile.first_slot) + i;
      const BlendedSample sample =
          BlendSample(store_.Begin(slot), store_.Count(slot), gains_, blend_.outlier);
      PutColor(sample.blend, sample.dominant_photo < 0 ? 0 : store_.NumViews(slot), unseen,
               tile.index[i], &result);
    }
  });
  return result;
}

ColorGrid GridColorizer::Colorize(const GridOfSamples& grid, const GridLinks& links,
                                  const std::vector<Rgb>& unseen) const {
  if (grid.num_rows == 1) return BlendAlone(grid, unseen);
  BlendedGrid blended = Blend(grid);
  const bool is_chosen = choice_ != nullptr && !choice_->empty();
  if (blend_.detail || is_chosen) {
    const CpuTimer timer(CpuStage::kDetail, CpuTimer::Scope::kProcess);
    if (is_chosen) Choose(grid, &blended);
    Scan shape;
    shape.num_columns = grid.num_columns;
    shape.num_rows = grid.num_rows;
    PreserveDetail(shape, links, blended.dominant, detail_, num_threads_, &blended.blend);
  }
  return Encode(grid, blended, unseen);
}

}  // namespace roomtex
