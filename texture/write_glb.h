#pragma once
#include <string>
#include <vector>

#include "core/scan.h"
#include "texture/colorize.h"

namespace roomtex {

struct GlbOptions {
  // Longest side of one texture image; a larger grid is split into several primitives with a
  // texture each.
  int max_texture_size = 4096;
};

// Binary glTF 2.0 of all scans: one root node that turns scans[0].up to +Y, one mesh per scan. A
// scan with a grid gets texture images (PNG, in the scan's grid); a mesh without a grid gets vertex
// colours (COLOR_0, linear as glTF wants them). Unlit (KHR_materials_unlit): the photos hold the
// light already. Positions are floats around each scan's centre, which the scan's node puts back.
// Throws InputError if it cannot be written or would exceed glTF's 4 GB.
void WriteColoredGlb(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                     const std::string& path, const GlbOptions& options = {});

}  // namespace roomtex
