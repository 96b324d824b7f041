#include "align/surface/plane_regions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/decompositions.h"
#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Waviness of a surface, and the bend of a scan, change over about this length, metres: cells
// nearer to each other share them.
constexpr double kWaveLength = 0.2;
constexpr double kLeastWaves = 0.0002;  // metres; no surface is known to be flatter
constexpr double kNoiseGates = 2.5;     // standard deviations that noise may add to a limit
constexpr double kMostCurved = 0.6;     // of the largest angle: how far ends may turn
constexpr int kRounds = 12;             // of growing and fitting
constexpr double kRefitGrowth = 1.3;  // the plane is fitted anew when the region has grown by this
constexpr double kHysteresis = 1.3;   // a cell leaves its region beyond this many times the limits
// A cell that was in so many refused regions lies on a curved surface.
constexpr uint8_t kMostTries = 6;
constexpr double kLeastAmid = 0.2;  // share of a region's cells
constexpr int kFewestCells = 12;
constexpr double kMostPieces = 1500;

// Grows one region after the other.
class RegionGrower {
 public:
  RegionGrower(const ScanSurface& surface, const ScanPlaneOptions& options)
      : surface_(surface),
        cells_(surface.cells()),
        options_(options),
        max_angle_(RadFromDeg(options.max_angle_deg)),
        region_of_(cells_.size(), -1),
        tried_(cells_.size(), 0) {}

  // Cells amid flat surface, the smoothest first.
  std::vector<int> Seeds() const {
    std::vector<std::pair<float, int>> seeds;
    for (size_t i = 0; i < cells_.size(); ++i) {
      if (!cells_[i].flat) continue;
      int flat = 0;
      const int index = static_cast<int>(i);
      surface_.ForNeighbours(index, [&](int other) {
        flat += cells_[other].flat && Continues(index, other) &&
                Angle(cells_[i].normal.cast<double>(), cells_[other]) < max_angle_;
      });
      if (flat >= 5) seeds.emplace_back(cells_[i].roughness, index);
    }
    std::sort(seeds.begin(), seeds.end());
    std::vector<int> indices;
    for (const auto& seed : seeds) indices.push_back(seed.second);
    return indices;
  }

  bool IsFree(int cell) const { return region_of_[cell] < 0 && !tried_[cell]; }

  // The cells of the region around the seed; they belong to `region` from now on.
  std::vector<int> Grow(int seed, int region) {
    std::vector<int> members;
    Moments moments;
    const auto take = [&](int cell) {
      region_of_[cell] = region;
      tried_[cell] = std::max<uint8_t>(tried_[cell], 1);
      members.push_back(cell);
      moments.Add(cells_[cell].point, cells_[cell].area);
    };
    take(seed);
    normal_ = cells_[seed].normal.cast<double>();
    mean_ = cells_[seed].point;
    limit_ = options_.max_distance;
    size_t at = 0;
    for (int round = 0; round < kRounds; ++round) {
      double fitted_weight = moments.weight();
      const size_t before = members.size();
      for (; at < members.size(); ++at) {
        const int cell = members[at];
        surface_.ForNeighbours(cell, [&](int other) {
          if (region_of_[other] < 0 && cells_[other].flat && tried_[other] < kMostTries &&
              Belongs(other, 1) && Continues(cell, other)) {
            take(other);
          }
        });
        if (members.size() >= 6 && moments.weight() > kRefitGrowth * fitted_weight) {
          Refit(moments);
          fitted_weight = moments.weight();
        }
      }
      if (round > 0 && members.size() == before) break;
      if (members.size() < 6) break;
      Refit(moments);
      SetLimit(members);
      moments = Moments();
      std::vector<int> kept;
      for (int cell : members) {
        if (Belongs(cell, kHysteresis)) {
          kept.push_back(cell);
          moments.Add(cells_[cell].point, cells_[cell].area);
        } else {
          region_of_[cell] = -1;
        }
      }
      members.swap(kept);
      if (members.size() < 6) break;
      Refit(moments);
      at = 0;
    }
    return members;
  }

  void Release(const std::vector<int>& members) {
    for (int cell : members) {
      region_of_[cell] = -1;
      ++tried_[cell];
    }
  }

  const std::vector<int>& region_of() const { return region_of_; }
  std::vector<int> TakeRegions() { return std::move(region_of_); }

 private:
  void Refit(const Moments& moments) {
    const PlaneFit fit = FitPlane(moments);
    if (!fit.normal.allFinite()) return;
    normal_ = fit.normal.dot(normal_) < 0 ? Eigen::Vector3d(-fit.normal) : fit.normal;
    mean_ = fit.mean;
  }

  // Median distance of the members from the plane, by area. (Not WeightedMedian(): it sums the
  // weights upwards, and the last bit decides between regions.)
  double MedianDistance(const std::vector<int>& members) const {
    std::vector<std::pair<double, float>> distances;
    double area = 0;
    for (int cell : members) {
      distances.emplace_back(std::abs(normal_.dot(cells_[cell].point - mean_)), cells_[cell].area);
      area += cells_[cell].area;
    }
    std::sort(distances.begin(), distances.end());
    for (const auto& [distance, share] : distances) {
      area -= 2 * share;
      if (area <= 0) return distance;
    }
    return 0;
  }

  // A surface that leaked in over a step (a thin poster) is farther from the plane than the
  // region's own waves, and draws the plane to itself: without what is far off the plane fits the
  // rest far better. A bend is no such case, it gains little.
  void SetLimit(const std::vector<int>& all_members) {
    std::vector<int> members;  // enough of them
    const size_t stride = all_members.size() / 2000 + 1;
    for (size_t i = 0; i < all_members.size(); i += stride) members.push_back(all_members[i]);
    const Eigen::Vector3d normal = normal_, mean = mean_;
    const double median = MedianDistance(members);
    double trimmed = median;
    for (int i = 0; i < 6; ++i) {
      Moments moments;
      const double far = 2.5 * trimmed + options_.min_step / 10;
      for (int cell : members) {
        const SurfaceCell& c = cells_[cell];
        if (std::abs(normal_.dot(c.point - mean_)) < far) moments.Add(c.point, c.area);
      }
      if (!(moments.weight() > 0)) break;
      Refit(moments);
      trimmed = MedianDistance(members);
    }
    if (trimmed > 0.6 * median) {
      trimmed = median;
      normal_ = normal;
      mean_ = mean;
    }
    limit_ = std::min(options_.max_distance, options_.min_step / 2 + 3 / kMadPerSigma * trimmed);
  }

  static double Angle(const Eigen::Vector3d& normal, const SurfaceCell& cell) {
    return normal.cross(cell.normal.cast<double>()).norm();
  }

  // The cell lies in the region's plane as it is now.
  bool Belongs(int index, double slack) const {
    const SurfaceCell& cell = cells_[index];
    if (normal_.dot(cell.normal.cast<double>()) < 0.5) return false;
    if (std::abs(normal_.dot(cell.point - mean_)) >
        slack * limit_ + kNoiseGates * cell.point_sigma) {
      return false;
    }
    return Angle(normal_, cell) < slack * max_angle_ + kNoiseGates * cell.normal_sigma;
  }

  // No step between two neighbours.
  bool Continues(int a, int b) const {
    const SurfaceCell &from = cells_[a], &to = cells_[b];
    const Eigen::Vector3d normal = (from.normal + to.normal).cast<double>().normalized();
    const Eigen::Vector3d between = to.point - from.point;
    const double slope_sigma = 0.7 * std::max(from.normal_sigma, to.normal_sigma) * between.norm();
    const double sigma = std::sqrt(from.point_sigma * from.point_sigma +
                                   to.point_sigma * to.point_sigma + slope_sigma * slope_sigma);
    return std::abs(normal.dot(between)) < options_.min_step + kNoiseGates * sigma;
  }

  const ScanSurface& surface_;
  const std::vector<SurfaceCell>& cells_;
  const ScanPlaneOptions& options_;
  const double max_angle_;
  std::vector<int> region_of_;
  // In how many regions each cell has been; one that was in any starts none of its own.
  std::vector<uint8_t> tried_;
  Eigen::Vector3d normal_, mean_;  // of the region that grows
  double limit_ = 0;               // of the distance from its plane
};

// A large region in about kMostPieces pieces: it is summed up again whenever another one joins it.
PlaneRegion MakeRegion(const ScanSurface& surface, const std::vector<int>& members) {
  double area = 0;
  for (int index : members) area += surface.cells()[index].area;
  const double size = std::sqrt(area / kMostPieces);
  struct Piece {
    Moments moments;
    double inverse_variance = 0, noise = 0;
  };
  std::map<std::array<int, 3>, Piece> pieces;
  for (int index : members) {
    const SurfaceCell& cell = surface.cells()[index];
    const Eigen::Vector3i cube = (cell.point / size).array().floor().cast<int>().matrix();
    Piece& piece = pieces[{cube[0], cube[1], cube[2]}];
    piece.moments.Add(cell.point, cell.area);
    piece.inverse_variance += cell.count / std::pow(cell.noise, 2);
    piece.noise += cell.area * cell.noise;
  }
  PlaneRegion region;
  for (const auto& [cube, piece] : pieces) {
    region.cells.push_back({piece.moments.sums.segment<3>(1).matrix() / piece.moments.weight(),
                            static_cast<float>(piece.moments.weight()),
                            static_cast<float>(1 / piece.inverse_variance),
                            static_cast<float>(piece.noise / piece.moments.weight())});
  }
  SummariseRegion(surface.station(), &region);
  return region;
}

// The turn of the ends of the region against its plane, by the quadric that fits its heights.
double FindEndSlope(const PlaneRegion& region) {
  Eigen::Matrix<double, 6, 6> normal_matrix = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
  for (const RegionCell& cell : region.cells) {
    const Eigen::Vector3d offset = cell.point - region.mean;
    const double u = offset.dot(region.u) / region.extent_u;
    const double v = offset.dot(region.v) / region.extent_v;
    Eigen::Matrix<double, 6, 1> row;
    row << 1, u, v, u * u, u * v, v * v;
    normal_matrix += cell.area * row * row.transpose();
    right += cell.area * offset.dot(region.normal) * row;
  }
  const Eigen::Matrix<double, 6, 1> quadric = SolveSymmetric(normal_matrix, right);
  if (!quadric.allFinite()) return 0;
  const double end = std::sqrt(3.0);  // of an even spread, in standard deviations
  // Too little to be told from the noise.
  if (quadric.tail<3>().norm() * end * end < 0.001) return 0;
  return end * std::max(std::hypot(2 * quadric[3], quadric[4]) / region.extent_u,
                        std::hypot(2 * quadric[5], quadric[4]) / region.extent_v);
}

// How far the local normals turn from the middle of the region to its end, radians: shows the
// curvature of a strip too narrow for its heights to tell.
double FindTurn(const ScanSurface& surface, const std::vector<int>& members,
                const PlaneRegion& region) {
  Eigen::Matrix2d turn = Eigen::Matrix2d::Zero();
  for (int index : members) {
    const SurfaceCell& cell = surface.cells()[index];
    const Eigen::Vector3d offset = cell.point - region.mean, normal = cell.normal.cast<double>();
    const Eigen::Vector2d place(offset.dot(region.u) / region.extent_u,
                                offset.dot(region.v) / region.extent_v);
    turn +=
        cell.area * Eigen::Vector2d(normal.dot(region.u), normal.dot(region.v)) * place.transpose();
  }
  return std::sqrt(3.0) * (turn / region.area).colwise().norm().maxCoeff();
}

// Most of a region has cells of it on all four sides. One or two columns of samples, seen at the
// rim of a pillar, are always flat.
bool IsWide(const ScanSurface& surface, const std::vector<int>& members,
            const std::vector<int>& region_of, int region) {
  const auto has = [&](int cell, int columns, int rows) {
    for (int far = 1; far <= 2; ++far) {
      for (int side = -1; side <= 1; ++side) {
        const int other = surface.CellBeside(cell, columns != 0 ? far * columns : side,
                                             rows != 0 ? far * rows : side);
        if (other >= 0 && region_of[other] == region) return true;
      }
    }
    return false;
  };
  int amid = 0;
  for (int cell : members) {
    amid += has(cell, -1, 0) && has(cell, 1, 0) && has(cell, 0, -1) && has(cell, 0, 1);
  }
  return !surface.is_grid() || amid >= kLeastAmid * static_cast<double>(members.size());
}

// The ends turn with the surface: a strip of a cylinder, not a plane. What windows of a noisy scan
// deviate by, its planes may be bent by.
bool IsCurved(const ScanSurface& surface, const std::vector<int>& members,
              const PlaneRegion& region, const ScanPlaneOptions& options) {
  double sigma = 0;
  for (int cell : members) sigma += surface.cells()[cell].normal_sigma;
  const double limit = kMostCurved * RadFromDeg(options.max_angle_deg) +
                       0.5 * sigma / static_cast<double>(members.size());
  return std::max(region.end_slope, FindTurn(surface, members, region)) > limit;
}

// Steps between regions that lie beside each other in the grid, at most a few cells apart (cells
// that an edge crosses belong to neither).
std::vector<RegionStep> FindSteps(const ScanSurface& surface, const std::vector<int>& region_of,
                                  size_t num_regions) {
  constexpr int kReach = 8;
  struct Sum {
    double count = 0, height = 0, square = 0;
  };
  std::map<std::pair<int, int>, Sum> sums;
  const std::vector<SurfaceCell>& cells = surface.cells();
  const int num_cells = static_cast<int>(num_regions > 0 ? cells.size() : 0);
  for (int cell = 0; cell < num_cells; ++cell) {
    if (region_of[cell] < 0) continue;
    for (const bool right : {true, false}) {
      for (int step = 1; step <= kReach; ++step) {
        const int other = surface.CellBeside(cell, right ? step : 0, right ? 0 : step);
        if (other < 0 || region_of[other] == region_of[cell]) break;
        if (region_of[other] < 0) continue;
        const Eigen::Vector3d normal =
            (cells[cell].normal + cells[other].normal).cast<double>().normalized();
        double height = normal.dot(cells[other].point - cells[cell].point);
        std::pair<int, int> pair(region_of[cell], region_of[other]);
        if (pair.first > pair.second) {
          std::swap(pair.first, pair.second);
          height *= -1;
        }
        Sum& sum = sums[pair];
        sum.count += 1;
        sum.height += height;
        sum.square += height * height;
        break;
      }
    }
  }
  std::vector<RegionStep> steps;
  for (const auto& [pair, sum] : sums) {
    if (sum.count < 5) continue;
    const double mean = sum.height / sum.count;
    const double variance = std::max(sum.square / sum.count - mean * mean, 0.0);
    // Windows overlap: about every third pair is a witness of its own.
    steps.push_back({pair.first, pair.second, mean, std::sqrt(3 * variance / sum.count)});
  }
  return steps;
}

}  // namespace

double PlaneRegion::Sigma(const Eigen::Vector3d& x) const {
  const Eigen::Vector3d at(1, u.dot(x - mean), v.dot(x - mean));
  return std::sqrt(std::max(at.dot(covariance * at), 0.0));
}

void SummariseRegion(const Eigen::Vector3d& station, PlaneRegion* region) {
  Moments moments;
  for (const RegionCell& cell : region->cells) moments.Add(cell.point, cell.area);
  region->area = moments.weight();
  const PlaneFit fit = FitPlane(moments);
  region->mean = fit.mean;
  region->normal = fit.normal;
  if (region->normal.dot(station - region->mean) < 0) region->normal *= -1;
  region->u = fit.axes.col(2);
  region->v = region->normal.cross(region->u);
  region->extent_u = std::sqrt(std::max(fit.variances[2], 1e-8));
  region->extent_v = std::sqrt(std::max(fit.variances[1], 1e-8));
  double square = 0, noise = 0;
  region->noise = 0;
  for (const RegionCell& cell : region->cells) {
    square += cell.area * std::pow(region->Distance(cell.point), 2);
    noise += cell.area * cell.variance;
    region->noise += cell.area / region->area * cell.noise;
  }
  region->waviness = std::sqrt(std::max(square - noise, 0.0) / region->area);
  const double wave_area = kWaveLength * kWaveLength;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const RegionCell& cell : region->cells) {
    const double waves =
        std::pow(std::max(region->waviness, kLeastWaves), 2) * std::max(1.0, wave_area / cell.area);
    const Eigen::Vector3d offset = cell.point - region->mean;
    const Eigen::Vector3d row(1, offset.dot(region->u), offset.dot(region->v));
    information += row * row.transpose() / (cell.variance + waves + 1e-10);
  }
  region->covariance = information.inverse();
  region->end_slope = FindEndSlope(*region);
}

GrownRegions GrowRegions(const ScanSurface& surface, const ScanPlaneOptions& options,
                         double min_area) {
  GrownRegions grown;
  RegionGrower grower(surface, options);
  for (int seed : grower.Seeds()) {
    if (!grower.IsFree(seed)) continue;
    const std::vector<int> members = grower.Grow(seed, static_cast<int>(grown.regions.size()));
    PlaneRegion region;
    if (static_cast<int>(members.size()) >= kFewestCells) region = MakeRegion(surface, members);
    const int index = static_cast<int>(grown.regions.size());
    if (region.area < min_area || IsCurved(surface, members, region, options) ||
        !IsWide(surface, members, grower.region_of(), index)) {
      grower.Release(members);
    } else {
      grown.regions.push_back(std::move(region));
    }
  }
  grown.region_of_cell = grower.TakeRegions();
  grown.steps = FindSteps(surface, grown.region_of_cell, grown.regions.size());
  return grown;
}

}  // namespace roomtex
