#pragma once
// A texture atlas for meshes without a grid: charts of nearly plane, connected triangles, each laid
// flat into a page of texels (the words are those of Levy et al. 2002, "Least Squares Conformal
// Maps for Automatic Texture Atlas Generation"; our charts are projected, not conformal). Meshes of
// few large triangles (decimated, drawn by hand) get the photos' detail this way.

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan_mesh.h"
#include "texture/sampling/grid_colors.h"
#include "texture/sampling/photo_view.h"
#include "texture/texels/texel_pass.h"

namespace roomtex {

class OptionFields;

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
  double texel_size = 0;  // metres
  int page_size = 0;      // texels, pages are squares
  int num_pages = 0;
  std::vector<AtlasChart> charts;
  std::vector<int> chart_of;            // per triangle; -1 = none, it has no area
  std::vector<ColorGrid> pages;         // once coloured, gutters painted
  double num_texels = 0, num_seen = 0;  // of the charts, once coloured

  bool empty() const { return charts.empty(); }
};

struct AtlasOptions {
  // "auto": where the photos show more than the vertices can hold (eight texels or more from vertex
  // to vertex, or two where the mesh is decimated); "1": always; "0": never.
  std::string mode = "auto";
  // Millimetres a texel; 0 = what a photo's pixel covers on the surface, median.
  double texel_mm = 0;
  // A mesh of more triangles is also written decimated to that many, which leaves its colours to
  // fewer vertices; 0 = it is not. No option of its own: commands give it that of WebOptions.
  int decimated_to = 0;
  // Largest side of a page, texels. No option of its own: commands give it GlbOptions' largest.
  int max_page_size = 4096;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// What a pixel of the nearest photo that looks at a probe covers there, metres: median. 0 = none.
double PixelOnSurface(const SurfaceProbes& probes, const std::vector<PhotoView>& photos);

// Square metres of all triangles.
double SurfaceArea(const std::vector<Eigen::Vector3d>& points,
                   const std::vector<Triangle>& triangles);

// Charts laid out on pages, at most max_texels in all (three times that with the gutters around
// them); empty if the options or the mesh want none, or if it falls into too many charts.
// A triangle that would not fit on a page gets larger texels than the others.
MeshAtlas LayOutAtlas(const std::vector<Eigen::Vector3d>& points,
                      const std::vector<Triangle>& triangles, double pixel_on_surface,
                      double max_texels, const AtlasOptions& options);

// The texels of one page.
class AtlasTexels : public TexelSource {
 public:
  // Everything must outlive this. vertex_colors: one per point, for texels that no photo sees.
  AtlasTexels(const std::vector<Eigen::Vector3d>& points, const std::vector<Triangle>& triangles,
              const MeshAtlas& atlas, const std::vector<Rgb>& vertex_colors, int page);

  int num_columns() const override { return atlas_.page_size; }
  int num_rows() const override { return atlas_.page_size; }
  double texels_per_sample() const override { return 2; }
  Eigen::Vector3d station() const override { return Scan::MissingPoint(); }
  TexelBlock Rows(int first, int end) const override;

 private:
  const std::vector<Eigen::Vector3d>& points_;
  const std::vector<Triangle>& triangles_;
  const MeshAtlas& atlas_;
  const std::vector<Rgb>& vertex_colors_;
  std::vector<int> on_page_;  // triangles
};

// Paints what lies between the charts, as wide as it is, like the nearest texel of a chart, and
// counts texels of charts (covered) and those that a photo sees.
void FinishPage(const TexelSource& texels, ColorGrid* page, double* num_texels, double* num_seen);

}  // namespace roomtex
