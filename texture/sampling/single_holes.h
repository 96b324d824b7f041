#pragma once
// Single samples that the scanner missed in the middle of a surface: a scan loses some of a hundred
// thousand, and each would be a pinhole in the model.

#include <vector>

#include "core/scan.h"
#include "texture/sampling/smoothed_scan.h"

namespace roomtex {

// Grid indices of missing samples whose eight neighbours form a closed ring of connected samples.
std::vector<int> FindSingleHoles(const Scan& scan, const GridLinks& links);

// Two triangles over each, between the four neighbours beside, above and below it; their front is
// turned to the scanner. All corners are measured.
void AppendTrianglesOverHoles(const Scan& scan, const std::vector<int>& holes,
                              std::vector<Triangle>* triangles);

// Gives the holes a place between their neighbours, for textures finer than the samples.
void FillHoles(const Scan& scan, const std::vector<int>& holes, SmoothedScan* surface);

}  // namespace roomtex
