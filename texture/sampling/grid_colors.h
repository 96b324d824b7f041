#pragma once
// From observations to colours, grid by grid: a scan's samples, or the texels of a texture image.

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "texture/sampling/blend.h"
#include "texture/sampling/detail.h"
#include "texture/sampling/observations.h"
#include "texture/sampling/photo_choice.h"
#include "texture/sampling/photo_pass.h"

namespace roomtex {

using Rgb = std::array<uint8_t, 3>;  // sRGB

// Colours on a grid, row by row.
struct ColorGrid {
  int num_columns = 0, num_rows = 0;
  std::vector<Rgb> rgb;  // {0, 0, 0} where there is no sample
  // Photos that give the colour (ObservationStore::NumViews), 0 = unseen.
  std::vector<uint8_t> views;
};

// Where the samples of one grid stand among all that the photos are asked about.
struct GridOfSamples {
  size_t first_tile = 0, end_tile = 0;
  int num_columns = 0, num_rows = 0;
};

// Appends columns x rows points (row by row; NaN = none) with their normals to what the photos are
// asked about. station: where the scanner stood, `scan` frame; NaN = not known.
GridOfSamples AddGrid(int columns, int rows, const std::vector<Eigen::Vector3d>& points,
                      const std::vector<Eigen::Vector3f>& normals, const Eigen::Vector3d& station,
                      PhotoPassInput* input);

// Samples that have a place in the ObservationStore.
size_t NumSlots(const PhotoPassInput& input);

class GridColorizer {
 public:
  // detail: lengths in cells of the grid. gains: linear, one 3-vector per photo.
  GridColorizer(const PhotoPassInput& input, const ObservationStore& store,
                const std::vector<Eigen::Vector3f>& gains, const BlendOptions& blend,
                const DetailOptions& detail, int num_threads)
      : input_(input),
        store_(store),
        gains_(gains),
        blend_(blend),
        detail_(detail),
        num_threads_(num_threads) {}

  // Detail comes from the photos chosen; null: from all. choice must outlive this. numbers: of its
  // photos in `gains` and the store; -1 = not there.
  void SetChoice(const PhotoChoice* choice, std::vector<int> numbers) {
    choice_ = choice;
    numbers_ = std::move(numbers);
  }

  // links: neighbours on one surface; without any (all 0) there is no preservation of details.
  // unseen: colour per cell that no photo sees; empty = black.
  ColorGrid Colorize(const GridOfSamples& grid, const GridLinks& links,
                     const std::vector<Rgb>& unseen) const;

 private:
  struct BlendedGrid;
  BlendedGrid Blend(const GridOfSamples& grid) const;
  void Choose(const GridOfSamples& grid, BlendedGrid* blended) const;
  ColorGrid Encode(const GridOfSamples& grid, const BlendedGrid& blended,
                   const std::vector<Rgb>& unseen) const;
  ColorGrid BlendAlone(const GridOfSamples& grid, const std::vector<Rgb>& unseen) const;

  const PhotoPassInput& input_;
  const ObservationStore& store_;
  const std::vector<Eigen::Vector3f>& gains_;
  const BlendOptions& blend_;
  const DetailOptions& detail_;
  int num_threads_;
  const PhotoChoice* choice_ = nullptr;
  std::vector<int> numbers_;
};

}  // namespace roomtex
