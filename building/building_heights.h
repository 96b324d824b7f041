#pragma once
// Floor and roof of a footprint, and what speaks for and against a building.

#include <string>
#include <vector>

#include "building/wall_lines.h"

namespace roomtex {

// Sets ground and roof of a building whose footprint stands, and of the evidence what belongs to
// them. roof: the segments that may be its roof. False if the points tell no height at all.
bool FindHeights(const OutlineCloud& cloud, const GroundPlane& ground,
                 const std::vector<PlaneSegment>& segments, const std::vector<int>& roof,
                 OutlineBuilding* building, BuildingEvidence* evidence);

// Sets the evidence's walls, one per edge of the footprint (lengths, offsets and `middle` in units
// of the outline, sigma_angle in radians), and corner_sigma, one per corner. lines: wall i's, or
// empty: found among the points near the footprint's edges.
void AddWallEvidence(const OutlineCloud& cloud, const GroundPlane& ground,
                     const std::vector<WallLine>& lines, const OutlineBuilding& building,
                     BuildingEvidence* evidence);

// Sets num_points, of the points within the footprint or near the solid those above the ground, and
// `explained`, the share of these that lie on the solid (0 without points).
void AddExplained(const OutlineCloud& cloud, const GroundPlane& ground,
                  const OutlineBuilding& building, BuildingEvidence* evidence);
// Of all points above the ground the share that lies on one of the buildings: 0..1.
double ExplainedShare(const OutlineCloud& cloud, const GroundPlane& ground,
                      const std::vector<OutlineBuilding>& buildings);

// What speaks against the building, in sentences; empty: it is to be trusted. evidence: all of it
// set by the above.
std::vector<std::string> FindDoubts(const OutlineCloud& cloud, const BuildingEvidence& evidence);

}  // namespace roomtex
