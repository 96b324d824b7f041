#include "core/scan.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/statistics.h"

namespace roomtex {

int Scan::NumMissing() const {
  int count = 0;
  for (size_t i = 0; i < points.size(); ++i) count += IsMissing(static_cast<int>(i));
  return count;
}

std::string ScanName(const std::vector<Scan>& scans, size_t index) {
  const Scan& scan = scans[index];
  const auto num_of_file = std::count_if(
      scans.begin(), scans.end(), [&scan](const Scan& other) { return other.path == scan.path; });
  return num_of_file == 1 ? scan.path : scan.path + "#" + std::to_string(scan.number_in_file);
}

Scan Thinned(const Scan& scan, int stride) {
  if (stride == 1 || scan.kind() == Scan::Kind::kMesh) return scan;
  Scan thin;
  thin.path = scan.path;
  thin.name = scan.name;
  thin.organised = scan.organised;
  thin.scan_from_station = scan.scan_from_station;
  thin.station_is_assumed = scan.station_is_assumed;
  thin.viewpoint = scan.viewpoint;
  thin.up = scan.up;
  thin.up_is_assumed = scan.up_is_assumed;
  thin.is_rtpi = scan.is_rtpi;
  thin.number_in_file = scan.number_in_file;
  thin.num_left_out = scan.num_left_out;
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

Eigen::Vector3d MirroredAt(const Rigid& scan_from_station, const Eigen::Vector3d& x_in_scan) {
  Eigen::Vector3d x_in_station = scan_from_station.Inverse() * x_in_scan;
  x_in_station.x() *= -1;
  return scan_from_station * x_in_station;
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

bool NeedsDouble(const Scan& scan) {
  const Bounds bounds = FindBounds(scan);
  if (!(bounds.min.x() <= bounds.max.x())) return false;
  return bounds.min.cwiseAbs().cwiseMax(bounds.max.cwiseAbs()).maxCoeff() > kLargeCoordinate;
}

uint8_t GreyScale::operator()(float intensity) const {
  const float range = high > low ? high - low : 1.0f;
  return static_cast<uint8_t>(std::lround(255 * std::clamp((intensity - low) / range, 0.0f, 1.0f)));
}

GreyScale FindGreyScale(std::vector<float> intensities, double low_percentile,
                        double high_percentile) {
  if (intensities.empty()) return {};
  const auto percentile = [&intensities](double percent) {
    const size_t rank = static_cast<size_t>(percent / 100.0 * (intensities.size() - 1) + 0.5);
    return AtRank(&intensities, rank);
  };
  const float low = percentile(low_percentile);
  return {low, percentile(high_percentile)};
}

std::vector<uint8_t> IntensityAsGrey(const Scan& scan, double low_percentile,
                                     double high_percentile) {
  const auto is_measured = [&scan](size_t i) {
    return !scan.IsMissing(static_cast<int>(i)) && std::isfinite(scan.intensity[i]);
  };
  std::vector<float> measured;
  measured.reserve(scan.points.size());
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (is_measured(i)) measured.push_back(scan.intensity[i]);
  }
  const GreyScale scale = FindGreyScale(std::move(measured), low_percentile, high_percentile);
  std::vector<uint8_t> grey(scan.points.size(), 0);
  for (size_t i = 0; i < grey.size(); ++i) {
    if (is_measured(i)) grey[i] = scale(scan.intensity[i]);
  }
  return grey;
}

}  // namespace roomtex
