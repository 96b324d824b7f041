#pragma once
// LAS 1.0 to 1.4, the point files of surveying (ASPRS, "LAS Specification 1.4 - R15", 2019).

#include <string>
#include <string_view>
#include <vector>

#include "core/scan.h"

namespace roomtex {

struct LasOptions {
  double meters_per_unit = 1;
  double max_range = 0;  // metres from the middle of the file's points; 0 = no limit
  bool colors = false;   // keep them (Scan::colors)
};

// Point formats 0 to 10: coordinates by scale and offset, all returns, without what is marked as
// withheld. The intensity is that of the file (0 to 65535); where no point has one, the grey of the
// colours. Records of variable length (coordinate systems, waveforms) are passed over: coordinates
// stay as they are, but for the unit (las_unit.h). The scan is a cloud (Scan::Kind), z up.
// Compressed files (LAZ) are refused with the remedy. Throws InputError with the byte.
Scan ReadLas(const std::string& path, const LasOptions& options);

// The start of a file is that of a LAS or LAZ.
bool LooksLikeLas(std::string_view start);

}  // namespace roomtex
