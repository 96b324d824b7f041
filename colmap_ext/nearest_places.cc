#include "colmap_ext/nearest_places.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>

namespace roomtex {
namespace {

constexpr size_t kPlacesPerLeaf = 8;
constexpr double kRounding = 1e-12;  // relative, of a distance

// Different places; `at` those of them that hold each, ascending.
struct Spot {
  Place place;
  std::vector<int> at;
};

class PlaceTree {
 public:
  explicit PlaceTree(std::vector<Spot> spots) : spots_(std::move(spots)) {
    if (!spots_.empty()) Split(0, spots_.size());
  }

  std::vector<int> Nearest(int self, const Place& place, size_t count) const {
    Search search{self, place, count, {}};
    if (!spots_.empty() && count > 0) Visit(0, &search);
    std::vector<int> nearest;
    for (const auto& [distance, at] : search.best) nearest.push_back(at);
    return nearest;
  }

 private:
  struct Node {
    Place low, high;  // the box around its spots
    size_t begin = 0, end = 0;
    size_t left = 0, right = 0;  // 0 = a leaf
  };
  struct Search {
    int self;
    Place place;
    size_t count;
    std::vector<std::pair<double, int>> best;  // ascending
  };

  size_t Split(size_t begin, size_t end) {
    Node node;
    node.begin = begin;
    node.end = end;
    node.low = node.high = spots_[begin].place;
    for (size_t i = begin; i < end; ++i) {
      for (size_t axis = 0; axis < 2; ++axis) {
        node.low[axis] = std::min(node.low[axis], spots_[i].place[axis]);
        node.high[axis] = std::max(node.high[axis], spots_[i].place[axis]);
      }
    }
    const size_t at = nodes_.size();
    nodes_.push_back(node);
    if (end - begin <= kPlacesPerLeaf) return at;
    const size_t axis = node.high[0] - node.low[0] >= node.high[1] - node.low[1] ? 0 : 1;
    const size_t middle = begin + (end - begin) / 2;
    const auto first = spots_.begin();
    std::nth_element(
        first + static_cast<std::ptrdiff_t>(begin), first + static_cast<std::ptrdiff_t>(middle),
        first + static_cast<std::ptrdiff_t>(end),
        [axis](const Spot& a, const Spot& b) { return a.place[axis] < b.place[axis]; });
    const size_t left = Split(begin, middle), right = Split(middle, end);
    nodes_[at].left = left;
    nodes_[at].right = right;
    return at;
  }

  static double DistanceToBox(const Node& node, const Place& place) {
    std::array<double, 2> outside{};
    for (size_t axis = 0; axis < 2; ++axis) {
      outside[axis] = std::max({0.0, node.low[axis] - place[axis], place[axis] - node.high[axis]});
    }
    return std::hypot(outside[0], outside[1]);
  }

  void Visit(size_t at, Search* search) const {
    const Node& node = nodes_[at];
    const bool full = search->best.size() == search->count;
    if (full && DistanceToBox(node, search->place) > (1 + kRounding) * search->best.back().first) {
      return;
    }
    if (node.left == 0) {
      for (size_t i = node.begin; i < node.end; ++i) Take(spots_[i], search);
      return;
    }
    const bool left_first = DistanceToBox(nodes_[node.left], search->place) <=
                            DistanceToBox(nodes_[node.right], search->place);
    Visit(left_first ? node.left : node.right, search);
    Visit(left_first ? node.right : node.left, search);
  }

  static void Take(const Spot& spot, Search* search) {
    const double distance =
        std::hypot(search->place[0] - spot.place[0], search->place[1] - spot.place[1]);
    for (const int at : spot.at) {
      if (at == search->self) continue;
      const std::pair<double, int> one{distance, at};
      std::vector<std::pair<double, int>>& best = search->best;
      if (best.size() == search->count) {
        if (!(one < best.back())) return;
        best.pop_back();
      }
      best.insert(std::upper_bound(best.begin(), best.end(), one), one);
    }
  }

  std::vector<Spot> spots_;
  std::vector<Node> nodes_;
};

}  // namespace

std::vector<std::vector<int>> NearestPlaces(const std::vector<Place>& places, int count) {
  std::map<Place, std::vector<int>> at_place;
  for (size_t i = 0; i < places.size(); ++i) at_place[places[i]].push_back(static_cast<int>(i));
  std::vector<Spot> spots;
  for (const auto& [place, at] : at_place) spots.push_back({place, at});
  const PlaceTree tree(std::move(spots));
  std::vector<std::vector<int>> nearest;
  for (size_t i = 0; i < places.size(); ++i) {
    nearest.push_back(
        tree.Nearest(static_cast<int>(i), places[i], static_cast<size_t>(std::max(0, count))));
  }
  return nearest;
}

}  // namespace roomtex
