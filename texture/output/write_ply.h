#pragma once
// Coloured scans as PLY.

#include <string>
#include <vector>

#include "core/scan.h"
#include "texture/texels/colored_scan.h"

namespace roomtex {

// Whether coordinates are written as double: some are beyond 1 km.
bool NeedsDoubleCoordinates(const std::vector<Scan>& scans);

// Binary PLY of all scans, one behind the other: vertices in grid order, missing samples left out
// (x, y, z float, `scan` frame; red, green, blue, views uchar), then the faces. Coordinates beyond
// 1 km are written as double: a float would round them to more than a tenth of a millimetre.
// with_normals: behind them nx, ny, nz float, those of the mesh towards the scanner, zero where no
// triangle is. Throws InputError if it cannot be written.
void WriteColoredPly(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                     const std::string& path, bool with_normals = false);

}  // namespace roomtex
