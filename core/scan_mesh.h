#pragma once
// Triangulation of the scan: neighbouring samples of the grid are connected (thesis 5.1.1), but not
// over a depth jump.

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

class OptionFields;

struct ScanMeshOptions {
  // An edge between neighbouring samples is dropped when it is longer than this many times the
  // distance that the same two rays span on a surface facing the scanner. 1 = only facing surfaces;
  // larger = more tolerant: 12 keeps walls seen at up to 85 degrees from their normal.
  double max_edge_ratio = 12.0;
  // An edge with a ratio above 3 is kept only if it continues the surface on one of its sides: the
  // step in inverse range may differ from the step beside it by this share of itself. Larger = more
  // tolerant.
  double max_bend = 0.5;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// Triangles whose corners index scan.points, front side (counter-clockwise) towards the scanner; a
// quad is split along its shorter diagonal, a quad with three good corners gives one triangle. Grid
// order. Steps within the noise of the ranges, which is estimated from the scan itself, are no
// depth jumps: near the scanner neighbouring samples lie closer together than their noise.
// A scan that is not organised gives back its own triangles.
// A scan of a full turn (first and last column are neighbours) is closed.
std::vector<Triangle> BuildScanMesh(const Scan& scan, const ScanMeshOptions& options);

// Unit normals, one per sample of the scan, area-weighted from the triangles; zero where no
// triangle is.
std::vector<Eigen::Vector3f> VertexNormals(const Scan& scan,
                                           const std::vector<Triangle>& triangles);

// Points spread evenly over the surface, with the normals of their triangles. At most max_count.
struct SurfaceProbes {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3f> normals;
};
SurfaceProbes SpreadProbes(const std::vector<Eigen::Vector3d>& points,
                           const std::vector<Triangle>& triangles, int max_count);

}  // namespace roomtex
