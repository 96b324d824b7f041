#pragma once
// Lines on the scan that a photo shows as well: rims of surfaces, creases, and steps of the
// intensity. Frame: `scan`. A crease is where two fitted surfaces meet, exact to a tenth of a step
// between samples; rims and steps of the intensity lie somewhere between two samples.

#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

struct ScanEdge {
  enum class Kind {
    kDepth,      // the rim of a surface in front of another
    kCrease,     // where two smooth surfaces meet
    kIntensity,  // a step of the intensity on a smooth surface
  };
  Kind kind = Kind::kDepth;
  std::vector<Eigen::Vector3d> points;  // a polyline
};

struct ScanEdgeOptions {
  int crease_window = 8;          // samples on either side that fix the two surfaces
  double min_crease_deg = 20;     // creases flatter than this are left out
  double min_step = 0.004;        // share of the range; smaller steps of the depth are left out
  double min_significance = 6;    // standard deviations of the noise that an edge must stand out
  double min_intensity_step = 4;  // grey levels of 255 per sample
  int min_length = 6;             // samples; shorter edges are left out
};

// Along every row and every column of the grid the edges that cross it, linked from line to line
// and smoothed along the link. None in a mesh without a grid (see ScanFromPhoto in overlay.h).
std::vector<ScanEdge> FindScanEdges(const Scan& scan, const ScanEdgeOptions& options);

}  // namespace roomtex
