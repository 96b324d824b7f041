// RTPI to the organised scan and back: ScanFromRtpi, RtpiFromScan, WriteColoredRtpi (rtpi.h).

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/decompositions.h"
#include "core/error.h"
#include "core/frames.h"
#include "core/statistics.h"
#include "core/text.h"
#include "importers/length_unit.h"
#include "importers/rtpi.h"
#include "importers/rtpi_grid.h"

namespace roomtex {
namespace {

double FindMetersPerUnit(const RtpiFile& file, const RtpiScanOptions& options,
                         std::vector<std::string>* notes) {
  if (options.meters_per_unit > 0) return options.meters_per_unit;
  if (file.header.units.empty()) {
    notes->push_back("the header names no unit: metres assumed (--units says another)");
    return 1;
  }
  const std::optional<double> meters = MetersPerUnit(file.header.units);
  if (meters) return *meters;
  throw InputError(
      file.path, "",
      "its header names the unit " + Quoted(file.header.units) + ", which is not known",
      "Say the unit with --units");
}

// The columns [begin, begin + kBlock) of the grid. The grid is stored row by row, the file column
// by column: blocks keep the writes near each other.
class ColumnBlock {
 public:
  static constexpr int kBlock = 16;

  explicit ColumnBlock(int num_rows)
      : points_(static_cast<size_t>(num_rows) * kBlock), intensity_(points_.size()) {}

  void Set(int column, int row, const Eigen::Vector3d& point, float intensity) {
    points_[static_cast<size_t>(row) * kBlock + column] = point;
    intensity_[static_cast<size_t>(row) * kBlock + column] = intensity;
  }
  void CopyTo(int begin, int num_columns, Scan* scan) const {
    for (int row = 0; row < scan->num_rows; ++row) {
      const size_t from = static_cast<size_t>(row) * kBlock;
      const size_t to = static_cast<size_t>(scan->Index(begin, row));
      std::copy_n(&points_[from], num_columns, &scan->points[to]);
      std::copy_n(&intensity_[from], num_columns, &scan->intensity[to]);
    }
  }

 private:
  std::vector<Eigen::Vector3d> points_;
  std::vector<float> intensity_;
};

// Thesis 5.1.1: x = sin(theta) cos(phi) r, y = sin(phi) r, z = -cos(theta) cos(phi) r; x turned
// over for azimuths that count counter-clockwise (manual 15.2).
Eigen::Vector3d PointFromAngles(double range, double theta, double phi, double azimuth_sign) {
  const double horizontal = std::cos(phi) * range;
  return {azimuth_sign * std::sin(theta) * horizontal, std::sin(phi) * range,
          -std::cos(theta) * horizontal};
}

void CheckAnyMeasured(const RtpiFile& file, const Scan& scan, double max_range) {
  for (const Eigen::Vector3d& point : scan.points) {
    if (point.x() == point.x()) return;
  }
  throw InputError(
      file.path, "",
      "holds no sample within the largest range of " + Significant(max_range, 6) + " m",
      "Give a larger --max_range or another --units");
}

// How intensities of a scan become the integers of RTPI.
struct IntensityRule {
  double offset = 0, factor = 1;
  std::string comment;  // "" = they stay

  int32_t operator()(double intensity) const {
    const double value = std::isfinite(intensity) ? (intensity - offset) * factor : 0;
    return static_cast<int32_t>(std::lround(std::clamp(value, -2147483648.0, 2147483647.0)));
  }
};

IntensityRule FindIntensityRule(const Scan& scan) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  bool integers = true;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    const double intensity = scan.intensity[i];
    if (scan.IsMissing(static_cast<int>(i)) || !std::isfinite(intensity)) continue;
    low = std::min(low, intensity);
    high = std::max(high, intensity);
    integers = integers && intensity == std::round(intensity) && std::abs(intensity) < 2147483648.0;
  }
  IntensityRule rule;
  if (!(low <= high) || (integers && (scan.is_rtpi || high > 1))) return rule;
  if (low >= 0 && high <= 1) {
    rule.factor = 65535;
    rule.comment = "# intensity: 65535 x the intensity 0..1 of the source";
  } else {
    rule.offset = low;
    rule.factor = high > low ? 65535 / (high - low) : 1;
    rule.comment = "# intensity: 0..65535 for " + std::to_string(low) + " to " +
                   std::to_string(high) + " of the source";
  }
  return rule;
}

// Extents and densities of the samples for the header.
void DescribeAngles(const std::vector<double>& theta_of_cell,
                    const std::vector<double>& phi_of_cell, const Scan& scan, RtpiHeader* header) {
  double az_low = std::numeric_limits<double>::infinity(), az_high = -az_low;
  double n = 0, k1 = 0, k2 = 0, p1 = 0, kp = 0;
  std::vector<double> az_steps;
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      const int cell = scan.Index(column, row);
      const double theta = theta_of_cell[cell], phi = phi_of_cell[cell];
      if (!(theta == theta)) continue;
      az_low = std::min(az_low, theta);
      az_high = std::max(az_high, theta);
      n += 1, k1 += row, k2 += static_cast<double>(row) * row, p1 += phi, kp += row * phi;
      if (column > 0 && theta_of_cell[cell - 1] == theta_of_cell[cell - 1]) {
        az_steps.push_back(std::abs(std::remainder(theta - theta_of_cell[cell - 1], 2 * kPi)));
      }
    }
  }
  if (!(n > 0)) return;
  header->az_fov = {DegFromRad(az_low), DegFromRad(az_high)};
  if (!az_steps.empty()) {
    const double step = Median(&az_steps);
    if (step > 1e-9) header->samples_per_degree_az = 1 / DegFromRad(step);
  }
  const double spread = n * k2 - k1 * k1;
  if (!(spread > 0)) return;
  const double slope = (n * kp - k1 * p1) / spread, top = (p1 - slope * k1) / n;
  if (!(std::abs(slope) > 1e-9)) return;
  // Only rows of even elevation can be said in a header: then missing rows are found again on
  // reading.
  for (int cell = 0; cell < static_cast<int>(phi_of_cell.size()); ++cell) {
    const double residual = phi_of_cell[cell] - (top + slope * (cell / scan.num_columns));
    if (std::abs(residual) > 0.5 * std::abs(slope)) return;
  }
  const double bottom = top + slope * (scan.num_rows - 1);
  header->el_fov = {DegFromRad(std::min(top, bottom)), DegFromRad(std::max(top, bottom))};
  header->samples_per_degree_el = 1 / std::abs(DegFromRad(slope));
  header->max_samples_per_column = scan.num_rows;
}

// Colour samples have one byte of intensity.
struct ByteRule {
  double offset = 0, factor = 1;
  std::string comment;
};

ByteRule FindByteRule(const RtpiFile& file) {
  ByteRule rule;
  if (file.header.has_color) return rule;
  double low = 0, high = 0;
  for (const RtpiSample& sample : file.samples) {
    low = std::min<double>(low, sample.Intensity(false));
    high = std::max<double>(high, sample.Intensity(false));
  }
  if (low >= 0 && high <= 255) return rule;
  rule.offset = low;
  rule.factor = 255 / (high - low);
  rule.comment = "# intensity: 0..255 for " + std::to_string(static_cast<int64_t>(low)) + " to " +
                 std::to_string(static_cast<int64_t>(high)) + " before the colouring";
  return rule;
}

}  // namespace

Scan ScanFromRtpi(const RtpiFile& file, const RtpiScanOptions& options,
                  std::vector<std::string>* notes) {
  std::vector<std::string> ignored;
  if (notes == nullptr) notes = &ignored;
  const double meters_per_unit = FindMetersPerUnit(file, options, notes);
  double max_range = std::numeric_limits<double>::infinity();  // in the unit of the file
  if (options.max_range > 0) {
    max_range = options.max_range / meters_per_unit;
  } else if (file.header.max_range) {
    max_range = *file.header.max_range;
  }
  const RtpiGrid grid = FindRtpiGrid(file);
  notes->insert(notes->end(), grid.notes.begin(), grid.notes.end());

  Scan scan;
  scan.path = file.path;
  scan.is_rtpi = true;
  scan.num_columns = grid.num_columns;
  scan.num_rows = grid.num_rows;
  // Columns of few samples, far apart, make a grid much larger than the file.
  RequireMemoryForSamples(file.path, static_cast<double>(grid.num_columns) * grid.num_rows);
  scan.points.resize(static_cast<size_t>(grid.num_columns) * grid.num_rows);
  scan.intensity.resize(scan.points.size());
  const double azimuth_sign = options.counterclockwise ? -1 : 1;
  const bool has_colors = options.colors && file.header.has_color;
  if (has_colors) scan.colors.assign(scan.points.size(), {0, 0, 0});
  RtpiColumnRows rows(file, grid);
  ColumnBlock block(grid.num_rows);
  for (int begin = 0; begin < grid.num_columns; begin += ColumnBlock::kBlock) {
    const int num_columns = std::min(ColumnBlock::kBlock, grid.num_columns - begin);
    for (int k = 0; k < num_columns; ++k) {
      rows.GoTo(begin + k);
      for (int row = 0; row < grid.num_rows; ++row) {
        const int64_t index = rows.SampleAt(row);
        if (index < 0 || static_cast<double>(file.samples[index].range) > max_range) {
          block.Set(k, row, Scan::MissingPoint(), 0);
          continue;
        }
        const RtpiSample& sample = file.samples[index];
        if (has_colors) {
          scan.colors[static_cast<size_t>(scan.Index(begin + k, row))] = {
              static_cast<uint8_t>(sample.value), static_cast<uint8_t>(sample.value >> 8),
              static_cast<uint8_t>(sample.value >> 16)};
        }
        block.Set(
            k, row,
            PointFromAngles(sample.range * meters_per_unit, sample.theta, sample.phi, azimuth_sign),
            static_cast<float>(sample.Intensity(file.header.has_color)));
      }
    }
    block.CopyTo(begin, num_columns, &scan);
  }
  if (rows.num_displaced() > 0) {
    notes->push_back(std::to_string(rows.num_displaced()) + " of " +
                     std::to_string(file.samples.size()) +
                     " samples lie in a row with another one and are left out");
  }
  CheckAnyMeasured(file, scan, max_range * meters_per_unit);
  return scan;
}

RtpiFile RtpiFromScan(const Scan& scan, bool counterclockwise) {
  if (!scan.organised) throw std::invalid_argument("RtpiFromScan needs an organised scan");
  const Rigid station_from_scan = scan.scan_from_station.Inverse();
  const Eigen::Vector3d up_in_station = station_from_scan.rotation * scan.up;
  const Rigid rtpi_from_station{RotationBetween(up_in_station, Eigen::Vector3d::UnitY()),
                                Eigen::Vector3d::Zero()};
  const Rigid rtpi_from_scan = rtpi_from_station * station_from_scan;
  const bool stays = rtpi_from_scan.translation.isZero(0) &&
                     rtpi_from_scan.rotation.isApprox(Eigen::Quaterniond::Identity(), 1e-15);
  const IntensityRule rule = FindIntensityRule(scan);

  RtpiFile file;
  file.header.units = "meters";
  file.header.device = {kModelRoomtex};
  file.header.comments.push_back(
      AzimuthComment(counterclockwise ? "counterclockwise" : "clockwise"));
  if (!rule.comment.empty()) file.header.comments.push_back(rule.comment);
  if (!stays) file.header.comments.push_back("# frame: the scanner's own, y up");
  std::vector<double> theta_of_cell(scan.points.size(), std::numeric_limits<double>::quiet_NaN());
  std::vector<double> phi_of_cell = theta_of_cell;
  for (int column = 0; column < scan.num_columns; ++column) {
    for (int row = scan.num_rows - 1; row >= 0; --row) {
      const int cell = scan.Index(column, row);
      if (scan.IsMissing(cell)) continue;
      const Eigen::Vector3d point = stays ? scan.points[cell] : rtpi_from_scan * scan.points[cell];
      const double horizontal = std::hypot(point.x(), point.z());
      const double theta = std::atan2(counterclockwise ? -point.x() : point.x(), -point.z());
      const double phi = std::atan2(point.y(), horizontal);
      theta_of_cell[cell] = theta;
      phi_of_cell[cell] = phi;
      file.samples.push_back({static_cast<float>(point.norm()), static_cast<float>(theta),
                              static_cast<float>(phi),
                              static_cast<uint32_t>(rule(scan.intensity[cell]))});
    }
    file.column_begin.push_back(static_cast<int64_t>(file.samples.size()));
  }
  DescribeAngles(theta_of_cell, phi_of_cell, scan, &file.header);
  return file;
}

void WriteColoredRtpi(const std::string& input_path,
                      const std::vector<Eigen::Matrix<uint8_t, 3, 1>>& colors,
                      const std::string& output_path) {
  RtpiFile file = ReadRtpi(input_path);
  const RtpiGrid grid = FindRtpiGrid(file);
  if (colors.size() != static_cast<size_t>(grid.num_columns) * grid.num_rows) {
    throw std::invalid_argument("WriteColoredRtpi: not one colour per cell of the grid");
  }
  const ByteRule rule = FindByteRule(file);
  RtpiColumnRows rows(file, grid);
  for (int column = 0; column < grid.num_columns; ++column) {
    rows.GoTo(column);
    for (int64_t k = 0; k < rows.num_samples(); ++k) {
      RtpiSample& sample = file.samples[rows.first_sample() + k];
      const int row = rows.RowOf(k);
      Eigen::Matrix<uint8_t, 3, 1> rgb = Eigen::Matrix<uint8_t, 3, 1>::Zero();
      if (row >= 0) rgb = colors[static_cast<size_t>(row) * grid.num_columns + column];
      const double scaled = (sample.Intensity(file.header.has_color) - rule.offset) * rule.factor;
      const auto intensity = static_cast<uint32_t>(std::lround(std::clamp(scaled, 0.0, 255.0)));
      sample.value = static_cast<uint32_t>(rgb[0]) | static_cast<uint32_t>(rgb[1]) << 8 |
                     static_cast<uint32_t>(rgb[2]) << 16 | intensity << 24;
    }
  }
  file.header.version = 3;
  file.header.has_color = true;
  file.header.comments.push_back("# color: mapped from photos by roomtex");
  if (!rule.comment.empty()) file.header.comments.push_back(rule.comment);
  WriteRtpi(file, output_path);
}

}  // namespace roomtex
