#pragma once
// A texture atlas for meshes without a grid: charts of nearly plane, connected triangles, each laid
// flat into a page of texels. Meshes of few large triangles (decimated, drawn by hand) get the
// photos' detail this way.

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "texture/grid_colors.h"

namespace roomtex {

// Triangles that are projected along one direction.
struct AtlasChart {
  int page = 0;
  // Position in the page, texels (centre of the upper-left texel: 0.5, 0.5), of a point in `scan`:
  // page_from_scan * [x y z 1].
  Eigen::Matrix<double, 2, 4> page_from_scan = Eigen::Matrix<double, 2, 4>::Zero();

  Eigen::Vector2d InPage(const Eigen::Vector3d& x_in_scan) const {
    return page_from_scan * x_in_scan.homogeneous();
  }
};

struct MeshAtlas {
  double texel_size = 0;                // metres
  int page_width = 0, page_height = 0;  // texels
  int num_pages = 0;
  std::vector<AtlasChart> charts;
  std::vector<int> chart_of;     // per triangle; -1 = none, it has no area
  std::vector<ColorGrid> pages;  // once coloured, gutters included

  bool empty() const { return charts.empty(); }
};

}  // namespace roomtex
