#pragma once
#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Core>

namespace roomtex {

// A cube of the scan, counted from its origin.
using ScanCell = std::array<int, 3>;

// The cube with edges of `size` metres in which x lies; beyond 2 * 10^9 cubes all are one.
inline ScanCell ScanCellOf(const Eigen::Vector3d& x_in_scan, double size) {
  ScanCell cell;
  for (int k = 0; k < 3; ++k) {
    cell[k] = static_cast<int>(std::clamp(std::floor(x_in_scan[k] / size), -2e9, 2e9));
  }
  return cell;
}

}  // namespace roomtex
