#pragma once
// Two walls as roomtex-texture would write them, for the tests of the viewer.

#include <cmath>
#include <string>

#include "core/scan_mesh.h"
#include "tests/texture/sampling/two_walls.h"
#include "texture/colorize.h"
#include "texture/output/evidence.h"
#include "texture/output/write_glb.h"
#include "texture/output/write_ply.h"

namespace roomtex {

// Colours, photos and disagreement that tell the sample.
inline ColoredScan ColorForView(const Scan& scan) {
  ColoredScan colored;
  colored.triangles = BuildScanMesh(scan, ScanMeshOptions());
  colored.samples.num_columns = scan.num_columns;
  colored.samples.num_rows = scan.num_rows;
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      colored.samples.rgb.push_back(
          {static_cast<uint8_t>(column % 200), static_cast<uint8_t>(row % 200), uint8_t{77}});
      const int views = column % 4;
      colored.samples.views.push_back(static_cast<uint8_t>(views));
      colored.disagreement.push_back(views < 2 ? NAN : static_cast<float>(row % 20));
    }
  }
  return colored;
}

// model.glb, model.ply and evidence.ply.
inline void WriteViewFolder(const Scan& scan, const std::string& folder,
                            int max_texture_size = 4096) {
  const ColoredScan colored = ColorForView(scan);
  GlbOptions options;
  options.max_texture_size = max_texture_size;
  WriteColoredGlb({scan}, {colored}, folder + "/model.glb", options);
  WriteColoredPly({scan}, {colored}, folder + "/model.ply");
  WriteEvidence({scan}, {colored}, folder + "/evidence.ply");
}

inline Scan TwoWallsScan(int columns, int rows) { return TwoWalls().MakeScan(columns, rows); }

}  // namespace roomtex
