#pragma once
// XYZ, CSV and PTS: text files with a point a line.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/scan.h"

namespace roomtex {

struct XyzOptions {
  double meters_per_unit = 1;
  double max_range = 0;  // metres from the origin; 0 = no limit
  bool colors = false;   // keep them (Scan::colors)
};

// Lines "x y z", "x y z intensity", "x y z r g b" or "x y z intensity r g b", all alike, between
// blanks, tabs, commas or semicolons; further columns are passed over. PTS: the number of points
// alone in the first line. A line of names (x, y, z, intensity, in any order and case) decides the
// columns. Lines that begin with # or // are comments. The scan is a cloud (Scan::Kind), its
// station the origin, z up; points that are no numbers (nan) are left out; where there is no
// intensity, the grey of the colours is. Throws InputError with the line.
Scan ReadXyz(const std::string& path, const XyzOptions& options);

// The unit of its coordinates by the names of its columns ("x [mm]"), one of LengthUnitNames(); ""
// = not said. start: of the file.
std::string UnitOfXyz(std::string_view start);

// The start of a file is that of such a text.
bool LooksLikeXyz(std::string_view start);

// All measured points of all scans: "x y z intensity" and, where a scan has colours, "r g b" from 0
// to 255; lengths to the micrometre. kPts: their number in the first line. kCsv: with commas and a
// line of names. Throws InputError if the file cannot be written.
enum class XyzKind { kXyz, kPts, kCsv };
std::optional<XyzKind> XyzKindOf(const std::string& extension);  // ".xyz", ".pts", ".csv"
void WriteXyz(const std::vector<const Scan*>& scans, const std::string& path, XyzKind kind);

}  // namespace roomtex
