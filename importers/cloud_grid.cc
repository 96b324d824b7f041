#include "importers/cloud_grid.h"

#include <algorithm>
#include <cmath>

#include <opencv2/core.hpp>

#include "core/decompositions.h"
#include "core/frames.h"
#include "core/resource_limits.h"

namespace roomtex {
namespace {

constexpr int kMostAngles = 200000;      // that the steps are found from
constexpr int kBins = 1 << 18;           // of the histogram whose periods are looked at
constexpr int kFewestLines = 8;          // slower changes are the room's
constexpr double kSteepest = 1.2;        // radians; nearer to the poles azimuths say little
constexpr double kCoherence = 0.6;       // share of the strongest period that is one, too
constexpr double kNearLine = 0.3;        // of a step
constexpr double kLeastNearLines = 0.9;  // share of the points
constexpr double kMostDoubled = 0.1;     // share of the points that may share a cell
constexpr double kMostCellsPerPoint = 64;
constexpr double kLeastBeside =
    0.5;  // share of the points that have one to the right and one below
constexpr double kFinestStep = 5e-6;  // radians; no scanner turns by less

struct Angles {
  double azimuth, elevation;
};

Angles AnglesOf(const Eigen::Vector3d& x_in_station) {
  return {std::atan2(x_in_station.y(), x_in_station.x()),
          std::atan2(x_in_station.z(), std::hypot(x_in_station.x(), x_in_station.y()))};
}

// Lines at first + k * step.
struct Lines {
  double first = 0, step = 0;

  double Place(double value) const { return (value - first) / step; }
};

// The strongest period of the values' density, from its Fourier transform over twice their span (so
// that periods between two frequencies are seen, too). None if there is none.
std::optional<Lines> StrongestPeriod(const std::vector<double>& values, double low, double span) {
  cv::Mat1f density(1, kBins, 0.0f);
  const double bins_per_unit = kBins / (2 * span);
  for (const double value : values) {
    const int bin = static_cast<int>((value - low) * bins_per_unit);
    density(0, std::clamp(bin, 0, kBins - 1)) += 1;
  }
  cv::Mat2f spectrum;
  cv::dft(density, spectrum, cv::DFT_COMPLEX_OUTPUT);
  const auto strength = [&](int k) { return std::hypot(spectrum(0, k)[0], spectrum(0, k)[1]); };
  float strongest = 0;
  for (int k = 2 * kFewestLines; k < kBins / 4; ++k) strongest = std::max(strongest, strength(k));
  // Lines have harmonics as strong as they are: the first peak counts.
  for (int k = 2 * kFewestLines; k < kBins / 4; ++k) {
    if (strength(k) < kCoherence * strongest || strength(k) < strength(k + 1)) continue;
    if (strength(k) < kCoherence * static_cast<double>(values.size())) return std::nullopt;
    const double phase = std::atan2(-spectrum(0, k)[1], spectrum(0, k)[0]) / (2 * kPi);
    const double step = 2 * span / k;
    return Lines{low + phase * step + 0.5 / bins_per_unit, step};
  }
  return std::nullopt;
}

// Least squares over the values that lie near a line.
Lines Refined(const std::vector<double>& values, Lines lines) {
  for (int round = 0; round < 4; ++round) {
    double n = 0, k1 = 0, k2 = 0, v1 = 0, kv = 0;
    const double centre = std::round(lines.Place(values[values.size() / 2]));
    for (const double value : values) {
      const double place = lines.Place(value), line = std::round(place);
      if (std::abs(place - line) > kNearLine) continue;
      const double k = line - centre;
      n += 1, k1 += k, k2 += k * k, v1 += value, kv += k * value;
    }
    const double spread = n * k2 - k1 * k1;
    if (!(spread > 0)) return lines;
    lines.step = (n * kv - k1 * v1) / spread;
    lines.first = (v1 - lines.step * k1) / n - lines.step * centre;
  }
  return lines;
}

std::optional<Lines> FindLines(std::vector<double> values) {
  if (values.size() < 4 * kFewestLines) return std::nullopt;
  std::sort(values.begin(), values.end());
  const double span = values.back() - values.front();
  if (!(span > 0)) return std::nullopt;
  const std::optional<Lines> lines = StrongestPeriod(values, values.front(), span);
  if (!lines) return std::nullopt;
  const Lines refined = Refined(values, *lines);
  const bool is_same = refined.step > 0.5 * lines->step && refined.step < 2 * lines->step;
  if (!is_same || !(refined.step > kFinestStep)) return std::nullopt;
  return refined;
}

// Where the widest gap between azimuths ends: there the columns begin.
double StartOfAzimuths(const std::vector<Angles>& angles) {
  constexpr int kDirections = 3600;
  std::vector<bool> is_seen(kDirections, false);
  const auto direction = [](double azimuth) {
    return std::clamp(static_cast<int>((azimuth + kPi) / (2 * kPi) * kDirections), 0,
                      kDirections - 1);
  };
  for (const Angles& a : angles) is_seen[static_cast<size_t>(direction(a.azimuth))] = true;
  int widest = 0, end = 0, gap = 0;
  for (int i = 0; i < 2 * kDirections; ++i) {
    gap = is_seen[static_cast<size_t>(i % kDirections)] ? 0 : gap + 1;
    if (gap > widest) widest = gap, end = i + 1;
  }
  return end * 2 * kPi / kDirections - kPi;
}

class GridFinder {
 public:
  GridFinder(const Scan& cloud, const Eigen::Vector3d& axis_in_station)
      : cloud_(cloud), upright_from_scan_(cloud.scan_from_station.Inverse()) {
    if (axis_in_station == Eigen::Vector3d::UnitZ()) return;
    const Rigid upright_from_station{RotationBetween(axis_in_station, Eigen::Vector3d::UnitZ()),
                                     Eigen::Vector3d::Zero()};
    upright_from_scan_ = upright_from_station * upright_from_scan_;
  }

  std::optional<Scan> Find() {
    if (!FindSteps() || !FindSize() || !IsDense()) return std::nullopt;
    return Fill();
  }

 private:
  Angles AnglesAt(size_t i) const { return AnglesOf(upright_from_scan_ * cloud_.points[i]); }
  // From where the columns begin, 0 to a full turn.
  double Turn(double azimuth) const {
    const double turn = std::fmod(azimuth - start_, 2 * kPi);
    return turn < 0 ? turn + 2 * kPi : turn;
  }

  bool FindSteps() {
    std::vector<Angles> angles;
    const size_t every = cloud_.points.size() / kMostAngles + 1;
    for (size_t i = 0; i < cloud_.points.size(); i += every) {
      const Angles a = AnglesAt(i);
      if (std::abs(a.elevation) < kSteepest) angles.push_back(a);
    }
    start_ = StartOfAzimuths(angles);
    std::vector<double> turns, elevations;
    for (const Angles& a : angles) {
      turns.push_back(Turn(a.azimuth));
      elevations.push_back(a.elevation);
    }
    const std::optional<Lines> columns = FindLines(std::move(turns));
    const std::optional<Lines> rows = FindLines(std::move(elevations));
    if (!columns || !rows) return false;
    columns_ = *columns;
    rows_ = *rows;
    return true;
  }

  // How many lines there are, and whether the points stand on them.
  bool FindSize() {
    const int per_turn = static_cast<int>(std::lround(2 * kPi / columns_.step));
    double lowest = 1e300, highest = -1e300, first = 1e300, last = -1e300;
    size_t num_near = 0, num_asked = 0;
    for (size_t i = 0; i < cloud_.points.size(); ++i) {
      const Angles a = AnglesAt(i);
      const double row = rows_.Place(a.elevation), column = columns_.Place(Turn(a.azimuth));
      lowest = std::min(lowest, std::round(row));
      highest = std::max(highest, std::round(row));
      first = std::min(first, std::round(column));
      last = std::max(last, std::round(column));
      if (std::abs(a.elevation) >= kSteepest) continue;
      ++num_asked;
      num_near += std::abs(row - std::round(row)) < kNearLine &&
                  std::abs(column - std::round(column)) < kNearLine;
    }
    const double num_rows = highest - lowest + 1;
    const double num_columns = std::min<double>(last - first + 1, per_turn);
    if (!(num_rows * num_columns <=
          std::min(kMostCellsPerPoint * static_cast<double>(cloud_.points.size()), 2e9))) {
      return false;
    }
    top_ = highest;
    first_column_ = first;
    num_rows_ = static_cast<int>(num_rows);
    num_columns_ = static_cast<int>(num_columns);
    return static_cast<double>(num_near) >= kLeastNearLines * static_cast<double>(num_asked);
  }

  size_t NumCells() const {
    return static_cast<size_t>(num_rows_) * static_cast<size_t>(num_columns_);
  }
  // Row by row, as Scan::Index().
  size_t CellOf(size_t i) const {
    const Angles a = AnglesAt(i);
    const auto row = static_cast<size_t>(top_ - std::round(rows_.Place(a.elevation)));
    const int column =
        static_cast<int>(std::round(columns_.Place(Turn(a.azimuth))) - first_column_) %
        num_columns_;
    return row * static_cast<size_t>(num_columns_) + static_cast<size_t>(column);
  }

  // Points that were drawn from a scan at random stand on its lines, but a mesh of their grid would
  // be nothing but holes.
  bool IsDense() const {
    std::vector<bool> is_measured(NumCells(), false);
    for (size_t i = 0; i < cloud_.points.size(); ++i) is_measured[CellOf(i)] = true;
    const auto width = static_cast<size_t>(num_columns_);
    size_t count = 0, num_beside = 0;
    for (size_t cell = 0; cell < is_measured.size(); ++cell) {
      if (!is_measured[cell]) continue;
      ++count;
      const bool has_right = (cell + 1) % width != 0 && is_measured[cell + 1];
      num_beside += has_right && cell + width < is_measured.size() && is_measured[cell + width];
    }
    return static_cast<double>(num_beside) >= kLeastBeside * static_cast<double>(count);
  }

  std::optional<Scan> Fill() const {
    const size_t cells = NumCells();
    RequireMemoryForSamples(cloud_.path, static_cast<double>(cells));
    Scan scan = cloud_;
    scan.organised = true;
    scan.num_rows = num_rows_;
    scan.num_columns = num_columns_;
    scan.points.assign(cells, Scan::MissingPoint());
    scan.intensity.assign(cells, 0.0f);
    scan.normals.clear();
    scan.num_left_out = 0;  // they have no sample in the grid
    if (!cloud_.colors.empty()) scan.colors.assign(cells, {0, 0, 0});
    size_t num_doubled = 0;
    for (size_t i = 0; i < cloud_.points.size(); ++i) {
      const size_t cell = CellOf(i);
      if (!scan.IsMissing(static_cast<int>(cell))) {
        ++num_doubled;
        continue;
      }
      scan.points[cell] = cloud_.points[i];
      scan.intensity[cell] = cloud_.intensity[i];
      if (!scan.colors.empty()) scan.colors[cell] = cloud_.colors[i];
    }
    if (static_cast<double>(num_doubled) >
        kMostDoubled * static_cast<double>(cloud_.points.size())) {
      return std::nullopt;
    }
    return scan;
  }

  const Scan& cloud_;
  Rigid upright_from_scan_;  // the axis is z
  double start_ = 0;         // azimuth
  Lines rows_, columns_;
  double top_ = 0, first_column_ = 0;
  int num_rows_ = 0, num_columns_ = 0;
};

}  // namespace

std::optional<Scan> GridFromCloud(const Scan& cloud, const Eigen::Vector3d& axis_in_station) {
  return GridFinder(cloud, axis_in_station).Find();
}

}  // namespace roomtex
