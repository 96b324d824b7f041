#pragma once
// Walls in the top view: the straight lines that upright segments draw there.

#include <vector>

#include "building/cell_arrangement.h"
#include "building/outline_proposal.h"

namespace roomtex {

// Points of a wall or a roof are not independent: features sit on sills and frames, poses err. One
// in so many counts.
inline constexpr double kPointsPerIndependent = 6;

enum class SegmentRole { kWall, kRoof, kOther };
SegmentRole RoleOf(const OutlineCloud& cloud, const GroundPlane& ground,
                   const PlaneSegment& segment);

// One line, of one wall or of several that lie in it.
struct WallLine {
  Line2 line;  // the normal outwards, where that is known
  bool oriented = false;
  std::vector<Eigen::Vector2d> points;  // in the top view
  double rms = 0, sigma_offset = 0, sigma_angle = 0;
  double middle = 0;  // of the points, along line.Direction()
  // Stretches along line.Direction() that hold points, bridged where the gap is small.
  std::vector<std::pair<double, double>> stretches;
  // No points draw it: it closes what they leave open.
  bool inferred = false;

  double CoveredShare(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const;
};

// The lines of the upright segments of a group, those along one line as one. right_angles: lines
// that are parallel or at right angles to the others within their uncertainty are made so.
std::vector<WallLine> FindWallLines(const OutlineCloud& cloud, const GroundPlane& ground,
                                    const std::vector<PlaneSegment>& segments,
                                    const std::vector<int>& group, bool right_angles);

// Fits the line's place and uncertainty to its points; keeps the direction if `fixed_direction`.
void FitWallLine(const OutlineCloud& cloud, bool fixed_direction, WallLine* wall);

}  // namespace roomtex
