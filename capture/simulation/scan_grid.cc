#include "capture/simulation/scan_grid.h"

#include <algorithm>
#include <cmath>

#include "core/frames.h"

namespace roomtex {

double ScanGrid::Theta(int column) const { return kPi * (2 * (column + 0.5) / num_columns - 1); }

double ScanGrid::Phi(int row) const {
  return RadFromDeg(kMaxPhiDeg - (kMaxPhiDeg - kMinPhiDeg) * (row + 0.5) / num_rows);
}

Eigen::Vector3d ScanGrid::Direction(double theta, double phi) {
  return {std::sin(theta) * std::cos(phi), std::sin(phi), -std::cos(theta) * std::cos(phi)};
}

int ScanGrid::Nearest(const Eigen::Vector3d& x) const {
  const double theta = std::atan2(x.x(), -x.z());
  const double phi_deg = DegFromRad(std::atan2(x.y(), std::hypot(x.x(), x.z())));
  const int column = static_cast<int>(std::floor((theta / kPi + 1) / 2 * num_columns));
  const int row =
      static_cast<int>(std::floor((kMaxPhiDeg - phi_deg) / (kMaxPhiDeg - kMinPhiDeg) * num_rows));
  if (row < 0 || row >= num_rows) return -1;
  return row * num_columns + std::clamp(column, 0, num_columns - 1);
}

}  // namespace roomtex
