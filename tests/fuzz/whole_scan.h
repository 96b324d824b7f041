#pragma once
#include <cstdlib>

#include "core/scan.h"
#include "core/scan_mesh.h"

namespace roomtex {

// Ends the program unless all that the scan says of itself holds.
inline void RequireWhole(const Scan& scan) {
  const size_t cells = static_cast<size_t>(scan.num_columns) * scan.num_rows;
  if (scan.points.size() != cells || scan.intensity.size() != cells) std::abort();
  if (scan.NumMissing() == static_cast<int>(cells)) std::abort();
  for (size_t i = 0; i < cells; ++i) {
    const bool missing = scan.IsMissing(static_cast<int>(i));
    if (!missing && !scan.points[i].allFinite()) std::abort();
    if (missing && (scan.intensity[i] != 0 || scan.points[i].z() == scan.points[i].z()))
      std::abort();
  }
  for (const Triangle& triangle : BuildScanMesh(scan, {})) {
    for (const int corner : triangle) {
      if (corner < 0 || static_cast<size_t>(corner) >= cells || scan.IsMissing(corner))
        std::abort();
    }
  }
}

}  // namespace roomtex
