#pragma once
// The ASCII header of an RTPI file (rtpi.h).

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "importers/file_reader.h"

namespace roomtex {

// Numbers are those of the file: angles in degrees, lengths in `units`. Lines are kept without
// their end.
struct RtpiHeader {
  int version = 3;                  // 3 ("RTPI_version_3.0") or 2 ("RTPIv2")
  std::vector<std::string> device;  // lines before the scan parameters ("# model: deltaSphere3000")
  // Largest number of samples in any one column; bounds the rows of the grid, absent = not said.
  std::optional<int64_t> max_samples_per_column;
  bool has_color = false;
  std::string units;                                                   // "" = not said
  std::optional<std::array<double, 2>> az_fov, el_fov;                 // degrees, as in the file
  std::optional<double> samples_per_degree_az, samples_per_degree_el;  // curr_: those of this file
  std::optional<double> max_range;                                     // largest reliable range
  std::vector<std::string> parameters;  // all other lines of the scan parameters ("# filter1: ...")
  std::vector<std::string> comments;    // free lines, "# " included
};

// What is needed to read the columns that follow the header.
struct RtpiLayout {
  RtpiHeader header;
  int64_t num_columns = 0;
  int64_t body_offset = 0;  // byte of the first column count
  long num_columns_line = 0;
};

// Whether these first bytes of a file are those of an RTPI file of any version.
bool LooksLikeRtpi(const std::string& first_bytes);

// The sense of the azimuth seen from above that the header lets one know: "counterclockwise" for
// one that the scanner's own software wrote (model deltaSphere, serial number, laser and times of
// the scan: manual 15.2, which counts so), else "".
std::string AzimuthOfScanner(const RtpiHeader& header);

// What our own writer says of it: "# azimuth: ..." among the comments of a kModelRoomtex; else "".
std::string AzimuthOfFile(const RtpiHeader& header);
inline constexpr char kModelRoomtex[] = "# model: roomtex";
std::string AzimuthComment(const std::string& azimuth);

// "clockwise" for "counterclockwise", and the other way round: a scan that is read the other way
// is its own mirror image.
std::string OtherAzimuth(const std::string& azimuth);

// Tolerates CR LF, unknown and missing lines, values on the next line, en dashes as minus signs.
// Throws InputError (not RTPI, version 1, no end of the header, a number that is none).
RtpiLayout ReadRtpiHeader(const FileReader& file);

// The text of the header, its last newline included.
// max_samples_per_column must be set.
std::string RtpiHeaderText(const RtpiHeader& header, int64_t num_columns);

}  // namespace roomtex
