#pragma once
// What scans are, without anything made of them: read as ReadPlacedScans() reads them, and let go
// again one by one.

#include <string>
#include <vector>

#include "core/progress.h"
#include "core/report.h"
#include "core/scan.h"
#include "importers/scan_reader.h"

namespace roomtex {

struct CheckedScan {
  std::string name;  // its file, FILE#k where that holds several, as --scan_poses takes it
  Scan::Kind kind = Scan::Kind::kGrid;
  int num_columns = 0, num_rows = 0;  // as in Scan
  int64_t num_samples = 0, num_missing = 0;
  size_t num_triangles = 0;  // of a mesh without a grid
  bool has_colors = false;   // looked for where options.colors
  // Where it stands is known: by its file or by the poses. Several scans need this.
  bool has_pose = false;
  Bounds bounds;  // metres, in the frame of the file
};

struct CheckedFile {
  std::string path, format, byte_order;  // as in ScanFile
  std::vector<std::string> notes;        // as in ScanFile
  std::string up_axis;
  bool up_is_assumed = false;
  std::vector<CheckedScan> scans;  // at least one
};

// One per path; progress ticks for each. Holds the samples of one scan at a time. Throws InputError
// for all that ReadPlacedScans() throws one for, poses and scans without one among it.
std::vector<CheckedFile> CheckScans(const std::vector<std::string>& paths,
                                    const std::string& poses_path, const ScanReaderOptions& options,
                                    Progress* progress);

// Keys of the report of roomtex-import, of all scans together and of each in `scans`. Triangles of
// a grid are null, and of several files what only one can have: format, byte_order, up, bounds.
Json ReportKeys(const std::vector<CheckedFile>& files);
// One line per scan, FILE#k where its file holds several.
std::string LinesOn(const std::vector<CheckedFile>& files);

}  // namespace roomtex
