#pragma once
// The directions of the samples of a simulated scan (thesis 5.1.1). Frame: `station` (x right, y
// up, z backward).

#include <Eigen/Core>

namespace roomtex {

// The grid of a station: theta increases with the column over the full turn, phi falls with the
// row.
struct ScanGrid {
  int num_columns = 0, num_rows = 0;
  static constexpr double kMinPhiDeg = -60, kMaxPhiDeg = 75;

  double Theta(int column) const;
  double Phi(int row) const;
  // Thesis 5.1.1: x = sin(theta) cos(phi), y = sin(phi), z = -cos(theta) cos(phi).
  static Eigen::Vector3d Direction(double theta, double phi);
  // Index of the sample whose direction is nearest to that of a point in `station`, -1 outside the
  // grid.
  int Nearest(const Eigen::Vector3d& x_in_station) const;
};

}  // namespace roomtex
