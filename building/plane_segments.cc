#include "building/plane_segments.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <unordered_set>

#include "core/frames.h"
#include "core/parallel.h"
#include "core/random_stream.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr int kNeighboursForNormal = 14;
constexpr int kSeedsPerRound = 256;
constexpr int kGrownPerRound = 6;
constexpr size_t kMaxSegments = 1500;
constexpr int kMaxBarren = 12;  // rounds without a find
constexpr size_t kFewestOnPlane = 12;
const double kMinNormalCosine = std::cos(RadFromDeg(40));

uint64_t CellKey(int64_t u, int64_t v) {
  return (static_cast<uint64_t>(u) << 32) ^ (static_cast<uint64_t>(v) & 0xffffffffu);
}

class SegmentFinder {
 public:
  SegmentFinder(const OutlineCloud& cloud, uint64_t seed, int num_threads)
      : cloud_(cloud),
        neighbours_(cloud.points),
        random_(MixBits(seed, 0x0071)),
        num_threads_(num_threads),
        tolerance_(PlaneTolerance(cloud)),
        taken_(cloud.points.size(), false),
        tried_(cloud.points.size(), false) {
    local_.resize(cloud.points.size());
    reaches_.resize(cloud.points.size());
    ParallelFor(num_threads, 0, static_cast<int>(cloud.points.size()), [&](int i) {
      const auto near =
          neighbours_.Nearest(cloud_.points[static_cast<size_t>(i)], kNeighboursForNormal);
      local_[static_cast<size_t>(i)] = FitPlane(cloud_.points, near);
      reaches_[static_cast<size_t>(i)] =
          (cloud_.points[static_cast<size_t>(near.back())] - cloud_.points[static_cast<size_t>(i)])
              .norm();
    });
  }

  std::vector<PlaneSegment> Find() {
    std::vector<PlaneSegment> segments;
    for (int barren = 0; barren < kMaxBarren && segments.size() < kMaxSegments;) {
      const std::vector<int> free = FreePoints();
      std::vector<int> untried;
      for (const int i : free) {
        if (!tried_[static_cast<size_t>(i)]) untried.push_back(i);
      }
      if (untried.empty()) break;
      std::vector<PlaneSegment> found = SearchRound(free, untried);
      bool any = false;
      for (PlaneSegment& segment : found) {
        const bool clashes = std::any_of(segment.points.begin(), segment.points.end(),
                                         [&](int i) { return taken_[static_cast<size_t>(i)]; });
        if (clashes) continue;
        for (const int i : segment.points) taken_[static_cast<size_t>(i)] = true;
        segments.push_back(std::move(segment));
        any = true;
      }
      barren = any ? 0 : barren + 1;
    }
    for (PlaneSegment& segment : segments) Orient(&segment);
    std::stable_sort(segments.begin(), segments.end(),
                     [](const PlaneSegment& a, const PlaneSegment& b) { return a.area > b.area; });
    return segments;
  }

 private:
  std::vector<int> FreePoints() const {
    std::vector<int> free;
    for (size_t i = 0; i < taken_.size(); ++i) {
      if (!taken_[i]) free.push_back(static_cast<int>(i));
    }
    return free;
  }

  // The best planes of this round, largest first; they may share points.
  std::vector<PlaneSegment> SearchRound(const std::vector<int>& free,
                                        const std::vector<int>& untried) {
    struct Seed {
      int point = 0;
      double score = 0;
    };
    std::vector<Seed> seeds(kSeedsPerRound);
    for (Seed& seed : seeds) {
      seed.point = untried[static_cast<size_t>(random_.Index(static_cast<int>(untried.size())))];
    }
    ParallelFor(num_threads_, 0, kSeedsPerRound, [&](int k) {
      Seed& seed = seeds[static_cast<size_t>(k)];
      seed.score = LocalScore(seed.point);
    });
    std::stable_sort(seeds.begin(), seeds.end(),
                     [](const Seed& a, const Seed& b) { return a.score > b.score; });
    std::vector<PlaneSegment> grown(kGrownPerRound);
    ParallelFor(num_threads_, 0, kGrownPerRound, [&](int k) {
      grown[static_cast<size_t>(k)] = Grow(seeds[static_cast<size_t>(k)].point, free);
    });
    // What grows nothing is not tried again, nor what lies close by.
    for (size_t k = 0; k < grown.size(); ++k) {
      tried_[static_cast<size_t>(seeds[k].point)] = true;
      if (IsSurface(grown[k], free)) continue;
      grown[k].points.clear();
      const Eigen::Vector3d& x = cloud_.points[static_cast<size_t>(seeds[k].point)];
      for (const int i : neighbours_.Nearest(x, kNeighboursForNormal)) {
        tried_[static_cast<size_t>(i)] = true;
      }
    }
    grown.erase(std::remove_if(grown.begin(), grown.end(),
                               [](const PlaneSegment& s) { return s.points.empty(); }),
                grown.end());
    std::stable_sort(grown.begin(), grown.end(), [](const PlaneSegment& a, const PlaneSegment& b) {
      return a.points.size() > b.points.size();
    });
    return grown;
  }

  bool Fits(const FittedPlane& plane, int i, double tolerance) const {
    const size_t at = static_cast<size_t>(i);
    return std::abs(plane.SignedDistance(cloud_.points[at])) <= tolerance;
  }
  bool FitsNormal(const FittedPlane& plane, int i) const {
    return std::abs(plane.normal.dot(local_[static_cast<size_t>(i)].normal)) >= kMinNormalCosine;
  }

  // Half the side of the cube that a plane begins in.
  double ReachOf(int seed) const {
    return std::max(cloud_.step, 1.2 * reaches_[static_cast<size_t>(seed)]);
  }
  // Side of the cells that say what hangs together: each holds a few points.
  double CellAt(int seed) const {
    return std::clamp(0.75 * reaches_[static_cast<size_t>(seed)], cloud_.step / 2, 2 * cloud_.step);
  }

  double LocalScore(int seed) const {
    const FittedPlane& plane = local_[static_cast<size_t>(seed)];
    double on = 0, beside = 0;
    for (const int i :
         neighbours_.InCube(cloud_.points[static_cast<size_t>(seed)], ReachOf(seed))) {
      if (taken_[static_cast<size_t>(i)]) continue;
      if (Fits(plane, i, tolerance_)) {
        on += FitsNormal(plane, i) ? 1 : 0.3;
      } else if (Fits(plane, i, 3 * tolerance_)) {
        beside += 1;
      }
    }
    return on - 0.5 * beside;
  }

  // From the neighbourhood outwards, fitted anew each time.
  PlaneSegment Grow(int seed, const std::vector<int>& free) const {
    PlaneSegment segment;
    segment.plane = local_[static_cast<size_t>(seed)];
    segment.cell = CellAt(seed);
    const Eigen::Vector3d& x = cloud_.points[static_cast<size_t>(seed)];
    for (const double reach : {1.0, 2.0, 4.0}) {
      std::vector<int> on;
      for (const int i : neighbours_.InCube(x, reach * ReachOf(seed))) {
        if (!taken_[static_cast<size_t>(i)] && Fits(segment.plane, i, tolerance_) &&
            FitsNormal(segment.plane, i)) {
          on.push_back(i);
        }
      }
      if (on.size() < kFewestOnPlane) return {};
      segment.plane = FitPlane(cloud_.points, on);
    }
    for (int round = 0; round < 3; ++round) {
      std::vector<int> on;
      for (const int i : free) {
        if (Fits(segment.plane, i, tolerance_) && FitsNormal(segment.plane, i)) on.push_back(i);
      }
      segment.points = ConnectedTo(x, segment.plane, on, segment.cell, &segment.area);
      if (segment.points.size() < kFewestOnPlane) return {};
      segment.plane = FitPlane(cloud_.points, segment.points);
    }
    return segment;
  }

  // The points in cells of the plane that hang together with that of x.
  std::vector<int> ConnectedTo(const Eigen::Vector3d& x, const FittedPlane& plane,
                               const std::vector<int>& on, double cell, double* area) const {
    const Eigen::Vector3d u = plane.normal.unitOrthogonal(), v = plane.normal.cross(u);
    const auto place = [&](const Eigen::Vector3d& y) {
      return std::make_pair(static_cast<int64_t>(std::floor(u.dot(y - x) / cell)),
                            static_cast<int64_t>(std::floor(v.dot(y - x) / cell)));
    };
    std::unordered_map<uint64_t, std::vector<int>> cells;
    for (const int i : on) {
      const auto [a, b] = place(cloud_.points[static_cast<size_t>(i)]);
      cells[CellKey(a, b)].push_back(i);
    }
    std::vector<std::pair<int64_t, int64_t>> open = {place(x)};
    std::unordered_set<uint64_t> seen = {CellKey(open[0].first, open[0].second)};
    std::vector<int> connected;
    double num_cells = 0;
    while (!open.empty()) {
      const auto [a, b] = open.back();
      open.pop_back();
      const auto at = cells.find(CellKey(a, b));
      if (at == cells.end()) continue;
      num_cells += 1;
      connected.insert(connected.end(), at->second.begin(), at->second.end());
      for (int da = -1; da <= 1; ++da) {
        for (int db = -1; db <= 1; ++db) {
          if (seen.insert(CellKey(a + da, b + db)).second) open.emplace_back(a + da, b + db);
        }
      }
    }
    std::sort(connected.begin(), connected.end());
    *area = num_cells * cell * cell;
    return connected;
  }

  // Large enough, and thin: a tree is as full of points beside a plane as on it.
  bool IsSurface(const PlaneSegment& segment, const std::vector<int>& free) const {
    if (segment.points.size() < kFewestOnPlane) return false;
    if (segment.area < 0.7 * cloud_.step * cloud_.step) return false;
    std::vector<int> beside;
    for (const int i : free) {
      if (Fits(segment.plane, i, 3 * tolerance_) && !Fits(segment.plane, i, tolerance_)) {
        beside.push_back(i);
      }
    }
    // Those beside this piece, not beside the rest of the plane.
    std::unordered_set<uint64_t> cells;
    const FittedPlane& plane = segment.plane;
    const Eigen::Vector3d u = plane.normal.unitOrthogonal(), v = plane.normal.cross(u);
    const auto key = [&](int i) {
      const Eigen::Vector3d d = cloud_.points[static_cast<size_t>(i)] - plane.centre;
      return CellKey(static_cast<int64_t>(std::floor(u.dot(d) / segment.cell)),
                     static_cast<int64_t>(std::floor(v.dot(d) / segment.cell)));
    };
    for (const int i : segment.points) cells.insert(key(i));
    const auto num_beside =
        std::count_if(beside.begin(), beside.end(), [&](int i) { return cells.count(key(i)) > 0; });
    return static_cast<double>(num_beside) < 0.8 * static_cast<double>(segment.points.size());
  }

  void Orient(PlaneSegment* segment) const {
    double towards = 0;
    for (const int i : segment->points) {
      const Eigen::Vector3d& eye = cloud_.eyes[static_cast<size_t>(i)];
      if (!eye.allFinite()) continue;
      towards += segment->plane.SignedDistance(eye) > 0 ? 1 : -1;
    }
    segment->oriented = std::abs(towards) > 0.5 * static_cast<double>(segment->points.size());
    if (towards < 0) segment->plane.normal = -segment->plane.normal;
  }

  const OutlineCloud& cloud_;
  const Neighbours neighbours_;
  RandomStream random_;
  const int num_threads_;
  const double tolerance_;
  std::vector<bool> taken_, tried_;
  std::vector<double> reaches_;  // to the farthest of the neighbours that told the normal
  std::vector<FittedPlane> local_;
};

}  // namespace

double PlaneTolerance(const OutlineCloud& cloud) {
  return std::clamp(3.5 * cloud.noise, cloud.step / 100, cloud.step / 7);
}

std::vector<PlaneSegment> FindPlaneSegments(const OutlineCloud& cloud, uint64_t seed,
                                            int num_threads) {
  return SegmentFinder(cloud, seed, num_threads).Find();
}

}  // namespace roomtex
