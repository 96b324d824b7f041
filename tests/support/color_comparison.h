#pragma once
// Colours of a textured scan against the truth, vertex by vertex.

#include <string>
#include <vector>

#include "core/report.h"
#include "core/scan.h"
#include "tests/support/ply_vertices.h"

namespace roomtex {

// What the comparison means by its words; sample = vertex of the scan.
struct ColorMeasures {
  // Two neighbours of the grid have a depth jump between them when their ranges differ by more than
  // this share, or when one of them is missing. Samples within `edge_samples` columns and rows of
  // either side are near an edge.
  static constexpr double kJump = 0.03;
  static constexpr int kEdgeSamples = 2;
  // Detail = sRGB value minus its Gaussian mean with this sigma, samples that are coloured and not
  // near an edge only. slope: of the regression of the result's detail on the truth's, all channels
  // together; correlation: Pearson's.
  static constexpr double kDetailSigma = 2;
  // Low-frequency error: RMS of the Gaussian mean (this sigma) of result minus truth.
  static constexpr double kLowSigma = 8;
  // A vertex is wrong when a channel is off by more than this (sRGB 0..1).
  static constexpr double kWrong = 0.1;
};

// truth: truth/true_colors.ply; model: same vertices, as roomtex-texture writes them. scans: in the
// same order; empty = no measures that need the grid. of_cells: compare with the truth's colours
// averaged over the samples' cells instead of those at the points. One gain (linear light, all
// channels) is fitted first: the brightness is free, the balance is not. The error image (per
// sample of the first scan, largest channel) goes to error_path unless that is "".
// Keys: num_vertices, num_colored, coverage, coverage_of_seen, gain, psnr_db, psnr_linear_db,
// median_difference, share_wrong, edge_share, edge_share_wrong, edge_psnr_db, detail_slope,
// detail_correlation, low_frequency_error, vertex_distance_max_m.
Json CompareColors(const PlyVertices& truth, const PlyVertices& model,
                   const std::vector<Scan>& scans, bool of_cells, const std::string& model_path,
                   const std::string& error_path);

// 1 = near a depth edge; one per sample.
std::vector<uint8_t> NearDepthEdges(const Scan& scan);

}  // namespace roomtex
