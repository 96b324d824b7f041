#pragma once
// The coloured scan as trainers and dense stereo start from it: a bounded number of points, and
// what each photo sees of them.

#include <string>
#include <vector>

#include "core/progress.h"
#include "core/scan.h"
#include "core/scan_mesh.h"
#include "texture/sampling/grid_colors.h"
#include "texture/sampling/mesh_tiles.h"
#include "texture/sampling/visibility.h"

namespace roomtex {

// Colour and number of photos of every sample, one grid per scan.
using ScanColors = std::vector<ColorGrid>;

// Of the model.ply that roomtex-texture wrote for these scans. Throws InputError if it is of
// others.
ScanColors ReadScanColors(const std::vector<Scan>& scans, const std::string& model_ply);

// Of the surface that took a cloud's place (ReplaceClouds): to each of its corners what the nearest
// point of the cloud has.
ColorGrid ColorsOfSurface(const Scan& cloud, const ColorGrid& colors, const Scan& surface);

struct ExportScene {
  std::vector<OccluderTiles> occluders;
  double angular_spacing = 0;       // radians, of the finest scan; 0 = not known
  std::vector<SampleTile> samples;  // of all scans, numbered through; range noise reduced
  // Per sample: colour; photos that see it; which of the points it is, -1 = none.
  std::vector<Rgb> colors;
  std::vector<uint8_t> views;
  std::vector<int> point_of_sample;
  struct Point {
    Eigen::Vector3d x_in_scan;
    Rgb color;
  };
  std::vector<Point> points;
};

// max_points: at most so many, one in each cell of an even lattice, of the samples that at least
// two photos see.
ExportScene MakeExportScene(const std::vector<Scan>& scans, const ScanColors& colors,
                            int max_points, int num_threads);

}  // namespace roomtex
