#pragma once
// The large planes of the scan (thesis 7.2, "detect large planes by PCA"), as bounded patches.

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

struct ScanPlane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();   // centre of gravity of its samples, `scan`
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // unit length, towards the scanner
  double rms = 0;      // of its samples' distances from it, metres: what the range noise leaves
  double area_m2 = 0;  // of the surface that its samples cover, without holes
  int num_samples = 0;

  // Where the plane has samples, as cells of a grid on it. Axes u, v: unit length, right-handed
  // with the normal; cell (i, j) covers cell_size * [i, i + 1) x [j, j + 1) of (u, v) coordinates
  // relative to `point`, shifted by min_cell.
  Eigen::Vector3d u = Eigen::Vector3d::Zero(), v = Eigen::Vector3d::Zero();
  double cell_size = 0;                                // metres
  Eigen::Vector2i min_cell = Eigen::Vector2i::Zero();  // cell of covered(0, 0)
  Eigen::Array<uint8_t, Eigen::Dynamic, Eigen::Dynamic> covered;  // rows along u, columns along v

  // Signed distance, metres, positive on the scanner's side.
  double Distance(const Eigen::Vector3d& x_in_scan) const { return normal.dot(x_in_scan - point); }
  // Whether the foot of x on the plane lies on a covered cell or at most one cell beside one.
  bool Covers(const Eigen::Vector3d& x_in_scan) const;
};

}  // namespace roomtex
