#include "align/surface/surface_cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace roomtex {
namespace {

constexpr double kAlike = 0.966;  // cosine of 15 degrees

struct Nearest {
  int facing = 0;
  double cosine = 0;  // negative: the normal points against it
};
Nearest FindNearest(const std::vector<Eigen::Vector3d>& facings, const Eigen::Vector3d& normal) {
  Nearest nearest;
  for (size_t i = 0; i < facings.size(); ++i) {
    const double cosine = facings[i].dot(normal);
    if (std::abs(cosine) > std::abs(nearest.cosine)) nearest = {static_cast<int>(i), cosine};
  }
  return nearest;
}

}  // namespace

SurfaceCells::SurfaceCells(const std::vector<Eigen::Vector3d>& points,
                           const std::vector<Eigen::Vector3d>& normals, double size) {
  std::vector<Eigen::Vector3d> facings = normals;
  std::vector<Nearest> nearest(normals.size());
  // The first facing that a normal is near to takes it in, so the order decides: each pass puts the
  // facings with most normals first for the next one.
  for (int pass = 0; pass < 3; ++pass) {
    std::vector<Eigen::Vector3d> apart;
    for (const Eigen::Vector3d& facing : facings) {
      if (std::abs(FindNearest(apart, facing).cosine) < kAlike) apart.push_back(facing);
    }
    std::vector<Eigen::Vector3d> sums(apart.size(), Eigen::Vector3d::Zero());
    for (size_t i = 0; i < normals.size(); ++i) {
      nearest[i] = FindNearest(apart, normals[i]);
      sums[nearest[i].facing] += (nearest[i].cosine < 0 ? -1 : 1) * normals[i];
    }
    std::stable_sort(sums.begin(), sums.end(), [](const auto& a, const auto& b) {
      return a.squaredNorm() > b.squaredNorm();
    });
    facings.clear();
    for (const Eigen::Vector3d& sum : sums) {
      if (sum.norm() > 0) facings.push_back(sum.normalized());
    }
  }
  for (size_t i = 0; i < normals.size(); ++i) nearest[i] = FindNearest(facings, normals[i]);
  num_alike_.assign(facings.size(), 0);
  std::map<std::array<long, 4>, int> cells;
  for (size_t i = 0; i < points.size(); ++i) {
    std::array<long, 4> key;
    for (int k = 0; k < 3; ++k) key[k] = std::lround(std::floor(points[i][k] / size));
    key[3] = 2 * nearest[i].facing + (nearest[i].cosine < 0);
    const auto [at, is_new] = cells.emplace(key, NumCells());
    if (is_new) num_points_.push_back(0);
    ++num_points_[at->second];
    cell_.push_back(at->second);
    facing_.push_back(nearest[i].facing);
    ++num_alike_[nearest[i].facing];
    const Eigen::Vector3d& facing = facings[nearest[i].facing];
    shared_normals_.push_back(nearest[i].cosine < 0 ? Eigen::Vector3d(-facing) : facing);
  }
}

}  // namespace roomtex
