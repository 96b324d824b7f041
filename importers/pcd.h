#pragma once
// PCD, the point cloud file of PCL: organised clouds (height > 1), so that the grid is known, and
// on request others.

#include <string>

#include "core/scan.h"

namespace roomtex {

struct PcdOptions {
  double meters_per_unit = 1;
  double max_range = 0;  // metres from the scanner; 0 = no limit
  bool clouds = false;   // also those without a grid, which are refused otherwise
  bool colors = false;   // keep them (Scan::colors)
};

// Reads ascii, binary and binary_compressed (version 0.6 and 0.7) with fields x, y, z (float or
// double) and, if there, intensity, normals (of clouds) and rgb or rgba (packed, as PCL does);
// where there is no intensity, the grey of the colours. Other fields are skipped. Row 0 is the top
// row, NaN = missing, points are in the scan frame and VIEWPOINT is scan_from_station. Throws
// InputError with line or byte; a cloud without a grid is refused, or one of Scan::Kind::kCloud.
// data_kind: what the DATA line says, may be null.
Scan ReadPcd(const std::string& path, const PcdOptions& options, std::string* data_kind = nullptr);

// Binary x, y, z, intensity and, if the scan has colours, rgb as PCL packs them; without a grid
// only what is measured, HEIGHT 1; x, y, z as double where one exceeds kLargeCoordinate.
void WritePcd(const Scan& scan, const std::string& path);

}  // namespace roomtex
