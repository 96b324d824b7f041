#pragma once
// Fewer triangles for the web and for modelling programs, with the texture images as they are
// (meshoptimizer's quadric error: Garland and Heckbert 1997, "Surface Simplification Using Quadric
// Error Metrics").

#include <cstddef>
#include <vector>

#include "core/scan.h"
#include "texture/output/textured_parts.h"
#include "texture/texels/colored_scan.h"

namespace roomtex {

// The whole mesh of each scan: textured parts, or one part without an image where the colours are
// at the vertices. Nothing for a cloud.
std::vector<std::vector<TexturedPart>> MakeMeshParts(const std::vector<Scan>& scans,
                                                     const std::vector<ColoredScan>& colored,
                                                     int max_texture_size);

// Removes vertices until about max_triangles are left in all; those that stay keep their places and
// texture coordinates. No gap opens between parts. A triangle of a scan with a grid stays within a
// square of samples, because its texture runs straight while the scanner turns: max_triangles / 16
// squares or, where too many triangles would be left, a fourth of that, a sixteenth ... 0 =
// nothing is removed. Same result for any number of threads.
void DecimateParts(const std::vector<Scan>& scans, size_t max_triangles, int num_threads,
                   std::vector<std::vector<TexturedPart>>* parts);

size_t CountTriangles(const std::vector<std::vector<TexturedPart>>& parts);

}  // namespace roomtex
