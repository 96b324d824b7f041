#pragma once
// What roomtex-texture left of evidence: every sample of the scan, how many photos saw it, and how
// far they disagree.

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace roomtex {

struct EvidencePoint {
  Eigen::Vector3d x_in_scan;
  uint8_t views = 0;       // photos that see it
  float disagreement = 0;  // levels of 0-255; NaN = fewer than two photos
};

// Throws InputError for what is no evidence.ply.
std::vector<EvidencePoint> ReadEvidencePoints(const std::string& path);

}  // namespace roomtex
