#pragma once
// Buildings as files: meshes, and models for geographic information systems.

#include <string>
#include <vector>

#include "building/outline.h"

namespace roomtex {

// The extensions that WriteBuildings knows, for messages: ".glb, .obj, ...".
const char* BuildingExtensions();
bool IsBuildingPath(const std::string& path);

// All buildings of the outline, by the extension:
//   .obj         triangles in the frame of the INPUT, a group per building: what roomtex-texture
//                takes as --scan_path beside the model
//   .glb         binary glTF 2.0, +Y up, walls, roofs and floors in plain colours
//   .city.json   CityJSON 2.0, LoD2 solids with semantic surfaces (also .cityjson)
//   .gml         CityGML 2.0, the same (also .citygml)
//   .geojson     footprints with heights; WGS84 longitude and latitude (RFC 7946) where the outline
//                lies on the Earth, else its own coordinates, with a sentence that says so
// CityJSON and CityGML are in UTM (WGS84; heights above the ellipsoid) where the outline lies on
// the Earth, else in its own coordinates. Written aside and renamed. Throws InputError.
void WriteBuildings(const std::string& path, const Outline& outline);

}  // namespace roomtex
