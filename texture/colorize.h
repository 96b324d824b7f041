#pragma once
// Colours range scans from registered photos: visibility, exposure, blend and detail (thesis
// chapter 8).

#include <array>
#include <string>
#include <vector>

#include "core/progress.h"
#include "core/scan.h"
#include "core/scan_mesh.h"
#include "texture/blend.h"
#include "texture/detail.h"
#include "texture/exposure.h"
#include "texture/photo_view.h"
#include "texture/scan_surface.h"
#include "texture/visibility.h"

namespace roomtex {

struct ColorizeOptions {
  ScanMeshOptions mesh;
  ScanSurfaceOptions surface;
  OcclusionOptions occlusion;
  ExposureOptions exposure;
  BlendOptions blend;
  DetailOptions detail;
  std::string unseen =
      "intensity";  // colour of samples that no photo sees: "intensity" (grey) or "black"
  // Texels per sample and direction of the texture image. 1 = one texel a sample; more colour the
  // surface between the samples as well.
  int texture_scale = 1;

  std::vector<std::string> Problems() const;
};

// Colours on a grid, row by row.
struct ColorGrid {
  int num_columns = 0, num_rows = 0;
  std::vector<std::array<uint8_t, 3>> rgb;  // sRGB; {0, 0, 0} where there is no sample
  std::vector<uint8_t> views;               // photos that see the sample, at most 255
};

struct ColoredScan {
  std::vector<Triangle> triangles;
  ColorGrid samples;  // one per sample of the scan
  // texture_scale times as many columns and rows; empty when that is 1 or the scan has no grid.
  // Texel (c, r) lies at the sample coordinates ((c + 0.5) / scale - 0.5, (r + 0.5) / scale - 0.5).
  ColorGrid texture;
};

struct ColorizeResult {
  std::vector<ColoredScan> scans;
  size_t num_vertices = 0, num_colored = 0;
  double views_mean = 0;      // of the coloured ones
  ExposureSolution exposure;  // gains as applied, output scale included
  Disagreement disagreement;
  std::vector<size_t> samples_seen;  // per photo
};

// Photos are decoded once each, num_threads of them at a time. The result does not depend on
// num_threads. Throws InputError for a photo that cannot be read.
ColorizeResult ColorizeScans(const std::vector<Scan>& scans, const std::vector<PhotoView>& photos,
                             const ColorizeOptions& options, int num_threads, Progress* progress);

// Adds `more` behind `problems`.
void AppendProblems(const std::vector<std::string>& more, std::vector<std::string>* problems);

}  // namespace roomtex
