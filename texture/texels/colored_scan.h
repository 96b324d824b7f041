#pragma once
// A scan with its colours: what the colour stages make and the writers write.

#include <vector>

#include "core/scan_mesh.h"
#include "texture/sampling/grid_colors.h"
#include "texture/texels/mesh_atlas.h"

namespace roomtex {

struct ColoredScan {
  std::vector<Triangle> triangles;
  ColorGrid samples;  // one per sample of the scan
  // texture_scale times as many columns and rows; empty when that is 1 or the scan has no grid.
  // Texel (c, r) lies at the sample coordinates ((c + 0.5) / scale - 0.5, (r + 0.5) / scale - 0.5).
  ColorGrid texture;
  MeshAtlas atlas;  // of a mesh without a grid, where it is worth one
  // One per sample: how far the photos that see it differ after the exposures were unified
  // (SampleDisagreement); NaN where fewer than two do.
  std::vector<float> disagreement;
};

}  // namespace roomtex
