#pragma once
// Nearest points, and the plane through some of them.

#include <memory>
#include <vector>

#include <Eigen/Core>

namespace roomtex {

class Neighbours {
 public:
  // points must outlive it.
  explicit Neighbours(const std::vector<Eigen::Vector3d>& points);
  ~Neighbours();

  // Indices of the `count` nearest points, the nearest first. Safe from several threads.
  std::vector<int> Nearest(const Eigen::Vector3d& x, int count) const;
  // Indices of the points in the cube of this half side about x, ascending.
  std::vector<int> InCube(const Eigen::Vector3d& x, double half_side) const;

 private:
  struct Tree;
  const std::vector<Eigen::Vector3d>& points_;
  std::unique_ptr<Tree> tree_;
};

struct FittedPlane {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // unit length, sign not defined
  double rms = 0;                                     // of the distances from it

  double SignedDistance(const Eigen::Vector3d& x) const { return normal.dot(x - centre); }
};
// Least squares; at least three points.
FittedPlane FitPlane(const std::vector<Eigen::Vector3d>& points, const std::vector<int>& indices);

}  // namespace roomtex
