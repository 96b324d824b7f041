// Joins the parts of one plane: JoinRegions of plane_regions.h.

#include <algorithm>
#include <cmath>
#include <numeric>

#include "align/surface/plane_regions.h"

namespace roomtex {
namespace {

// Only this many regions are tried for joining: a forest has no walls.
constexpr size_t kMostRegions = 3000;
constexpr double kScanPoses = 0.002;  // metres; what poses of several scans may be off
constexpr double kEdgeShift = 0.15;   // of the noise of a sample

class RegionJoiner {
 public:
  RegionJoiner(std::vector<PlaneRegion> regions, const std::vector<RegionStep>& steps,
               const ScanPlaneOptions& options)
      : regions_(std::move(regions)), options_(options) {
    joined_of_.resize(regions_.size());
    std::iota(joined_of_.begin(), joined_of_.end(), 0);
    for (const RegionStep& step : steps) {
      const double edges = kEdgeShift * std::max(regions_[step.a].noise, regions_[step.b].noise);
      if (std::abs(step.height) > options.min_step + 2 * edges + 3 * step.sigma) {
        apart_.emplace_back(std::min(step.a, step.b), std::max(step.a, step.b));
      }
    }
    std::sort(apart_.begin(), apart_.end());
    groups_.resize(regions_.size());
    for (size_t i = 0; i < regions_.size(); ++i) groups_[i] = {static_cast<int>(i)};
  }

  // Larger ones take smaller ones in, until nothing changes: first within each scan, so that the
  // steps that it shows are known when planes of several scans are compared.
  void Join() {
    JoinAll(false);
    JoinAll(true);
  }

  JoinedRegions Result() {
    JoinedRegions result;
    std::vector<int> order;
    for (size_t i = 0; i < regions_.size(); ++i) {
      if (!regions_[i].cells.empty()) order.push_back(static_cast<int>(i));
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return regions_[a].area > regions_[b].area; });
    std::vector<int> place(regions_.size(), -1);
    for (size_t i = 0; i < order.size(); ++i) {
      place[order[i]] = static_cast<int>(i);
      result.regions.push_back(std::move(regions_[order[i]]));
    }
    for (int joined : joined_of_) result.joined_of_region.push_back(place[joined]);
    return result;
  }

 private:
  void JoinAll(bool across_scans) {
    std::vector<int> order(regions_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return regions_[a].area > regions_[b].area; });
    if (order.size() > kMostRegions) order.resize(kMostRegions);
    bool changed = true;
    for (int round = 0; changed && round < 5; ++round) {
      changed = false;
      for (size_t i = 0; i < order.size(); ++i) {
        for (size_t k = i + 1; k < order.size(); ++k) {
          PlaneRegion &large = regions_[order[i]], &small = regions_[order[k]];
          if (large.cells.empty() || small.cells.empty()) continue;
          const bool swap = small.area > large.area;
          const int into = swap ? order[k] : order[i], from = swap ? order[i] : order[k];
          if (!across_scans && large.scan != small.scan) continue;
          if (!AreOnePlane(into, from)) continue;
          changed = TakeIn(into, from) || changed;
        }
      }
    }
  }

  bool AreOnePlane(int large_index, int small_index) const {
    const PlaneRegion &large = regions_[large_index], &small = regions_[small_index];
    if (large.normal.dot(small.normal) < 0.9) return false;
    const bool same_scan = large.scan >= 0 && large.scan == small.scan;
    const double poses = same_scan ? 0 : kScanPoses;
    // Where the smaller one is: in its middle and at its ends.
    const double end = 1.5;
    const Eigen::Vector3d u = end * small.extent_u * small.u, v = end * small.extent_v * small.v;
    for (const Eigen::Vector3d& offset :
         {Eigen::Vector3d(0, 0, 0), u, Eigen::Vector3d(-u), v, Eigen::Vector3d(-v)}) {
      const Eigen::Vector3d x = small.mean + offset;
      const double sigma = std::hypot(large.Sigma(x), small.Sigma(x));
      // Agreement within a large uncertainty says nothing; least of all far from the larger one.
      if (3 * sigma > options_.max_distance || 3 * large.Sigma(x) > 2 * options_.min_step) {
        return false;
      }
      // Windows that reach over an edge unnoticed in the noise shift their surface.
      const double edges = kEdgeShift * std::max(large.noise, small.noise);
      const double limit = 3 * sigma + edges + poses + 0.5 * options_.min_step +
                           1.5 * std::max(large.waviness, small.waviness);
      if (std::abs(large.Distance(x)) > std::min(limit, options_.max_distance + poses)) {
        return false;
      }
    }
    return !StepBetween(large_index, small_index);
  }

  bool StepBetween(int a, int b) const {
    for (int i : groups_[a]) {
      for (int k : groups_[b]) {
        if (std::binary_search(apart_.begin(), apart_.end(),
                               std::make_pair(std::min(i, k), std::max(i, k)))) {
          return true;
        }
      }
    }
    return false;
  }

  // Not if the whole then is farther from its plane than a surface may be.
  bool TakeIn(int large_index, int small_index) {
    PlaneRegion &large = regions_[large_index], &small = regions_[small_index];
    PlaneRegion both = large;
    both.cells.insert(both.cells.end(), small.cells.begin(), small.cells.end());
    const Eigen::Vector3d station = large.mean + large.normal;
    SummariseRegion(station, &both);
    if (both.waviness > options_.max_distance / 2 &&
        both.waviness > 1.2 * std::max(large.waviness, small.waviness)) {
      return false;
    }
    if (large.scan != small.scan) both.scan = -1;
    large = std::move(both);
    small.cells.clear();
    for (int member : groups_[small_index]) joined_of_[member] = large_index;
    groups_[large_index].insert(groups_[large_index].end(), groups_[small_index].begin(),
                                groups_[small_index].end());
    groups_[small_index].clear();
    return true;
  }

  std::vector<PlaneRegion> regions_;
  const ScanPlaneOptions& options_;
  std::vector<int> joined_of_;
  std::vector<std::vector<int>> groups_;
  std::vector<std::pair<int, int>> apart_;  // pairs of the given regions, sorted
};

}  // namespace

JoinedRegions JoinRegions(std::vector<PlaneRegion> regions, const std::vector<RegionStep>& steps,
                          const ScanPlaneOptions& options) {
  RegionJoiner joiner(std::move(regions), steps, options);
  joiner.Join();
  return joiner.Result();
}

}  // namespace roomtex
