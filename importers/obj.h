#pragma once
// Wavefront OBJ triangle meshes.

#include <string>

#include "core/scan.h"
#include "importers/ply.h"

namespace roomtex {

// Reads vertices (v) and faces (f; polygons as fans of triangles; numbers from 1 or, negative, from
// the last vertex). Texture coordinates, normals, groups and materials are skipped. The scan is not
// organised; the intensity of all vertices is 1, or the grey of their colours ("v x y z r g b", as
// MeshLab writes them; options.grey_as_intensity); `up` comes from the comment that our own files
// have, otherwise z, as in PLY. Throws InputError with the line; a file without faces is refused.
Scan ReadObj(const std::string& path, const PlyOptions& options);

// The start of a file is that of an OBJ: behind comments one of its keywords with a value.
bool LooksLikeObj(std::string_view start);

}  // namespace roomtex
