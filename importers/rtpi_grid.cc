#include "importers/rtpi_grid.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include "core/error.h"
#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr size_t kEnoughSamples = 50000;  // looked at for the spacing of the rows

// For messages: where sample number `index` of the file, one of `column`, begins.
std::string SamplePosition(const RtpiFile& file, int column, int64_t index) {
  return BytePosition(file.body_offset + 4 * static_cast<int64_t>(column + 1) + 16 * index) +
         " (column " + std::to_string(column) + ", sample " +
         std::to_string(index - file.column_begin[column]) + ")";
}

struct PhiRange {
  float low = std::numeric_limits<float>::infinity();
  float high = -std::numeric_limits<float>::infinity();
  int64_t num_measured = 0;
};

// Checks the angles of all measured samples.
PhiRange CheckAngles(const RtpiFile& file) {
  constexpr float kLargestTheta = static_cast<float>(4 * kPi);  // az_fov may run past a turn
  constexpr float kLargestPhi = static_cast<float>(kPi);        // some heads turn over the top
  PhiRange range;
  for (int column = 0; column < file.NumColumns(); ++column) {
    for (int64_t i = file.column_begin[column]; i < file.column_begin[column + 1]; ++i) {
      const RtpiSample& sample = file.samples[i];
      if (!IsMeasured(sample)) continue;
      if (!(std::abs(sample.theta) <= kLargestTheta) || !(std::abs(sample.phi) <= kLargestPhi)) {
        throw InputError(file.path, SamplePosition(file, column, i),
                         "azimuth " + std::to_string(sample.theta) + " and elevation " +
                             std::to_string(sample.phi) + " are no angles in radians",
                         "The file is damaged");
      }
      range.low = std::min(range.low, sample.phi);
      range.high = std::max(range.high, sample.phi);
      ++range.num_measured;
    }
  }
  if (range.num_measured == 0) {
    throw InputError(
        file.path, "",
        "holds no measured sample (of " + std::to_string(file.samples.size()) + " samples)",
        "Give a scan with at least one range above 0");
  }
  return range;
}

// Steps of phi between successive measured samples, from columns spread over the scan.
std::vector<double> ElevationSteps(const RtpiFile& file) {
  const int64_t every = 1 + static_cast<int64_t>(file.samples.size() / kEnoughSamples);
  std::vector<double> steps;
  for (int64_t column = 0; column < file.NumColumns(); column += every) {
    double last = std::numeric_limits<double>::quiet_NaN();
    for (int64_t i = file.column_begin[column]; i < file.column_begin[column + 1]; ++i) {
      if (!IsMeasured(file.samples[i])) continue;
      const double phi = file.samples[i].phi;
      if (std::abs(phi - last) > 1e-7) steps.push_back(std::abs(phi - last));
      last = phi;
    }
  }
  return steps;
}

// Mean step per row over the steps of a few rows; `spacing` is the first guess.
double RefinedSpacing(const std::vector<double>& steps, double spacing) {
  for (int round = 0; round < 3; ++round) {
    double sum = 0, num_rows = 0;
    for (const double step : steps) {
      const double rows = std::round(step / spacing);
      if (rows < 1 || rows > 8 || std::abs(step / spacing - rows) > 0.3) continue;
      sum += step;
      num_rows += rows;
    }
    if (num_rows > 0) spacing = sum / num_rows;
  }
  return spacing;
}

// Least-squares line phi = *offset + *spacing * row through the elevations in [begin, end), each
// taken to the nearest row of the line before. False, and nothing changed, if that is no line of
// even rows.
bool FitLine(const double* begin, const double* end, double* offset, double* spacing) {
  double n = 0, k1 = 0, k2 = 0, p1 = 0, kp = 0;
  for (const double* phi = begin; phi != end; ++phi) {
    const double p = *phi - *offset, k = std::round(p / *spacing);
    n += 1, k1 += k, k2 += k * k, p1 += p, kp += k * p;
  }
  const double spread = n * k2 - k1 * k1;
  if (!(spread > 0)) return false;
  const double slope = (n * kp - k1 * p1) / spread;
  if (!(std::abs(slope / *spacing - 1) < 0.05)) return false;
  *offset += (p1 - slope * k1) / n;
  *spacing = slope;
  return true;
}

// Row spacing and a row's position (phi = offset + spacing * integer). A small error of the first
// guess adds up to several rows over a column, so the fit begins with a few rows and widens as it
// gets better.
void FitRows(const RtpiFile& file, double* spacing, double* offset) {
  const int64_t every = 1 + static_cast<int64_t>(file.samples.size() / kEnoughSamples);
  std::vector<double> phis;
  for (int64_t column = 0; column < file.NumColumns(); column += every) {
    for (int64_t i = file.column_begin[column]; i < file.column_begin[column + 1]; ++i) {
      if (IsMeasured(file.samples[i])) phis.push_back(file.samples[i].phi);
    }
  }
  if (phis.empty()) return;
  std::sort(phis.begin(), phis.end());
  const double center = phis[phis.size() / 2];
  bool have_phase = false;
  for (double half_width = 3.5;; half_width *= 1.5) {
    const auto begin = std::lower_bound(phis.begin(), phis.end(), center - half_width * *spacing);
    const auto end = std::upper_bound(phis.begin(), phis.end(), center + half_width * *spacing);
    if (!have_phase) {
      std::complex<double> phase = 0;
      for (auto phi = begin; phi != end; ++phi) {
        phase += std::polar(1.0, 2 * kPi * (*phi - center) / *spacing);
      }
      *offset = center + std::arg(phase) / (2 * kPi) * *spacing;
      have_phase = true;
    }
    for (int round = 0; round < 2; ++round)
      FitLine(&*begin, &*begin + (end - begin), offset, spacing);
    if (begin == phis.begin() && end == phis.end()) return;
  }
}

// First guess of the row spacing and whether the header's word on the grid can be trusted.
double GuessSpacing(const RtpiFile& file, RtpiGrid* grid, bool* trust_header) {
  const std::vector<double> steps = ElevationSteps(file);
  const auto& density = file.header.samples_per_degree_el;
  *trust_header = true;
  if (steps.empty()) {
    if (density) return RadFromDeg(1 / *density);
    const auto& density_az = file.header.samples_per_degree_az;
    return RadFromDeg(density_az ? 1 / *density_az : 1.0);
  }
  const double median = Median(steps);
  if (density) {
    const double spacing = RadFromDeg(1 / *density);
    if (median > 0.5 * spacing && median < 1.5 * spacing) return RefinedSpacing(steps, spacing);
    *trust_header = false;
    grid->notes.push_back("curr_samples_per_degree_el is " + std::to_string(*density) +
                          ", but the samples are " + std::to_string(DegFromRad(median)) +
                          " degrees apart: rows follow the samples");
  }
  return RefinedSpacing(steps, median);
}

// Rows from *bottom to *top hold samples. el_fov may name the centres of the outermost samples or
// their outer edges; in the second case it would add an empty row at either end, which the longest
// column shows.
void ExtendToFieldOfView(double fov_bottom, double fov_top, const RtpiFile& file, double* bottom,
                         double* top) {
  const double longest =
      std::max(*top - *bottom + 1, static_cast<double>(file.header.max_samples_per_column.value_or(
                                       std::numeric_limits<int32_t>::max())));
  if (fov_top - fov_bottom + 1 - longest <= 2) {
    if (fov_top - fov_bottom + 1 > longest && fov_top > *top) fov_top -= 1;
    if (fov_top - fov_bottom + 1 > longest && fov_bottom < *bottom) fov_bottom += 1;
  }
  *bottom = fov_bottom;
  *top = fov_top;
}

}  // namespace

RtpiGrid FindRtpiGrid(const RtpiFile& file) {
  const PhiRange range = CheckAngles(file);
  RtpiGrid grid;
  grid.num_columns = file.NumColumns();
  bool trust_header = false;
  double offset = range.low;
  grid.spacing = GuessSpacing(file, &grid, &trust_header);
  FitRows(file, &grid.spacing, &offset);
  const auto row_at = [&](double phi) { return std::round((phi - offset) / grid.spacing); };
  double bottom = row_at(range.low), top = row_at(range.high);
  // A corrupt header or a stray sample must not make a grid out of proportion to the file.
  const double most_rows =
      (4e6 + 100.0 * static_cast<double>(file.samples.size())) / std::max(1, grid.num_columns);
  const auto& fov = file.header.el_fov;
  if (trust_header && fov) {
    const double low = RadFromDeg(std::max(-90.0, std::min((*fov)[0], (*fov)[1])));
    const double high = RadFromDeg(std::min(90.0, std::max((*fov)[0], (*fov)[1])));
    const double fov_bottom = std::min(bottom, row_at(low)), fov_top = std::max(top, row_at(high));
    if (fov_top - fov_bottom + 1 <= most_rows) {
      ExtendToFieldOfView(fov_bottom, fov_top, file, &bottom, &top);
    }
  }
  const double num_rows = top - bottom + 1;
  if (!(num_rows <= most_rows) || num_rows * grid.num_columns > std::numeric_limits<int>::max()) {
    throw InputError(file.path, "",
                     "its " + std::to_string(file.samples.size()) +
                         " samples would be spread over " + std::to_string(grid.num_columns) +
                         " columns by " +
                         std::to_string(static_cast<int64_t>(std::min(num_rows, 1e15))) + " rows",
                     "The elevations or curr_samples_per_degree_el are damaged");
  }
  grid.num_rows = static_cast<int>(num_rows);
  grid.top_phi = offset + top * grid.spacing;
  return grid;
}

RtpiColumnRows::RtpiColumnRows(const RtpiFile& file, const RtpiGrid& grid)
    : file_(file), grid_(grid), rows_per_radian_(1 / grid.spacing), sample_of_row_(grid.num_rows) {}

void RtpiColumnRows::GoTo(int column) {
  std::fill(sample_of_row_.begin(), sample_of_row_.end(), int64_t{-1});
  first_ = file_.column_begin[column];
  const int64_t end = file_.column_begin[column + 1];
  row_of_sample_.assign(static_cast<size_t>(end - first_), -1);
  contested_.clear();
  for (int64_t i = first_; i < end; ++i) {
    if (!IsMeasured(file_.samples[i])) continue;
    const int row = std::clamp(static_cast<int>(ExactRow(i) + 0.5), 0, grid_.num_rows - 1);
    row_of_sample_[i - first_] = row;
    int64_t& holder = sample_of_row_[row];
    if (holder < 0) {
      holder = i;
    } else if (std::abs(ExactRow(i) - row) < std::abs(ExactRow(holder) - row)) {
      contested_.push_back(holder);
      holder = i;
    } else {
      contested_.push_back(i);
    }
  }
  for (const int64_t sample : contested_) Displace(sample, row_of_sample_[sample - first_]);
}

void RtpiColumnRows::Displace(int64_t sample, int row) {
  const int side = ExactRow(sample) > row ? 1 : -1;
  for (const int beside : {row + side, row - side}) {
    if (beside < 0 || beside >= grid_.num_rows || sample_of_row_[beside] >= 0) continue;
    sample_of_row_[beside] = sample;
    row_of_sample_[sample - first_] = beside;
    return;
  }
  ++num_displaced_;
}

}  // namespace roomtex
