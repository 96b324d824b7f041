#pragma once
// E57 (ASTM E2807), what scanners' own programs export: several scans in one file, each with its
// pose, structured (with the scanner's grid) or not; photos (e57_images.h). Known of the format:
// the standard, and files of many programs. Read by layers: pages (e57_pages.h), XML
// (e57_document.h), records (e57_records.h), points (e57_points.h), grid (e57_grid.h).

#include <string>
#include <vector>

#include "core/scan.h"

namespace roomtex {

struct E57Options {
  double meters_per_unit = 1;  // the format itself knows metres only
  double max_range = 0;        // metres from the scanner; 0 = no limit
  bool check = true;           // all checksums of the file, before anything else
  bool colors = false;         // keep them (Scan::colors)
};

// Which scans: "" = all, otherwise the name or the GUID of one, or its number from 1. Scans without
// points are left out, with a note (notes may be null). In the frame of the file, z up; the
// station is the scan's pose, the origin where it has none. Structured scans: row 0 on top,
// columns as in the file; a cell that several records have takes the first return. Others are
// clouds (Scan::Kind). Intensities from 0 to 1 by the limits that the file gives, else as they
// are; grey of the colours where there are none. Normals of clouds (extension nor) are kept. Memory
// is that of the scans that are asked for. Throws InputError with the byte.
std::vector<Scan> ReadE57(const std::string& path, const std::string& part,
                          const E57Options& options, std::vector<std::string>* notes,
                          const ScanVisitor& visit = nullptr);

}  // namespace roomtex
