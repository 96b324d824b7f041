#pragma once
// Nearly plane, connected regions of a triangle mesh.

#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

struct ChartOptions {
  // Angle between a triangle and the one that its chart grew from, degrees. Larger = fewer charts,
  // more stretched: 40 stretches by up to 1.3.
  double max_angle_deg = 40;
  // Longest side of a chart's bounding box, metres.
  double max_extent = 1e9;
  // Metres; triangles with a mean side below this get the mean normal of their surroundings,
  // because the noise of dense meshes would make a chart of every few triangles.
  double smooth_below = 0;
};

struct MeshCharts {
  std::vector<int> chart_of;             // per triangle; -1 = it has no area
  std::vector<Eigen::Vector3d> normals;  // per chart, unit
};

// Grown over edges that exactly two triangles share, from the largest triangles. Any triangles will
// do: degenerate, non-manifold, turned against each other.
MeshCharts GrowCharts(const std::vector<Eigen::Vector3d>& points,
                      const std::vector<Triangle>& triangles, const ChartOptions& options);

}  // namespace roomtex
