#pragma once
// Coloured scans as Wavefront OBJ.

#include <functional>
#include <string>
#include <vector>

#include "core/scan.h"
#include "texture/output/textured_parts.h"
#include "texture/texels/colored_scan.h"

namespace roomtex {

// Wavefront OBJ of all scans: model.obj, model.mtl and a texture image for each of `parts`
// (decimate_parts.h), model_0.png ... (or .jpg). Vertices are those of model.ply that the parts
// use, in its order, in the `scan` frame: no axis is turned; a comment names the one that points
// up. A part without an image has its colours behind the coordinates, as MeshLab and Blender read
// them. file_path: where to write the file of a name. Throws InputError if it cannot be written.
void WriteColoredObj(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                     const std::vector<std::vector<TexturedPart>>& parts, bool jpeg,
                     const std::function<std::string(const std::string&)>& file_path);

}  // namespace roomtex
