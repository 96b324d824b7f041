#pragma once
// The unit of a LAS file's coordinates, as its coordinate system says it (las.h).

#include <optional>
#include <string>

namespace roomtex {

struct LasUnits {
  // Names of length_unit.h; "" = not said. Heights may have one of their own.
  std::string horizontal, vertical;
  bool degrees = false;    // longitude and latitude
  bool projected = false;  // a system of lengths is named, whether its unit is known or not
  std::string wkt;         // the system itself, "" where GeoTIFF keys say it or nothing does
};

// By the GeoTIFF keys or the WKT among the records of variable length, before the points or behind
// them. Records that are damaged, and units that length_unit.h does not know, say nothing.
LasUnits ReadLasUnits(const std::string& path);

}  // namespace roomtex
