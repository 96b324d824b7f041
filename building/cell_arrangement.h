#pragma once
// The plane cut into convex cells by straight lines, and the outlines of unions of cells.
// Footprints and roofs are unions of cells, so that what touches shares its corners exactly.

#include <map>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace roomtex {

// Points x with normal . x = offset; normal of unit length.
struct Line2 {
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();
  double offset = 0;

  static Line2 Through(const Eigen::Vector2d& a, const Eigen::Vector2d& b);
  double SignedDistance(const Eigen::Vector2d& x) const { return normal.dot(x) - offset; }
  // Along the line, the normal to its right.
  Eigen::Vector2d Direction() const { return {-normal.y(), normal.x()}; }
};

struct CellArrangement {
  std::vector<Eigen::Vector2d> vertices;
  std::vector<std::vector<int>> cells;  // vertices of each, counter-clockwise; convex
  // The line that an edge (smaller vertex first) lies on; -1 = the border of the box.
  std::map<std::pair<int, int>, int> edge_lines;

  Eigen::Vector2d CentreOf(int cell) const;
  double AreaOf(int cell) const;
};

// Cuts the box by the lines. Corners nearer than `epsilon` to a line lie on it.
CellArrangement ArrangeCells(const Eigen::AlignedBox2d& box, const std::vector<Line2>& lines,
                             double epsilon);

// The inside of a simple polygon, cut by the lines. Its own edges cut no farther than they reach:
// of 1000 corners there are some thousand cells, not half a million.
CellArrangement ArrangeInside(const std::vector<Eigen::Vector2d>& polygon,
                              const std::vector<Line2>& lines, double epsilon);

// The outlines of the union of all cells with this label: loops of vertices, the union to the left
// (outer ones counter-clockwise). Every vertex of the cells on the way is there, straight or not.
// Where the union touches itself in a corner, the loops are apart.
std::vector<std::vector<int>> OutlinesOf(const CellArrangement& arrangement,
                                         const std::vector<int>& labels, int label);

// Signed; positive when counter-clockwise.
double PolygonArea(const std::vector<Eigen::Vector2d>& polygon);
bool IsInside(const std::vector<Eigen::Vector2d>& polygon, const Eigen::Vector2d& x);

}  // namespace roomtex
