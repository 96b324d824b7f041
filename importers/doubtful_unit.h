#pragma once
// Scans that are not in metres, although their file does not say so.

#include <string>

#include "core/scan.h"

namespace roomtex {

// The unit (one of LengthUnitNames) that a scan read as metres is in more likely, "" if it may well
// be in metres. In doubt is
// - a room higher than any: floor and ceiling, or walls, that stand over each other by more than
//   80 m (sites and halls of hundreds of metres are flatter; slopes have one height at a place),
// - a grid whose scanner stood higher above the ground than a tripod: 30 m,
// - what is larger than a kilometre.
// Feet are never in doubt: a room of 2.7 m is one of 9 feet, and of 9 m there are many.
std::string LikelierUnit(const Scan& scan);

}  // namespace roomtex
