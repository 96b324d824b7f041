#include "align/surface/scan_patches.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_map>

#include <Eigen/Eigenvalues>

#include "align/surface/visit_triangle.h"
#include "core/option_fields.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr int kLeafSize = 8;
// A cube more of whose samples make patches in smaller cubes is none of a coarse surface: what is
// left of them are edges and clutter, and a plane through those is nobody's. Where fewer do, those
// are flat by chance, and the larger patch takes their place.
constexpr double kMostInSmaller = 0.25;
// Few samples of clutter are flat by chance: a larger cube needs so many times as many.
constexpr int kMoreInLarger = 2;

using CubeIndex = std::array<int64_t, 3>;

// Sums over the samples of one cube, relative to `origin` (the first of them), so that large
// coordinates keep their precision.
struct Cube {
  CubeIndex index = {};
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector3f station_side = Eigen::Vector3f::Zero();  // towards the scanner, not normalised
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d sum2 = Eigen::Matrix3d::Zero();
  int count = 0, num_in_patches = 0;

  void Add(const Eigen::Vector3d& point) {
    const Eigen::Vector3d offset = point - origin;
    sum += offset;
    sum2 += offset * offset.transpose();
    ++count;
  }

  void Add(const Cube& other) {
    const Eigen::Vector3d offset = other.origin - origin;
    sum2 += other.sum2 + other.sum * offset.transpose() + offset * other.sum.transpose() +
            other.count * offset * offset.transpose();
    sum += other.sum + other.count * offset;
    count += other.count;
    num_in_patches += other.num_in_patches;
  }
};

// Cubes of one size in the order in which the samples first meet them: the result does not depend
// on the hash.
class CubeGrid {
 public:
  explicit CubeGrid(double edge) : edge_(edge) {}

  double edge() const { return edge_; }
  std::vector<Cube>& cubes() { return cubes_; }

  void Add(const Eigen::Vector3d& point, const Eigen::Vector3d& station) {
    CubeIndex index;
    for (int k = 0; k < 3; ++k) index[k] = static_cast<int64_t>(std::floor(point[k] / edge_));
    if (cubes_.empty() || index != cubes_[last_].index) last_ = Find(index, point, station - point);
    cubes_[last_].Add(point);
  }

  // A cube of half the edge; returns the place of the one around it.
  int Add(const Cube& half) {
    CubeIndex index;
    for (int k = 0; k < 3; ++k) index[k] = half.index[k] >> 1;  // rounds down, negative ones, too
    const int place = Find(index, half.origin, half.station_side.cast<double>());
    cubes_[place].Add(half);
    return place;
  }

 private:
  int Find(const CubeIndex& index, const Eigen::Vector3d& origin, const Eigen::Vector3d& side) {
    const auto [at, is_new] = places_.try_emplace(Key(index), static_cast<int>(cubes_.size()));
    if (is_new) {
      cubes_.emplace_back();
      cubes_.back().index = index;
      cubes_.back().origin = origin;
      cubes_.back().station_side = side.cast<float>();
    }
    return at->second;
  }

  // 21 bits per axis; cubes two million cubes apart share a key only in scans of more than 100 km.
  static uint64_t Key(const CubeIndex& index) {
    uint64_t key = 0;
    for (int k = 0; k < 3; ++k) {
      key = (key << 21) | (static_cast<uint64_t>(index[k]) & 0x1fffff);
    }
    return key;
  }

  double edge_;
  std::unordered_map<uint64_t, int> places_;
  std::vector<Cube> cubes_;
  int last_ = 0;
};

std::optional<ScanPatch> FitPatch(const Cube& cube, double edge, const ScanPatchOptions& options) {
  const bool is_larger = edge > options.cell_size;
  if (cube.count < (is_larger ? kMoreInLarger : 1) * options.min_samples) return std::nullopt;
  const Eigen::Vector3d mean = cube.sum / cube.count;
  const Eigen::Matrix3d covariance = cube.sum2 / cube.count - mean * mean.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  const Eigen::Vector3d extents = solver.eigenvalues().cwiseMax(0).cwiseSqrt();
  // Flat, and wide enough in both directions for the plane not to turn about a line of samples.
  if (!(extents[0] < options.max_thickness_share * extents[1])) return std::nullopt;
  if (!(extents[1] > 0.08 * edge)) return std::nullopt;
  ScanPatch patch;
  patch.point = cube.origin + mean;
  patch.normal = solver.eigenvectors().col(0).normalized();
  if (patch.normal.dot(cube.station_side.cast<double>()) < 0) patch.normal *= -1;
  patch.thickness = extents[0];
  patch.num_samples = cube.count;
  patch.size = edge;
  return patch;
}

// What is kept of a cube when its samples have been tried.
struct TriedCube {
  int patch = -1;             // of those found; -1 = none
  int larger = -1;            // the cube of twice the edge around it; -1 = none was tried
  bool is_in_larger = false;  // that, or a larger one, makes a patch
};

std::vector<TriedCube> FitPatches(const ScanPatchOptions& options, CubeGrid* grid,
                                  std::vector<ScanPatch>* found) {
  std::vector<TriedCube> tried(grid->cubes().size());
  for (size_t i = 0; i < tried.size(); ++i) {
    Cube& cube = grid->cubes()[i];
    if (cube.num_in_patches > kMostInSmaller * cube.count) continue;
    const auto patch = FitPatch(cube, grid->edge(), options);
    if (!patch) continue;
    cube.num_in_patches = cube.count;
    tried[i].patch = static_cast<int>(found->size());
    found->push_back(*patch);
  }
  return tried;
}

}  // namespace

void VisitSurface(const Scan& scan, double spacing,
                  const std::function<void(const Eigen::Vector3d& x_in_scan)>& visit) {
  if (scan.organised || scan.triangles.empty()) {
    for (const Eigen::Vector3d& point : scan.points) {
      if (point.x() == point.x()) visit(point);
    }
    return;
  }
  for (const Triangle& t : scan.triangles) {
    VisitTriangle(scan.points[t[0]], scan.points[t[1]], scan.points[t[2]], spacing,
                  [&visit](const Eigen::Vector3d& x, double) { visit(x); });
  }
}

void ScanPatchOptions::Declare(OptionFields* fields) {
  const std::string sizes =
      "--Patches.cell_size must be positive and not above --Patches.max_cell_size";
  fields
      ->Number("Patches.cell_size", &cell_size,
               "Metres; edge of the cubes whose samples make one flat patch of the surface; larger "
               "= coarser.")
      .Positive()
      .SaysSentence(sizes);
  fields
      ->Number("Patches.max_cell_size", &max_cell_size,
               "Metres; samples that make no flat patch are tried together in cubes of twice the "
               "edge, up to this one; larger = more of coarse and noisy scans counts.")
      .Positive()
      .SaysSentence(sizes);
  fields->Require(max_cell_size >= cell_size, sizes);
  fields
      ->Int("Patches.min_samples", &min_samples,
            "Samples that a cube needs to make a patch; larger = fewer patches.")
      .AtLeast(4);
  fields
      ->Number("Patches.max_thickness_share", &max_thickness_share,
               "Thickness of a patch, as a share of its second extent, up to which it counts as "
               "flat; larger = more tolerant.")
      .Between(0, 1);
}

std::vector<std::string> ScanPatchOptions::Problems() const { return ProblemsOf(*this); }

ScanPatches::ScanPatches(const std::vector<Scan>& scans, const ScanPatchOptions& options) {
  CubeGrid grid(options.cell_size);
  for (const Scan& scan : scans) {
    const Eigen::Vector3d station = scan.Station();
    VisitSurface(scan, options.cell_size / 4,
                 [&](const Eigen::Vector3d& x_in_scan) { grid.Add(x_in_scan, station); });
  }
  std::vector<ScanPatch> found;
  std::vector<std::vector<TriedCube>> sizes = {FitPatches(options, &grid, &found)};
  // Sizes are doubled exactly, the largest is typed in decimals.
  while (2 * grid.edge() < 1.001 * options.max_cell_size) {
    CubeGrid larger(2 * grid.edge());
    for (size_t i = 0; i < sizes.back().size(); ++i) {
      sizes.back()[i].larger = larger.Add(grid.cubes()[i]);
    }
    grid = std::move(larger);
    sizes.push_back(FitPatches(options, &grid, &found));
  }
  for (size_t i = sizes.size(); i-- > 0;) {
    for (TriedCube& cube : sizes[i]) {
      if (cube.larger >= 0) {
        const TriedCube& larger = sizes[i + 1][cube.larger];
        cube.is_in_larger = larger.is_in_larger || larger.patch >= 0;
      }
      if (cube.patch >= 0 && !cube.is_in_larger) patches_.push_back(found[cube.patch]);
    }
  }
  if (!patches_.empty()) BuildTree(0, static_cast<int>(patches_.size()));
}

double ScanPatches::TypicalThickness() const {
  std::vector<double> thickness;
  for (const ScanPatch& patch : patches_) thickness.push_back(patch.thickness);
  return Median(&thickness);
}

int ScanPatches::BuildTree(int begin, int end) {
  const int index = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  nodes_[index].begin = begin;
  nodes_[index].end = end;
  for (int i = begin; i < end; ++i) {
    nodes_[index].max_size2 = std::max(nodes_[index].max_size2, std::pow(patches_[i].size, 2));
  }
  if (end - begin <= kLeafSize) return index;
  Eigen::Vector3d low = patches_[begin].point, high = low;
  for (int i = begin; i < end; ++i) {
    low = low.cwiseMin(patches_[i].point);
    high = high.cwiseMax(patches_[i].point);
  }
  int axis = 0;
  (high - low).maxCoeff(&axis);
  const int middle = begin + (end - begin) / 2;
  std::nth_element(
      patches_.begin() + begin, patches_.begin() + middle, patches_.begin() + end,
      [axis](const ScanPatch& a, const ScanPatch& b) { return a.point[axis] < b.point[axis]; });
  nodes_[index].axis = axis;
  nodes_[index].split = patches_[middle].point[axis];
  const int left = BuildTree(begin, middle);
  const int right = BuildTree(middle, end);
  nodes_[index].left = left;
  nodes_[index].right = right;
  return index;
}

struct ScanPatches::Best {
  int patch = -1;
  double power = std::numeric_limits<double>::infinity();
};

void ScanPatches::Search(int node_index, const Eigen::Vector3d& x, double gate2, Best* best) const {
  const Node& node = nodes_[node_index];
  if (node.axis < 0) {
    for (int i = node.begin; i < node.end; ++i) {
      const double distance2 = (patches_[i].point - x).squaredNorm();
      const double size2 = patches_[i].size * patches_[i].size;
      const double power = distance2 - size2 / 4;
      if (distance2 < gate2 + size2 && power < best->power) *best = {i, power};
    }
    return;
  }
  const double side = x[node.axis] - node.split;
  Search(side < 0 ? node.left : node.right, x, gate2, best);
  const Node& other = nodes_[side < 0 ? node.right : node.left];
  if (side * side < gate2 + other.max_size2 && side * side - other.max_size2 / 4 < best->power) {
    Search(side < 0 ? node.right : node.left, x, gate2, best);
  }
}

std::optional<ScanPatches::Nearest> ScanPatches::FindNearest(const Eigen::Vector3d& x_in_scan,
                                                             double gate) const {
  if (patches_.empty() || !x_in_scan.allFinite()) return std::nullopt;
  Best best;
  Search(0, x_in_scan, gate * gate, &best);
  if (best.patch < 0) return std::nullopt;
  const ScanPatch& patch = patches_[best.patch];
  return Nearest{best.patch, patch.normal.dot(x_in_scan - patch.point)};
}

}  // namespace roomtex
