#pragma once
// PTX, the text format of Leica Cyclone that most scanner software writes: per scan the numbers of
// columns and rows, the scanner's pose, then one line "x y z intensity [r g b]" per sample, column
// by column from the bottom up; "0 0 0" = missing. A file may hold several scans one after the
// other.

#include <string>
#include <vector>

#include "core/scan.h"

namespace roomtex {

struct PtxOptions {
  double meters_per_unit = 1;
  double max_range = 0;  // metres from the scanner; 0 = no limit
  bool colors = false;   // keep them (Scan::colors)
};

// All scans of the file, in the file's order, in one frame: each scan's own 4x4 pose is applied to
// its points (translation in the last row as Cyclone writes it, or in the last column). Row 0 of
// the grid is the top one. `up` is z, unless the order of the samples shows that the elevation
// grows along y (see up_axis.h). Scans without a measured sample are left out, with a note. Throws
// InputError with the line, and where no scan is left.
std::vector<Scan> ReadPtx(const std::string& path, const PtxOptions& options,
                          std::vector<std::string>* notes = nullptr,
                          const ScanVisitor& visit = nullptr);

// Coordinates to the micrometre in the station frame with the pose as the scan's 4x4 matrix;
// intensities 0..1 (others are divided by 255, 4095 or 65535, whichever is the first to hold them
// all), and the colours of scans that have some. Organised scans only.
void WritePtx(const std::vector<Scan>& scans, const std::string& path);

// What the intensities of the scan are to be divided by to lie in 0..1, after subtracting *offset
// (0 unless some are negative).
double IntensityDivisor(const Scan& scan, double* offset);

}  // namespace roomtex
