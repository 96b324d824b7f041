#pragma once
// The truth about the colours of a simulated scan, as files.

#include <string>

#include "capture/simulation/simulated_room.h"
#include "core/progress.h"

namespace roomtex {

// Writes, one vertex per measured sample in grid order, station after station:
//   folder/true_colors.ply  x y z as measured (scan frame); red green blue: SimulatedRoom::
//                           TrueColors as sRGB bytes; cell_red cell_green cell_blue: averaged over
//                           the sample's cell; views: photos that really see it, at most 255
//   folder/reachable.ply    if asked for: what a plain mean of the photos gives with the true
//                           places, visibility and tone (exposure, white balance, vignetting,
//                           response): bilinear lookups in linear light, clipped ones only where
//                           there is nothing else. What this leaves is due to the photos, not to a
//                           method of colouring.
// photo_folder: the photos as written (read for reachable.ply only).
void WriteTrueColors(const SimulatedRoom& room, const std::string& photo_folder, bool reachable,
                     const std::string& folder, Progress* progress);

}  // namespace roomtex
