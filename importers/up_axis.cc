#include "importers/up_axis.h"

#include <algorithm>
#include <cmath>

namespace roomtex {
namespace {

// Share of the variance of the elevation over `up` that the row alone explains, with the elevation
// falling from row to row; 0 when it does not fall.
double ExplainedByRow(const Scan& scan, const Eigen::Vector3d& up, int every) {
  double n = 0, k1 = 0, k2 = 0, e1 = 0, e2 = 0, ke = 0;
  for (int row = 0; row < scan.num_rows; row += every) {
    for (int column = 0; column < scan.num_columns; column += every) {
      const int index = scan.Index(column, row);
      if (scan.IsMissing(index)) continue;
      const Eigen::Vector3d offset = scan.points[index] - scan.Station();
      const double range = offset.norm();
      if (!(range > 0)) continue;
      const double elevation = std::asin(std::clamp(offset.dot(up) / range, -1.0, 1.0));
      n += 1, k1 += row, k2 += static_cast<double>(row) * row;
      e1 += elevation, e2 += elevation * elevation, ke += row * elevation;
    }
  }
  const double covariance = n * ke - k1 * e1;
  const double variances = (n * k2 - k1 * k1) * (n * e2 - e1 * e1);
  if (!(n >= 16) || !(variances > 0) || covariance >= 0) return 0;
  return covariance * covariance / variances;
}

}  // namespace

Eigen::Vector3d FindUpAxis(const Scan& scan) {
  if (!scan.organised || scan.num_rows < 4) return Eigen::Vector3d::UnitZ();
  const double cells = static_cast<double>(scan.num_columns) * scan.num_rows;
  const int every = std::max(1, static_cast<int>(std::sqrt(cells / 1e5)));
  const double over_y = ExplainedByRow(scan, Eigen::Vector3d::UnitY(), every);
  const double over_z = ExplainedByRow(scan, Eigen::Vector3d::UnitZ(), every);
  return over_y > 0.98 && over_z < 0.9 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
}

}  // namespace roomtex
