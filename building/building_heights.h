#pragma once
// Floor and roof of a footprint, and what speaks for and against a building.

#include <vector>

#include "building/wall_lines.h"

namespace roomtex {

// Sets ground and roof of a building whose footprint stands, and of the evidence what belongs to
// them. roof: the segments that may be its roof. False if the points tell no height at all.
bool FindHeights(const OutlineCloud& cloud, const GroundPlane& ground,
                 const std::vector<PlaneSegment>& segments, const std::vector<int>& roof,
                 OutlineBuilding* building, BuildingEvidence* evidence);

// Walls and corners. lines: wall i's, or empty: found among the points near the footprint's edges.
void AddWallEvidence(const OutlineCloud& cloud, const GroundPlane& ground,
                     const std::vector<WallLine>& lines, const OutlineBuilding& building,
                     BuildingEvidence* evidence);

void AddExplained(const OutlineCloud& cloud, const GroundPlane& ground,
                  const OutlineBuilding& building, BuildingEvidence* evidence);
double ExplainedShare(const OutlineCloud& cloud, const GroundPlane& ground,
                      const std::vector<OutlineBuilding>& buildings);

void FindDoubts(const OutlineCloud& cloud, BuildingEvidence* evidence);

}  // namespace roomtex
