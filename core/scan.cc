#include "core/scan.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/statistics.h"

namespace roomtex {

int Scan::NumMissing() const {
  int count = 0;
  for (size_t i = 0; i < points.size(); ++i) count += IsMissing(static_cast<int>(i));
  return count;
}

Scan Thinned(const Scan& scan, int stride) {
  if (stride == 1 || scan.kind() == Scan::Kind::kMesh) return scan;
  Scan thin;
  thin.path = scan.path;
  thin.name = scan.name;
  thin.organised = scan.organised;
  thin.scan_from_station = scan.scan_from_station;
  thin.up = scan.up;
  thin.up_is_assumed = scan.up_is_assumed;
  thin.is_rtpi = scan.is_rtpi;
  const int column_stride = scan.organised ? stride : stride * stride;
  thin.num_columns = (scan.num_columns + column_stride - 1) / column_stride;
  thin.num_rows = (scan.num_rows + stride - 1) / stride;
  thin.points.reserve(static_cast<size_t>(thin.num_columns) * thin.num_rows);
  thin.intensity.reserve(thin.points.capacity());
  for (int row = 0; row < scan.num_rows; row += stride) {
    for (int column = 0; column < scan.num_columns; column += column_stride) {
      const int index = scan.Index(column, row);
      thin.points.push_back(scan.points[index]);
      thin.intensity.push_back(scan.intensity[index]);
      if (!scan.colors.empty()) thin.colors.push_back(scan.colors[index]);
      if (!scan.normals.empty()) thin.normals.push_back(scan.normals[index]);
    }
  }
  return thin;
}

Bounds FindBounds(const Scan& scan) {
  Bounds bounds;
  for (const Eigen::Vector3d& point : scan.points) {
    if (!(point.x() == point.x())) continue;
    bounds.min = bounds.min.cwiseMin(point);
    bounds.max = bounds.max.cwiseMax(point);
  }
  return bounds;
}

std::vector<uint8_t> IntensityAsGrey(const Scan& scan, double low_percentile,
                                     double high_percentile) {
  std::vector<float> measured;
  measured.reserve(scan.points.size());
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (!scan.IsMissing(static_cast<int>(i)) && std::isfinite(scan.intensity[i])) {
      measured.push_back(scan.intensity[i]);
    }
  }
  std::vector<uint8_t> grey(scan.points.size(), 0);
  if (measured.empty()) return grey;
  const auto percentile = [&measured](double percent) {
    const size_t rank = static_cast<size_t>(percent / 100.0 * (measured.size() - 1) + 0.5);
    return AtRank(&measured, rank);
  };
  const float low = percentile(low_percentile);
  const float high = percentile(high_percentile);
  const float range = high > low ? high - low : 1.0f;
  for (size_t i = 0; i < grey.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i)) || !std::isfinite(scan.intensity[i])) continue;
    const float value = std::clamp((scan.intensity[i] - low) / range, 0.0f, 1.0f);
    grey[i] = static_cast<uint8_t>(std::lround(255 * value));
  }
  return grey;
}

}  // namespace roomtex
