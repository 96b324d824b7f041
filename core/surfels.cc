#include "core/surfels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "core/frames.h"
#include "core/free_vectors.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr int kMaxLevel = 21;          // of the octree: three times as many bits in a key
constexpr int kPointsOfLeaf = 8;       // at most
constexpr int kPointsOfWindow = 600;   // no plane rests on more
constexpr double kMostExcess = 1.6;    // of variance over that of the finer cells: still one plane
constexpr double kPriorPoints = 8;     // weight of the cloud's usual noise where points are few
constexpr double kWorstNormal = 0.25;  // radians; standard deviation of a normal that is one
constexpr double kReach = 1.0;         // of the spacing, beyond the outermost points of a leaf
constexpr double kStray = 4;  // noises; farther from its plane a point is not moved onto it

uint64_t SpreadBits(uint64_t v) {  // 21 bits to every third
  v = (v | v << 32) & 0x1f00000000ffffULL;
  v = (v | v << 16) & 0x1f0000ff0000ffULL;
  v = (v | v << 8) & 0x100f00f00f00f00fULL;
  v = (v | v << 4) & 0x10c30c30c30c30c3ULL;
  return (v | v << 2) & 0x1249249249249249ULL;
}

// The measured points in the order of a Morton curve, so that every cell of the octree is a range.
struct SortedPoints {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // middle of the cloud
  double size = 0;                                   // edge of the cube that the octree divides
  std::vector<uint64_t> keys;
  std::vector<int> index;              // of the cloud
  std::vector<Eigen::Vector3f> place;  // relative to the origin
};

SortedPoints SortPoints(const Scan& cloud) {
  SortedPoints sorted;
  const Bounds bounds = FindBounds(cloud);
  if (!(bounds.min.x() <= bounds.max.x())) return sorted;
  sorted.origin = 0.5 * (bounds.min + bounds.max);
  sorted.size = std::max(1e-6, 1.0001 * (bounds.max - bounds.min).maxCoeff());
  const double cells = static_cast<double>(1 << kMaxLevel) / sorted.size;
  std::vector<std::pair<uint64_t, int>> order;
  order.reserve(cloud.points.size());
  for (size_t i = 0; i < cloud.points.size(); ++i) {
    if (cloud.IsMissing(static_cast<int>(i))) continue;
    const Eigen::Vector3d at = cells * (cloud.points[i] - bounds.min);
    uint64_t key = 0;
    for (int k = 0; k < 3; ++k) {
      key |= SpreadBits(std::min<uint64_t>(static_cast<uint64_t>(at[k]), (1 << kMaxLevel) - 1))
             << k;
    }
    order.emplace_back(key, static_cast<int>(i));
  }
  std::sort(order.begin(), order.end());
  sorted.keys.reserve(order.size());
  sorted.index.reserve(order.size());
  sorted.place.reserve(order.size());
  for (const auto& [key, i] : order) {
    sorted.keys.push_back(key);
    sorted.index.push_back(i);
    sorted.place.push_back((cloud.points[static_cast<size_t>(i)] - sorted.origin).cast<float>());
  }
  return sorted;
}

// Sums of points relative to some origin, and the plane of total least squares through them.
struct Sums {
  double n = 0;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();

  void Add(const Eigen::Vector3d& x) {
    n += 1;
    first += x;
    second.noalias() += x * x.transpose();
  }
  void Add(const Sums& other) {
    n += other.n;
    first += other.first;
    second += other.second;
  }
};

struct Plane {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
  Eigen::Vector3d variances = Eigen::Vector3d::Zero();  // ascending, along the axes
  double n = 0;

  // One line of a scanner: across it lies its noise, whichever way.
  bool IsLine() const { return variances[1] < 0.01 * variances[2]; }
  // Sum of the squared distances, and how many of them are free.
  double Residue() const {
    return n * (IsLine() ? 0.5 * (variances[0] + variances[1]) : variances[0]);
  }
  double Freedom() const { return std::max(0.0, n - (IsLine() ? 2 : 3)); }
  // Standard deviation of the normal, radians, if the points scatter like this.
  double NormalSigma(double noise) const {
    return variances[1] > 0 ? noise / std::sqrt(n * variances[1]) : 10;
  }
  double Spacing() const {  // evenly filled rectangles: area = 12 sqrt(variances)
    return std::sqrt(12 * std::sqrt(variances[1] * variances[2]) / n);
  }
};

Plane FitPlane(const Sums& sums) {
  Plane plane;
  plane.n = sums.n;
  plane.mean = sums.first / sums.n;
  const Eigen::Matrix3d covariance = sums.second / sums.n - plane.mean * plane.mean.transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  plane.variances = solver.eigenvalues().cwiseMax(0);
  plane.normal = solver.eigenvectors().col(0).normalized();
  if (!plane.normal.allFinite()) plane.normal.setZero();
  return plane;
}

struct Surfel {
  std::array<Eigen::Vector3f, 4> corners;           // around it, relative to the origin
  Eigen::Vector3f front = Eigen::Vector3f::Zero();  // sum of the file's normals, zero = none
  float intensity = 0;
};

// One part of the octree: a cell of at most kPointsOfWindow points, and the cells in it.
class Part {
 public:
  // usual_noise: metres; 0 = not known yet. fronts: normals of the cloud's points, or null.
  Part(const SortedPoints& sorted, const Eigen::Vector3d& station, double usual_noise,
       const std::vector<Eigen::Vector3f>* fronts = nullptr)
      : sorted_(sorted), station_(station), noise_(usual_noise), fronts_(fronts) {}

  void Grow(size_t begin, size_t end, int level) {
    nodes_.clear();
    centre_ = sorted_.place[begin].cast<double>();
    Divide(begin, end, level);
  }

  // Noise of the leaves' own planes and spacing of the points, for the usual ones.
  void Observe(std::vector<float>* noises, std::vector<float>* spacings) const {
    for (const Node& node : nodes_) {
      if (node.first_child >= 0 || node.plane.n < 6 || node.plane.IsLine()) continue;
      noises->push_back(static_cast<float>(std::sqrt(node.plane.Residue() / node.plane.Freedom())));
      spacings->push_back(static_cast<float>(node.plane.Spacing()));
    }
  }

  void Emit(const std::vector<float>& intensity, CloudSurface* surface,
            std::vector<Surfel>* surfels) {
    intensity_ = &intensity;
    surface_ = surface;
    surfels_ = surfels;
    if (!nodes_.empty()) EmitNode(0);
  }

 private:
  struct Node {
    size_t begin = 0, end = 0;
    int level = 0;
    int first_child = -1, next = -1;  // next: sibling
    Sums sums;
    Plane plane;
    // What the best planes for its points leave over.
    double residue = 0, freedom = 0;
    bool is_flat = false;  // one plane is as good as several
  };

  Eigen::Vector3d At(size_t i) const { return sorted_.place[i].cast<double>() - centre_; }

  double Noise(double residue, double freedom) const {
    return std::sqrt((residue + kPriorPoints * noise_ * noise_) / (freedom + kPriorPoints));
  }

  int Divide(size_t begin, size_t end, int level) {
    const int number = static_cast<int>(nodes_.size());
    nodes_.emplace_back();
    nodes_[number].begin = begin;
    nodes_[number].end = end;
    nodes_[number].level = level;
    Sums sums;
    double residue = 0, freedom = 0;
    if (end - begin <= kPointsOfLeaf || level >= kMaxLevel) {
      for (size_t i = begin; i < end; ++i) sums.Add(At(i));
    } else {
      int last = -1;
      for (size_t at = begin; at < end;) {
        const size_t stop = EndOfChild(at, end, level);
        const int child = Divide(at, stop, level + 1);
        (last < 0 ? nodes_[number].first_child : nodes_[last].next) = child;
        last = child;
        sums.Add(nodes_[child].sums);
        residue += nodes_[child].residue;
        freedom += nodes_[child].freedom;
        at = stop;
      }
    }
    Node& node = nodes_[number];
    node.sums = sums;
    node.plane = FitPlane(sums);
    const Plane& plane = node.plane;
    const double expected = std::pow(Noise(residue, freedom), 2);
    const double found = plane.Freedom() > 0 ? plane.Residue() / plane.Freedom() : 0;
    node.is_flat = plane.n >= 6 && !plane.IsLine() && found <= kMostExcess * expected &&
                   plane.NormalSigma(std::sqrt(std::max(found, expected))) < kWorstNormal;
    if (node.is_flat || node.first_child < 0) {
      residue = plane.Residue();
      freedom = plane.Freedom();
    }
    node.residue = residue;
    node.freedom = freedom;
    return number;
  }

  size_t EndOfChild(size_t at, size_t end, int level) const {
    const int shift = 3 * (kMaxLevel - level - 1);
    const uint64_t child = sorted_.keys[at] >> shift;
    return static_cast<size_t>(
        std::partition_point(sorted_.keys.begin() + static_cast<std::ptrdiff_t>(at),
                             sorted_.keys.begin() + static_cast<std::ptrdiff_t>(end),
                             [&](uint64_t key) { return key >> shift == child; }) -
        sorted_.keys.begin());
  }

  void EmitNode(int number) {
    const Node& node = nodes_[number];
    if (node.is_flat) {
      EmitFlat(number, node.plane);
    } else if (node.first_child < 0) {
      EmitAlone(number);
    } else {
      for (int c = node.first_child; c >= 0; c = nodes_[c].next) {
        around_.push_back(number);
        EmitNode(c);
        around_.pop_back();
      }
    }
  }

  // The leaves of a flat cell, all on its plane.
  void EmitFlat(int number, const Plane& plane) {
    const Node& node = nodes_[number];
    bool splits = node.first_child >= 0;
    // Lines of a scanner are no surface each: the cell that holds several of them is.
    int lines = 0, children = 0;
    for (int c = node.first_child; c >= 0; c = nodes_[c].next) {
      ++children;
      lines += nodes_[c].plane.n < 3 || nodes_[c].plane.IsLine();
    }
    if (splits && 2 * lines > children && node.end - node.begin < 16 * kPointsOfLeaf) {
      splits = false;
    }
    if (splits) {
      for (int c = node.first_child; c >= 0; c = nodes_[c].next) EmitFlat(c, plane);
      return;
    }
    const double reach = lines > 0 ? 0.25 * std::ldexp(sorted_.size, -node.level) : 0;
    EmitRectangle(node.begin, node.end, plane, std::max(reach, kReach * plane.Spacing()));
    const double limit = kStray * Noise(plane.Residue(), plane.Freedom());
    for (size_t i = node.begin; i < node.end; ++i) Settle(i, plane, limit);
  }

  // A leaf beside an edge, or of too few points: each point goes to the plane of a neighbour.
  void EmitAlone(int number) {
    const Node& node = nodes_[number];
    std::vector<const Plane*> planes;
    for (size_t k = around_.size(); k > 0 && k + 2 > around_.size(); --k) {
      CollectFlat(around_[k - 1], &planes);
    }
    const Plane& own = node.plane;
    const double own_noise = Noise(own.Residue(), own.Freedom());
    const bool own_is_one = own.n >= 4 && own.NormalSigma(own_noise) < kWorstNormal;
    for (size_t i = node.begin; i < node.end; ++i) {
      const Eigen::Vector3d x = At(i);
      const Plane* best = nullptr;
      double best_distance = 3;  // noises
      for (const Plane* plane : planes) {
        const Eigen::Vector3d offset = x - plane->mean;
        const double across = std::abs(plane->normal.dot(offset));
        const double reach = 3 * std::sqrt(plane->variances[2]) + 2 * plane->Spacing();
        if (offset.norm() > reach) continue;
        const double distance = across / Noise(plane->Residue(), plane->Freedom());
        if (distance < best_distance) {
          best_distance = distance;
          best = plane;
        }
      }
      if (best == nullptr && own_is_one) best = &own;
      if (best == nullptr) {
        Settle(i, Plane(), 0);
        continue;
      }
      EmitRectangle(i, i + 1, *best, kReach * best->Spacing());
      Settle(i, *best, kStray * Noise(best->Residue(), best->Freedom()));
    }
  }

  void CollectFlat(int number, std::vector<const Plane*>* planes) const {
    const Node& node = nodes_[number];
    if (node.is_flat) {
      planes->push_back(&node.plane);
      return;
    }
    for (int c = node.first_child; c >= 0; c = nodes_[c].next) CollectFlat(c, planes);
  }

  // On the plane, along the axes of the octree as far as that goes: what lies on one of their
  // planes is covered without overlaps.
  void EmitRectangle(size_t begin, size_t end, const Plane& plane, double reach) {
    int axis = 0;
    plane.normal.cwiseAbs().minCoeff(&axis);
    const Eigen::Vector3d u =
        (Eigen::Vector3d::Unit(axis) - plane.normal[axis] * plane.normal).normalized();
    const Eigen::Vector3d v = plane.normal.cross(u);
    Eigen::Vector2d low(1e300, 1e300), high(-1e300, -1e300);
    double intensity = 0;
    Surfel surfel;
    for (size_t i = begin; i < end; ++i) {
      const Eigen::Vector3d offset = At(i) - plane.mean;
      const Eigen::Vector2d at(u.dot(offset), v.dot(offset));
      low = low.cwiseMin(at);
      high = high.cwiseMax(at);
      const auto index = static_cast<size_t>(sorted_.index[i]);
      intensity += (*intensity_)[index];
      if (fronts_ != nullptr) surfel.front += (*fronts_)[index];
    }
    low.array() -= reach;
    high.array() += reach;
    surfel.intensity = static_cast<float>(intensity / static_cast<double>(end - begin));
    const double at[4][2] = {
        {low[0], low[1]}, {high[0], low[1]}, {high[0], high[1]}, {low[0], high[1]}};
    for (int k = 0; k < 4; ++k) {
      surfel.corners[k] = (centre_ + plane.mean + at[k][0] * u + at[k][1] * v).cast<float>();
    }
    surfels_->push_back(surfel);
  }

  // What is known of the point; a plane without a normal = nothing.
  void Settle(size_t i, const Plane& plane, double limit) {
    const auto index = static_cast<size_t>(sorted_.index[i]);
    surface_->normals[index] = plane.normal.cast<float>();
    surface_->spacings[index] = plane.n > 0 ? static_cast<float>(plane.Spacing()) : 0.0f;
    if (surface_->angular_spacing > 0 && plane.normal.dot(station_ - surface_->points[index]) < 0) {
      surface_->normals[index] *= -1;
    }
    if (fronts_ != nullptr && surface_->normals[index].dot((*fronts_)[index]) < 0) {
      surface_->normals[index] *= -1;
    }
    const double distance = plane.normal.dot(At(i) - plane.mean);
    if (std::abs(distance) <= limit) surface_->points[index] -= distance * plane.normal;
  }

  const SortedPoints& sorted_;
  Eigen::Vector3d station_;
  double noise_;
  const std::vector<Eigen::Vector3f>* fronts_;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  std::vector<Node> nodes_;
  std::vector<int> around_;  // the cells that hold the one at hand, outermost first
  const std::vector<float>* intensity_ = nullptr;
  CloudSurface* surface_ = nullptr;
  std::vector<Surfel>* surfels_ = nullptr;
};

struct Cell {
  size_t begin, end;
  int level;
};

// The largest cells of at most kPointsOfWindow points.
void FindParts(const SortedPoints& sorted, const Cell& cell, std::vector<Cell>* parts) {
  if (cell.end - cell.begin <= kPointsOfWindow || cell.level >= kMaxLevel) {
    parts->push_back(cell);
    return;
  }
  const int shift = 3 * (kMaxLevel - cell.level - 1);
  for (size_t at = cell.begin; at < cell.end;) {
    const uint64_t child = sorted.keys[at] >> shift;
    const auto stop =
        std::partition_point(sorted.keys.begin() + static_cast<std::ptrdiff_t>(at),
                             sorted.keys.begin() + static_cast<std::ptrdiff_t>(cell.end),
                             [&](uint64_t key) { return key >> shift == child; });
    const auto end = static_cast<size_t>(stop - sorted.keys.begin());
    FindParts(sorted, {at, end, cell.level + 1}, parts);
    at = end;
  }
}

// Radians between neighbouring points seen from the station; 0 if many lie behind another: those of
// one place share their direction only at edges.
double FindAngularSpacing(const Scan& cloud) {
  constexpr double kPointsOfDirection = 4, kBehind = 1.1, kMostHidden = 0.03, kLeastSphere = 0.05;
  const double count = static_cast<double>(cloud.points.size());
  const int rows =
      std::clamp(static_cast<int>(std::sqrt(count / kPointsOfDirection / 2)), 16, 1024);
  const int columns = 2 * rows;
  std::vector<float> nearest(static_cast<size_t>(columns) * rows, 1e30f);
  const auto look = [&](const Eigen::Vector3d& offset) -> float& {  // cells of equal solid angle
    const auto cell = [](double share, int cells) {
      return static_cast<size_t>(std::clamp(static_cast<int>(share * cells), 0, cells - 1));
    };
    const double azimuth = std::atan2(offset.y(), offset.x()) / (2 * kPi) + 0.5;
    const double height = 0.5 * offset.z() / std::max(offset.norm(), 1e-9) + 0.5;
    return nearest[cell(height, rows) * static_cast<size_t>(columns) + cell(azimuth, columns)];
  };
  for (const Eigen::Vector3d& point : cloud.points) {
    const Eigen::Vector3d offset = point - cloud.Station();
    if (!offset.allFinite()) continue;
    float& least = look(offset);
    least = std::min(least, static_cast<float>(offset.norm()));
  }
  size_t num_points = 0, num_hidden = 0;
  for (const Eigen::Vector3d& point : cloud.points) {
    const Eigen::Vector3d offset = point - cloud.Station();
    if (!offset.allFinite()) continue;
    ++num_points;
    num_hidden += offset.norm() > kBehind * look(offset);
  }
  if (static_cast<double>(num_hidden) > kMostHidden * static_cast<double>(num_points)) return 0;
  const auto num_cells =
      std::count_if(nearest.begin(), nearest.end(), [](float range) { return range < 1e30f; });
  const double share = static_cast<double>(num_cells) / static_cast<double>(nearest.size());
  if (share < kLeastSphere) return 0;
  return std::sqrt(4 * kPi * share / std::max(1.0, static_cast<double>(num_points)));
}

// The normals of the file have a side: see CloudSurface.
bool NormalsAreTurned(const Scan& cloud, const Eigen::Vector3d& middle) {
  constexpr double kMostOfThem = 0.75;
  if (cloud.normals.size() != cloud.points.size()) return false;
  size_t num_towards = 0, num_asked = 0;
  for (size_t i = 0; i < cloud.points.size(); i += cloud.points.size() / 100000 + 1) {
    if (cloud.IsMissing(static_cast<int>(i)) || cloud.normals[i].isZero()) continue;
    ++num_asked;
    num_towards += cloud.normals[i].cast<double>().dot(middle - cloud.points[i]) > 0;
  }
  const double share = static_cast<double>(num_towards) / std::max<size_t>(1, num_asked);
  return num_asked > 0 && std::max(share, 1 - share) >= kMostOfThem;
}

Scan MeshOfSurfels(const Scan& cloud, bool station_is_known, const Eigen::Vector3d& origin,
                   std::vector<std::vector<Surfel>>* blocks) {
  Scan mesh;
  mesh.path = cloud.path;
  mesh.name = cloud.name;
  mesh.up = cloud.up;
  mesh.organised = false;
  mesh.scan_from_station = cloud.scan_from_station;
  mesh.station_is_assumed = cloud.station_is_assumed;
  if (!station_is_known) mesh.viewpoint = cloud.scan_from_station.Inverse() * origin;
  size_t count = 0;
  for (const std::vector<Surfel>& block : *blocks) count += block.size();
  mesh.points.reserve(4 * count);
  mesh.intensity.reserve(4 * count);
  mesh.triangles.reserve(2 * count);
  for (std::vector<Surfel>& block : *blocks) {
    for (const Surfel& surfel : block) {
      const int first = static_cast<int>(mesh.points.size());
      for (const Eigen::Vector3f& corner : surfel.corners) {
        mesh.points.emplace_back(origin + corner.cast<double>());
        mesh.intensity.push_back(surfel.intensity);
      }
      const Eigen::Vector3d& a = mesh.points[first];
      const Eigen::Vector3d normal = (mesh.points[first + 1] - a).cross(mesh.points[first + 2] - a);
      const Eigen::Vector3d front =
          surfel.front.isZero() ? Eigen::Vector3d(mesh.Station() - a) : surfel.front.cast<double>();
      const bool is_turned = normal.dot(front) < 0;
      for (const int k : {1, 2}) {
        mesh.triangles.push_back({first, first + k + is_turned, first + k + !is_turned});
      }
    }
    FreeVectors(&block);
  }
  mesh.num_columns = static_cast<int>(mesh.points.size());
  mesh.num_rows = 1;
  return mesh;
}

}  // namespace

CloudSurface FindCloudSurface(const Scan& cloud, int num_threads) {
  constexpr int kPartsAtOnce = 2000;
  constexpr size_t kPartsAsked = 2000;
  CloudSurface surface;
  surface.points = cloud.points;
  surface.normals.assign(cloud.points.size(), Eigen::Vector3f::Zero());
  surface.spacings.assign(cloud.points.size(), 0.0f);
  const SortedPoints sorted = SortPoints(cloud);
  std::vector<Cell> parts;
  if (!sorted.keys.empty()) FindParts(sorted, {0, sorted.keys.size(), 0}, &parts);

  surface.angular_spacing = FindAngularSpacing(cloud);
  const bool has_fronts = !(surface.angular_spacing > 0) && NormalsAreTurned(cloud, sorted.origin);
  surface.front_is_known = surface.angular_spacing > 0 || has_fronts;

  std::vector<float> noises, spacings;
  Part asked(sorted, cloud.Station(), 0);
  for (size_t i = 0; i < parts.size(); i += parts.size() / kPartsAsked + 1) {
    asked.Grow(parts[i].begin, parts[i].end, parts[i].level);
    asked.Observe(&noises, &spacings);
  }
  surface.noise = Median(&noises);

  // Of points without noise rounding is left.
  const double noise =
      std::max({surface.noise, 1e-3 * static_cast<double>(Median(&spacings)), 1e-7 * sorted.size});
  const int num_blocks = (static_cast<int>(parts.size()) + kPartsAtOnce - 1) / kPartsAtOnce;
  std::vector<std::vector<Surfel>> blocks(static_cast<size_t>(num_blocks));
  ParallelFor(num_threads, 0, num_blocks, [&](int block) {
    Part part(sorted, cloud.Station(), noise, has_fronts ? &cloud.normals : nullptr);
    const int end = std::min<int>((block + 1) * kPartsAtOnce, static_cast<int>(parts.size()));
    for (int i = block * kPartsAtOnce; i < end; ++i) {
      part.Grow(parts[i].begin, parts[i].end, parts[i].level);
      part.Emit(cloud.intensity, &surface, &blocks[static_cast<size_t>(block)]);
    }
  });
  spacings.clear();
  for (size_t i = 0; i < surface.spacings.size(); i += surface.spacings.size() / 100000 + 1) {
    if (surface.spacings[i] > 0) spacings.push_back(surface.spacings[i]);
  }
  surface.spacing = Median(&spacings);
  surface.patches = MeshOfSurfels(cloud, surface.angular_spacing > 0, sorted.origin, &blocks);
  return surface;
}

Scan GridAroundStation(const Scan& cloud, const Eigen::Vector3d& station, size_t begin, size_t end,
                       int num_rows) {
  Scan grid;
  grid.path = cloud.path;
  grid.name = cloud.name;
  grid.up = cloud.up;
  grid.scan_from_station = {cloud.scan_from_station.rotation, station};
  grid.num_rows = num_rows;
  grid.num_columns = 2 * grid.num_rows;
  const size_t cells = static_cast<size_t>(grid.num_columns) * static_cast<size_t>(grid.num_rows);
  grid.points.assign(cells, Scan::MissingPoint());
  grid.intensity.assign(cells, 0.0f);
  std::vector<float> nearest(cells, 1e30f);
  const Eigen::Vector3d forward = cloud.up.unitOrthogonal(), left = cloud.up.cross(forward);
  for (size_t i = begin; i < end; ++i) {
    const Eigen::Vector3d offset = cloud.points[i] - station;
    const double range = offset.norm();
    if (!(range > 0)) continue;
    const double elevation = std::asin(std::clamp(offset.dot(cloud.up) / range, -1.0, 1.0));
    const double azimuth = std::atan2(offset.dot(left), offset.dot(forward));
    const int row = static_cast<int>((0.5 - elevation / kPi) * grid.num_rows);
    const int column = static_cast<int>((0.5 - azimuth / (2 * kPi)) * grid.num_columns);
    const auto cell = static_cast<size_t>(
        grid.Index(std::min(column, grid.num_columns - 1), std::min(row, grid.num_rows - 1)));
    if (range >= nearest[cell]) continue;
    nearest[cell] = static_cast<float>(range);
    grid.points[cell] = cloud.points[i];
    grid.intensity[cell] = cloud.intensity[i];
  }
  return grid;
}

void ReplaceClouds(std::vector<Scan>* scans, int num_threads) {
  for (Scan& scan : *scans) {
    if (scan.kind() == Scan::Kind::kCloud) scan = FindCloudSurface(scan, num_threads).patches;
  }
}

}  // namespace roomtex
