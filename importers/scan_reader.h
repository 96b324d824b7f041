#pragma once
// Reads any scan file: the content decides the format, not the extension.

#include <string>
#include <vector>

#include "core/command_line.h"
#include "core/scan.h"

namespace roomtex {

struct ScanReaderOptions {
  // RTPI: sense of the azimuth seen from above. "clockwise" is the thesis' formula (5.1.1), files
  // of real scanners are "counterclockwise"; the wrong one mirrors the room.
  std::string azimuth = "clockwise";
  // RTPI, PTX, PCD, PLY: unit of the coordinates in the file; "" = what the file says, metres if it
  // does not. One of "", "meters", "millimeters", "centimeters", "feet", "inches".
  std::string units;
  // Metres; samples farther away count as missing. 0 = the limit that the file gives, if any.
  double max_range = 0;

  std::vector<std::string> Problems() const;
};

// Registers --azimuth, --units and --max_range.
void AddScanReaderOptions(ScanReaderOptions* options, Command* command);

// All scans of one file (a PTX may hold several), and what the file is.
struct ScanFile {
  std::vector<Scan> scans;         // at least one
  std::string format;              // "RTPI", "PTX", "PCD" or "PLY"
  std::string byte_order;          // "little", "big" or "text"
  std::vector<std::string> notes;  // assumptions about the file that a user should know
};
// Throws InputError (missing, not a scan, broken ...).
ScanFile ReadScanFile(const std::string& path, const ScanReaderOptions& options);

// The only scan of the file. Throws InputError as above, and for a file with several.
Scan ReadScan(const std::string& path, const ScanReaderOptions& options);

// Several scans in one scan frame, all scans of all files. poses_path ("" = none) gives
// scan_from_station per file, one line each: "NAME m00 ... m33" (4x4, row by row) or "NAME qw qx qy
// qz tx ty tz"; `#` starts a comment. NAME is the path or the file name; scan k (from 1) of a file
// with several is NAME#k. A pose here replaces that of a PTX or PCD. Several scans without a pose
// (PTX carries its own) are an InputError.
std::vector<Scan> ReadScans(const std::vector<std::string>& paths, const std::string& poses_path,
                            const ScanReaderOptions& options);

}  // namespace roomtex
