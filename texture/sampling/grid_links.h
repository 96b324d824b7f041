#pragma once
// Which samples of a scan's grid lie on one surface.

#include <cstdint>
#include <vector>

#include "core/scan.h"
#include "core/scan_mesh.h"

namespace roomtex {

// Neighbours in the grid that the mesh connects. Bit kRight of sample i: connected with the sample
// one column on (the last column with the first one when the scan is a full turn); kDown: one row
// on.
struct GridLinks {
  static constexpr uint8_t kRight = 1, kDown = 2;
  std::vector<uint8_t> bits;  // one per grid cell; all 0 for a mesh without a grid
};

GridLinks FindGridLinks(const Scan& scan, const std::vector<Triangle>& triangles);

}  // namespace roomtex
