#pragma once
// Where the samples of an RTPI file stand in the grid of the scan. One mapping for reading
// (ScanFromRtpi) and for colouring (WriteColoredRtpi); it depends on nothing but the file.

#include <limits>
#include <string>
#include <vector>

#include "importers/rtpi.h"

namespace roomtex {

struct RtpiGrid {
  int num_columns = 0, num_rows = 0;
  double top_phi = 0;              // elevation of row 0, radians
  double spacing = 1;              // of the rows, radians
  std::vector<std::string> notes;  // assumptions a user should know
};

// Rows are steps of curr_samples_per_degree_el. When that is absent or contradicts the samples
// (their median step is not one row), the rows follow the samples' own spacing. Spacing and
// position of the rows are fitted to the samples, because the header's density has few digits. The
// grid covers el_fov and all samples. Throws InputError: an angle that is none (with its byte), no
// measured sample, a grid far larger than the file.
RtpiGrid FindRtpiGrid(const RtpiFile& file);

// A sample with an echo at all, whatever its range.
inline bool IsMeasured(const RtpiSample& sample) {
  return sample.range > 0 && sample.range <= std::numeric_limits<float>::max();
}

// The rows of the samples of one column after the other.
class RtpiColumnRows {
 public:
  RtpiColumnRows(const RtpiFile& file, const RtpiGrid& grid);

  void GoTo(int column);
  // Index into file.samples of the sample in this row of the column; -1 = missing.
  int64_t SampleAt(int row) const { return sample_of_row_[row]; }
  // Row of the sample first_sample() + k; -1 for samples that are not measured. Two samples nearest
  // to the same row: the nearer one has it, the other one gets the row beside if that is empty,
  // otherwise it stands in no row (but its nearest row is given here).
  int RowOf(int64_t k) const { return row_of_sample_[k]; }
  int64_t first_sample() const { return first_; }
  int64_t num_samples() const { return static_cast<int64_t>(row_of_sample_.size()); }
  int64_t num_displaced() const { return num_displaced_; }  // samples without a row, so far

 private:
  double ExactRow(int64_t sample) const {
    return (grid_.top_phi - static_cast<double>(file_.samples[sample].phi)) * rows_per_radian_;
  }
  void Displace(int64_t sample, int row);

  const RtpiFile& file_;
  const RtpiGrid& grid_;
  double rows_per_radian_;
  int64_t first_ = 0, num_displaced_ = 0;
  std::vector<int64_t> sample_of_row_, contested_;
  std::vector<int> row_of_sample_;
};

}  // namespace roomtex
