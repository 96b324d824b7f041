#include "core/cloud_stations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "core/frames.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Points looked at, evenly among those asked: to compare places, to come near the best one, and to
// find it exactly. Metres that are told apart then.
constexpr size_t kFewPoints = 10000, kSomePoints = 60000, kManyPoints = 500000;
constexpr double kNear = 0.05, kExact = 0.005;
// With many points in one direction those beside an edge would count as hidden from where they were
// seen; with few, nothing says how many directions have none.
constexpr double kToHide = 0.5, kToFill = 4;  // points in one direction
constexpr double kLeastSeen = 0.994;          // of the points, from a station
// The share of places that may see more than this of the points if one of them is to be the
// station.
constexpr double kMostPlaces = 0.1, kSeenElsewhere = 0.99;
constexpr double kLeastSphere = 0.15;  // of the directions, that have points
constexpr size_t kLeastPoints = 20000;
constexpr int kMaxHalvings = 4;

class LinesOfSight {
 public:
  LinesOfSight(const Scan& cloud, size_t begin, size_t end, size_t num_points,
               double points_of_direction = kToHide) {
    constexpr double kGolden = 0.6180339887498949;  // every n-th would follow the scanner's lines
    const size_t count = std::min(num_points, end - begin);
    for (size_t i = 0; i < count; ++i) {
      const double share = std::fmod(static_cast<double>(i + 1) * kGolden, 1.0);
      const size_t index = begin + static_cast<size_t>(share * static_cast<double>(end - begin));
      if (cloud.IsMissing(static_cast<int>(index))) continue;
      points_.push_back(cloud.points[index]);
      bounds_.min = bounds_.min.cwiseMin(points_.back());
      bounds_.max = bounds_.max.cwiseMax(points_.back());
    }
    const double cells = static_cast<double>(points_.size()) / points_of_direction;
    edge_ = std::max(4, static_cast<int>(std::sqrt(cells / 6)));
  }

  const Bounds& bounds() const { return bounds_; }

  struct Sight {
    double seen = 0;    // share of the points that none hides
    double sphere = 0;  // share of the directions that have points
  };
  Sight From(const Eigen::Vector3d& place) const {
    constexpr float kBehind = 1.15f, kFar = 1e30f;
    std::vector<float> range(points_.size());
    std::vector<int> cell(points_.size());
    std::vector<float> nearest(static_cast<size_t>(6) * edge_ * edge_, kFar);
    for (size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d offset = points_[i] - place;
      range[i] = static_cast<float>(offset.norm());
      cell[i] = CellOf(offset);
      nearest[cell[i]] = std::min(nearest[cell[i]], range[i]);
    }
    double num_seen = 0;
    for (size_t i = 0; i < points_.size(); ++i) num_seen += range[i] <= kBehind * nearest[cell[i]];
    const auto empty = std::count(nearest.begin(), nearest.end(), kFar);
    return {num_seen / static_cast<double>(std::max<size_t>(1, points_.size())),
            1 - static_cast<double>(empty) / static_cast<double>(nearest.size())};
  }

 private:
  // Of the six sides of a cube, edge_ x edge_ cells each, even in angle.
  int CellOf(const Eigen::Vector3d& offset) const {
    int axis;
    const double largest = offset.cwiseAbs().maxCoeff(&axis);
    if (!(largest > 0)) return 0;
    const auto place = [&](double value) {
      const double share = 0.5 + std::atan(value / largest) * 2 / kPi;
      return std::clamp(static_cast<int>(share * edge_), 0, edge_ - 1);
    };
    const int side = 2 * axis + (offset[axis] < 0);
    return (side * edge_ + place(offset[(axis + 1) % 3])) * edge_ + place(offset[(axis + 2) % 3]);
  }

  std::vector<Eigen::Vector3d> points_;
  Bounds bounds_;
  int edge_ = 4;
};

// Of places evenly in a box around the points, that from which the most are seen. None where many
// places would do: one wall, or a bare room, does not say where it was seen from.
std::optional<Eigen::Vector3d> BestOfBox(const LinesOfSight& lines, double* step, int num_threads) {
  constexpr int kPlaces = 600;
  constexpr double kFlattest = 0.5;  // of the box: beside a wall there is room, too
  const Bounds& bounds = lines.bounds();
  const Eigen::Vector3d extent = bounds.max - bounds.min;
  const Eigen::Vector3d size = extent.cwiseMax(std::max(1e-6, kFlattest * extent.maxCoeff()));
  const Eigen::Vector3d low = 0.5 * (bounds.min + bounds.max - size);
  *step = std::cbrt(size.prod() / kPlaces);
  const Eigen::Vector3i counts = (size / *step).array().floor().cwiseMax(1).cast<int>();
  const auto place = [&](int i) -> Eigen::Vector3d {
    const Eigen::Vector3d cell(i % counts.x() + 0.5, i / counts.x() % counts.y() + 0.5,
                               i / (counts.x() * counts.y()) + 0.5);
    return low + cell.cwiseQuotient(counts.cast<double>()).cwiseProduct(size);
  };
  std::vector<double> seen(static_cast<size_t>(counts.prod()));
  ParallelFor(num_threads, 0, counts.prod(), [&](int i) { seen[i] = lines.From(place(i)).seen; });
  if (Quantile(seen, 1 - kMostPlaces) > kSeenElsewhere) return std::nullopt;
  return place(static_cast<int>(std::max_element(seen.begin(), seen.end()) - seen.begin()));
}

// The best place around, by steps along the axes that are halved. Returns the share that it sees.
double Climb(const LinesOfSight& lines, double step, double least_step, int num_threads,
             Eigen::Vector3d* place) {
  double seen = lines.From(*place).seen;
  while (step >= least_step) {
    std::array<double, 6> found{};
    const auto neighbour = [&](int k) -> Eigen::Vector3d {
      return *place + (k % 2 == 0 ? step : -step) * Eigen::Vector3d::Unit(k / 2);
    };
    ParallelFor(num_threads, 0, 6, [&](int k) { found[k] = lines.From(neighbour(k)).seen; });
    const auto best = std::max_element(found.begin(), found.end());
    if (*best > seen) {
      seen = *best;
      *place = neighbour(static_cast<int>(best - found.begin()));
    } else {
      step /= 2;
    }
  }
  return seen;
}

std::optional<Eigen::Vector3d> FindPlace(const Scan& cloud, size_t begin, size_t end,
                                         int num_threads) {
  double step;
  const auto best = BestOfBox(LinesOfSight(cloud, begin, end, kFewPoints), &step, num_threads);
  if (!best) return std::nullopt;
  Eigen::Vector3d place = *best;
  const LinesOfSight some(cloud, begin, end, kSomePoints);
  if (Climb(some, step / 2, kNear, num_threads, &place) < kLeastSeen) return std::nullopt;
  const LinesOfSight many(cloud, begin, end, kManyPoints);
  if (Climb(many, kNear, kExact, num_threads, &place) < kLeastSeen) return std::nullopt;
  return place;
}

std::optional<CloudStation> StationAt(const Scan& cloud, size_t begin, size_t end,
                                      const Eigen::Vector3d& place) {
  const double sphere = LinesOfSight(cloud, begin, end, kSomePoints, kToFill).From(place).sphere;
  if (sphere < kLeastSphere) return std::nullopt;
  return CloudStation{place, begin, end,
                      std::sqrt(4 * kPi * sphere / static_cast<double>(end - begin))};
}

void FindStationsOf(const Scan& cloud, size_t begin, size_t end, int halvings, int num_threads,
                    std::vector<CloudStation>* stations) {
  if (end - begin < kLeastPoints) return;
  if (const auto place = FindPlace(cloud, begin, end, num_threads)) {
    if (const auto station = StationAt(cloud, begin, end, *place)) stations->push_back(*station);
    return;
  }
  if (halvings >= kMaxHalvings) return;
  const size_t middle = begin + (end - begin) / 2;
  FindStationsOf(cloud, begin, middle, halvings + 1, num_threads, stations);
  FindStationsOf(cloud, middle, end, halvings + 1, num_threads, stations);
}

}  // namespace

std::vector<CloudStation> FindStations(const Scan& cloud, int num_threads) {
  std::vector<CloudStation> parts;
  FindStationsOf(cloud, 0, cloud.points.size(), 0, num_threads, &parts);
  // Parts of one station.
  std::vector<CloudStation> stations;
  for (const CloudStation& part : parts) {
    if (!stations.empty() && stations.back().end == part.begin) {
      const CloudStation& before = stations.back();
      const bool first_is_larger = before.end - before.begin >= part.end - part.begin;
      const Eigen::Vector3d& place = first_is_larger ? before.place : part.place;
      const LinesOfSight lines(cloud, before.begin, part.end, kSomePoints);
      const auto both = lines.From(place).seen < kLeastSeen
                            ? std::nullopt
                            : StationAt(cloud, before.begin, part.end, place);
      if (both) {
        stations.back() = *both;
        continue;
      }
    }
    stations.push_back(part);
  }
  return stations;
}

}  // namespace roomtex
