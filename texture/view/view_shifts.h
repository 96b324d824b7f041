#pragma once
// How far each photo was off the others, as roomtex-texture has measured it.

#include <map>
#include <string>

#include "core/report.h"

namespace roomtex {

// Per name of a photo {before_px, after_px, before_mm (numbers, >= 0), map_px (rows of equal length
// of numbers >= 0 or null, from the photo's upper left; may be empty)}: medians, pixels of the
// photo, on the surface. From the images[] of a report.json in the folder; what is not there or
// damaged is left out. Empty with --Registration.mode none.
std::map<std::string, Json> ReadViewShifts(const std::string& folder);

}  // namespace roomtex
