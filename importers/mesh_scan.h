#pragma once
// What the readers of meshes and clouds (PLY, OBJ, PCD) have in common.

#include <string>

#include "core/scan.h"

namespace roomtex {

// Makes the vertices and triangles that were read a scan without a grid: points that are not finite
// or farther from the station than max_range (metres; 0 = no limit) are missing, and triangles at
// them go. points and intensity have one value per vertex. Throws InputError if no triangle is
// left.
void FinishMesh(const std::string& path, double max_range, Scan* scan);

// Makes the points that were read a cloud (Scan::Kind): those that are not finite or too far away
// go. Throws InputError if none is left.
void FinishCloud(const std::string& path, double max_range, Scan* scan);

}  // namespace roomtex
