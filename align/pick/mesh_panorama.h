#pragma once
// A mesh without a grid as a scanner inside of it would have measured it, so that it can be picked
// on like a scan.

#include "core/scan.h"

namespace roomtex {

// All around and from straight down to straight up, equally spaced angles (equirectangular),
// columns to the viewer's right; intensities between those of the mesh. The scanner stands in free
// space amid the mesh: where the nearest surface is farthest. Frame: `scan`.
Scan PanoramaOfMesh(const Scan& mesh, int num_columns, int num_threads);

}  // namespace roomtex
