#pragma once
// Coloured scans as binary glTF.

#include <string>
#include <vector>

#include "core/scan.h"
#include "texture/texels/colored_scan.h"

namespace roomtex {

class OptionFields;

struct GlbOptions {
  // Longest side of one texture image; a larger grid is split into several primitives with a
  // texture each. 4096: what every browser and phone loads.
  int max_texture_size = 4096;
  // JPEG (quality 95) instead of PNG. PNG keeps the texels to the bit and draws no rings around
  // print, and the mesh's numbers mostly weigh more than it anyway; JPEG takes a fourth of the
  // room.
  bool jpeg = false;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// Binary glTF 2.0 of all scans: one root node that turns scans[0].up to +Y, one mesh per scan. A
// scan with a grid gets texture images (in the scan's grid), a mesh without a grid its atlas or, if
// it has none, vertex colours (COLOR_0, linear as glTF wants them). Unlit (KHR_materials_unlit):
// the photos hold the light already. Positions are floats around each scan's centre, which the
// scan's node puts back. Throws InputError if it cannot be written or would exceed glTF's 4 GB.
void WriteColoredGlb(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                     const std::string& path, const GlbOptions& options = {});

}  // namespace roomtex
