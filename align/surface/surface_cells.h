#pragma once
// Points on the scan's surface by cells, of half a metre unless told. What is unknown of a surface
// is the same for all points of a cell, so that thousands of points on a wall do not make it exact.

#include <vector>

#include <Eigen/Core>

namespace roomtex {

class SurfaceCells {
 public:
  static constexpr double kSize = 0.5;  // metres

  // One point and one normal (unit length) per index; `scan`, metres. size: edge of a cell, metres.
  SurfaceCells(const std::vector<Eigen::Vector3d>& points,
               const std::vector<Eigen::Vector3d>& normals, double size = kSize);

  // Index of the cell of a point: a piece of a surface that faces one way.
  int Cell(size_t index) const { return cell_[index]; }
  int NumPoints(int cell) const { return num_points_[cell]; }
  int NumCells() const { return static_cast<int>(num_points_.size()); }
  // The way a point's surface faces, shared by all points whose normals, or their opposites, differ
  // by less than 15 degrees. The normals as they are scatter, and opposite walls of a noisy scan
  // are never quite parallel: the fit would take that for a hold against sliding along the walls.
  const Eigen::Vector3d& SharedNormal(size_t index) const { return shared_normals_[index]; }
  int NumPointsAlike(size_t index) const { return num_alike_[facing_[index]]; }  // that share it

 private:
  std::vector<Eigen::Vector3d> shared_normals_;
  std::vector<int> facing_, num_alike_;
  std::vector<int> cell_, num_points_;
};

}  // namespace roomtex
