#pragma once
// What the colours of the vertices rest on, beside the model: evidence.ply.

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "texture/texels/colored_scan.h"

namespace roomtex {

struct Evidence {
  std::vector<Eigen::Vector3d> points;  // `scan` frame
  // One per point.
  std::vector<float> intensity;     // of the scan, in its unit
  std::vector<uint8_t> views;       // as ColorGrid::views
  std::vector<float> disagreement;  // ColoredScan::disagreement, 0-255; NaN = fewer than two photos
};

// Binary PLY cloud in the order of model.ply: x, y, z (float, or double where model.ply has
// double), intensity float, views uchar, disagreement float. Throws InputError if it cannot be
// written.
void WriteEvidence(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                   const std::string& path);
// What WriteEvidence wrote; throws InputError for anything else.
Evidence ReadEvidence(const std::string& path);

}  // namespace roomtex
