#pragma once
// Where a photo lies beside the others, as a small picture.

#include <string>

#include "core/report.h"

namespace roomtex {

inline constexpr double kWorstShift = 2;  // pixels; as much and more is drawn alike

// Of shift_map_px of roomtex-texture: rows of shifts in pixels, null where nothing was compared. An
// <svg>, blue where the photo lies right, red where it is off; "" if there is no number in it.
std::string MisregistrationMap(const Json& shift_map_px);

}  // namespace roomtex
