#include "building/neighbours.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <boost/geometry/algorithms/comparable_distance.hpp>
#include <boost/geometry/algorithms/disjoint.hpp>
#include <boost/geometry/geometries/box.hpp>
#include <boost/geometry/geometries/point.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <boost/geometry/strategies/strategies.hpp>

namespace roomtex {
namespace {

namespace bg = boost::geometry;
using TreePoint = bg::model::point<double, 3, bg::cs::cartesian>;
using TreeEntry = std::pair<TreePoint, int>;

TreePoint TreePointOf(const Eigen::Vector3d& x) { return {x.x(), x.y(), x.z()}; }

}  // namespace

struct Neighbours::Tree {
  explicit Tree(const std::vector<TreeEntry>& entries) : rtree(entries) {}
  bg::index::rtree<TreeEntry, bg::index::quadratic<16>> rtree;
};

Neighbours::Neighbours(const std::vector<Eigen::Vector3d>& points) : points_(points) {
  std::vector<TreeEntry> entries;
  entries.reserve(points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    entries.emplace_back(TreePointOf(points[i]), static_cast<int>(i));
  }
  tree_ = std::make_unique<Tree>(entries);
}

Neighbours::~Neighbours() = default;

std::vector<int> Neighbours::Nearest(const Eigen::Vector3d& x, int count) const {
  std::vector<int> found;
  const auto query = bg::index::nearest(TreePointOf(x), static_cast<unsigned>(count));
  for (auto at = tree_->rtree.qbegin(query); at != tree_->rtree.qend(); ++at) {
    found.push_back(at->second);
  }
  const auto distance = [&](int i) { return (points_[static_cast<size_t>(i)] - x).squaredNorm(); };
  std::sort(found.begin(), found.end(), [&](int a, int b) {
    const double da = distance(a), db = distance(b);
    return da != db ? da < db : a < b;
  });
  return found;
}

std::vector<int> Neighbours::InCube(const Eigen::Vector3d& x, double half_side) const {
  std::vector<int> found;
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(half_side);
  const bg::model::box<TreePoint> box(TreePointOf(x - half), TreePointOf(x + half));
  for (auto at = tree_->rtree.qbegin(bg::index::intersects(box)); at != tree_->rtree.qend(); ++at) {
    found.push_back(at->second);
  }
  std::sort(found.begin(), found.end());
  return found;
}

FittedPlane FitPlane(const std::vector<Eigen::Vector3d>& points, const std::vector<int>& indices) {
  FittedPlane plane;
  const double n = static_cast<double>(indices.size());
  for (const int i : indices) plane.centre += points[static_cast<size_t>(i)];
  plane.centre /= n;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const int i : indices) {
    const Eigen::Vector3d d = points[static_cast<size_t>(i)] - plane.centre;
    sum += d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(sum);
  plane.normal = solver.eigenvectors().col(0);
  plane.rms = std::sqrt(std::max(0.0, solver.eigenvalues()[0]) / n);
  return plane;
}

}  // namespace roomtex
