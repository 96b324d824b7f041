#pragma once
// Coloured scans as Wavefront OBJ.

#include <functional>
#include <string>
#include <vector>

#include "core/scan.h"
#include "texture/output/write_glb.h"
#include "texture/texels/colored_scan.h"

namespace roomtex {

// Wavefront OBJ of all scans: model.obj, model.mtl and a texture image for each part of
// textured_parts.h, model_0.png ... (or .jpg). Vertices are those of model.ply, in its order, in
// the `scan` frame: no axis is turned; a comment names the one that points up. A mesh without grid
// and atlas has its colours behind the coordinates, as MeshLab and Blender read them. file_path:
// where to write the file of a name. Throws InputError if it cannot be written.
void WriteColoredObj(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                     const GlbOptions& images,
                     const std::function<std::string(const std::string&)>& file_path);

}  // namespace roomtex
