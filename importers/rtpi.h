#pragma once
// RTPI, the range file of the DeltaSphere-3000: version 3.0 (user manual v3.2, 15.2; thesis 5.1.1)
// and version 2, in both byte orders. Version 1 ("P9") is recognised and refused.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "importers/rtpi_header.h"

namespace roomtex {

enum class ByteOrder { kLittle, kBig };

// One sample as it stands in the file.
struct RtpiSample {
  float range = 0;  // unit of the header; missing when <= 0, not finite or beyond max_range
  float theta = 0;  // azimuth, radians
  float phi = 0;    // elevation, radians
  // has_color no: the bits of the signed integer intensity.
  // has_color yes: red | green << 8 | blue << 16 | intensity << 24.
  uint32_t value = 0;

  int Intensity(bool has_color) const {
    return has_color ? static_cast<int>(value >> 24) : static_cast<int32_t>(value);
  }
};

struct RtpiFile {
  std::string path;
  RtpiHeader header;
  ByteOrder byte_order = ByteOrder::kLittle;
  int64_t body_offset = 0;  // of the first column count in the file read, for messages
  // Samples of all columns, one column behind the other. Column c holds those from column_begin[c]
  // up to, but without, column_begin[c + 1].
  std::vector<int64_t> column_begin = {0};
  std::vector<RtpiSample> samples;

  int NumColumns() const { return static_cast<int>(column_begin.size()) - 1; }
};

// All of the file, bit by bit. The byte order is the one in which every column count is at most
// max_samples_per_column and the columns end where the file ends (a file without any sample counts
// as little-endian). Throws InputError with the byte or header line.
RtpiFile ReadRtpi(const std::string& path);

// In the version of the header (2 or 3) and in file.byte_order; num_columns follows from the
// columns, max_samples_per_column is raised to the longest of them. Reading the result gives the
// same samples and order bit by bit, and the same header (version 2 can hold its comments only).
void WriteRtpi(const RtpiFile& file, const std::string& path);

struct RtpiScanOptions {
  // Sense of theta seen from above. false: the thesis' formula (5.1.1); true: the manual's,
  // mirrored.
  bool counterclockwise = false;
  double meters_per_unit = 0;  // 0 = by the header, metres if it names no unit
  double max_range = 0;        // metres; 0 = the header's max_range, if any
  bool colors = false;         // keep them (Scan::colors)
};

// The scan frame is the scanner's (y up). Rows are steps of elevation: by
// curr_samples_per_degree_el, if the samples agree, otherwise by their own spacing; el_fov says
// where the grid begins and ends. Throws InputError: unknown unit, angles that are none, no
// measured sample. notes: what a user should know (assumptions about unit and rows), appended; may
// be null.
Scan ScanFromRtpi(const RtpiFile& file, const RtpiScanOptions& options,
                  std::vector<std::string>* notes = nullptr);

// The scan as version 3.0 in metres, seen from its station with `up` along y: RTPI knows no pose.
// Missing samples are left out. Intensities stay (rounded) in a scan from RTPI; others are scaled
// to 0..65535 when they are 0..1, negative or above the integers; a comment in the header says so.
// `scan` must be organised.
RtpiFile RtpiFromScan(const Scan& scan, bool counterclockwise = false);

// Copies the RTPI file input_path to output_path as version 3.0 with has_color yes: same ranges,
// angles and order. colors: red, green, blue per cell of the grid of ScanFromRtpi
// (scan.Index(column, row)). A sample without a cell gets black. The intensity becomes one byte; if
// the integers leave 0..255 they are scaled and a comment in the header says how. Throws
// InputError; std::invalid_argument if the grid has another size.
void WriteColoredRtpi(const std::string& input_path,
                      const std::vector<Eigen::Matrix<uint8_t, 3, 1>>& colors,
                      const std::string& output_path);

}  // namespace roomtex
