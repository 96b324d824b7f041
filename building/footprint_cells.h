#pragma once
// Footprints from wall lines: the plane is cut into cells by the lines, and each cell is taken as
// inside or outside so that the border runs along walls that points draw, roofs lie inside, and
// nothing was seen through a building (a minimum cut; Boykov and Kolmogorov 2004).

#include <vector>

#include "building/wall_lines.h"

namespace roomtex {

struct FootprintRegion {
  std::vector<Eigen::Vector2d> polygon;  // counter-clockwise, corners only
  std::vector<WallLine> walls;           // the line of the wall from corner i to the next
  std::vector<int> roof;                 // roof segments that may lie above it
};

// The footprints of one group of segments: none, one, or several (parts with different roofs).
std::vector<FootprintRegion> FindFootprints(const OutlineCloud& cloud, const GroundPlane& ground,
                                            const std::vector<PlaneSegment>& segments,
                                            const std::vector<int>& group, bool right_angles);

}  // namespace roomtex
