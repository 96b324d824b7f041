#pragma once
// A mesh without a grid as a scanner inside of it would have measured it, so that it can be picked
// on like a scan.

#include "core/ray_caster.h"
#include "core/scan.h"

namespace roomtex {

// All around and from straight down to straight up, equally spaced angles (equirectangular),
// columns to the viewer's right; intensities between those of the mesh. The scanner stands in free
// space amid the mesh: where the nearest surface is farthest. Frame: `scan`. caster: of the mesh's
// own triangles.
Scan PanoramaOfMesh(const Scan& mesh, const RayCaster& caster, int num_columns, int num_threads);

// Columns that show what the mesh holds: 1.5 for every vertex that lies evenly around; 2048..4096.
int PanoramaColumns(const Scan& mesh);

}  // namespace roomtex
