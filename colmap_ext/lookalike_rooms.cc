#include "colmap_ext/lookalike_rooms.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr size_t kMinPhotos = 4;  // of a room
// A split is believed whose photos find less than this share of what those of their own side find,
// with no more than so many pairs on the wrong side of the middle, and less evenly over the picture
// than their own. What rooms that are alike and single rooms come to: docs/pairs.md.
constexpr double kMaxRatio = 0.67, kMaxWrong = 0.15;
constexpr double kMinUneven = 1.5;
// Where they find next to nothing, what they find lies evenly, too, but no photo is in between.
constexpr double kFarRatio = 0.25, kFarWrong = 0.05;

struct PairShare {
  int photo1, photo2;  // photo1 < photo2
  double share;
};

// Photos are numbered from 0.
using Sides = std::vector<int>;  // +1 or -1, one for each

struct Shares {
  std::vector<double> within, between;
  double MiddleOfMedians() {
    return within.empty() || between.empty() ? 0 : (Median(&within) + Median(&between)) / 2;
  }
};

Shares SharesOf(const std::vector<PairShare>& pairs, const Sides& sides) {
  Shares shares;
  for (const PairShare& pair : pairs) {
    const bool same =
        sides[static_cast<size_t>(pair.photo1)] == sides[static_cast<size_t>(pair.photo2)];
    (same ? shares.within : shares.between).push_back(pair.share);
  }
  return shares;
}

// The two sides that pairs with larger shares than `middle` hold together and those with smaller
// ones push apart: signs of the leading eigenvector of the signed graph (Kunegis et al. 2010) by
// power iteration, then photos change sides one by one while that helps.
class SignedGraph {
 public:
  SignedGraph(int num_photos, const std::vector<PairShare>& pairs)
      : neighbors_(static_cast<size_t>(num_photos)) {
    for (const PairShare& pair : pairs) {
      neighbors_[static_cast<size_t>(pair.photo1)].emplace_back(pair.photo2, pair.share);
      neighbors_[static_cast<size_t>(pair.photo2)].emplace_back(pair.photo1, pair.share);
    }
  }

  Sides LeadingSides(double middle) const {
    constexpr int kIterations = 500;
    double shift = 0;  // makes all eigenvalues positive (Gershgorin)
    for (const auto& list : neighbors_) {
      double sum = 0;
      for (const auto& [other, share] : list) sum += std::abs(share - middle);
      shift = std::max(shift, sum);
    }
    std::vector<double> x(neighbors_.size()), next(neighbors_.size());
    // No eigenvector of a graph is likely to be orthogonal to this.
    for (size_t i = 0; i < x.size(); ++i) x[i] = std::cos(1.0 + static_cast<double>(i * i % 1009));
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      double norm = 0;
      for (size_t i = 0; i < x.size(); ++i) {
        next[i] = shift * x[i] + Pull(i, x, middle);
        norm = std::max(norm, std::abs(next[i]));
      }
      if (!(norm > 0)) break;
      for (size_t i = 0; i < x.size(); ++i) x[i] = next[i] / norm;
    }
    Sides sides(x.size());
    for (size_t i = 0; i < x.size(); ++i) sides[i] = x[i] < 0 ? -1 : 1;
    return sides;
  }

  void ChangeOneByOne(double middle, Sides* sides) const {
    for (size_t change = 0; change < 4 * neighbors_.size(); ++change) {
      double worst = -1e-9;
      size_t changed = neighbors_.size();
      for (size_t i = 0; i < neighbors_.size(); ++i) {
        const double agreement = (*sides)[i] * Pull(i, *sides, middle);
        if (agreement < worst) {
          worst = agreement;
          changed = i;
        }
      }
      if (changed == neighbors_.size()) return;
      (*sides)[changed] = -(*sides)[changed];
    }
  }

 private:
  template <typename T>
  double Pull(size_t i, const std::vector<T>& x, double middle) const {
    double sum = 0;
    for (const auto& [other, share] : neighbors_[i]) {
      sum += (share - middle) * x[static_cast<size_t>(other)];
    }
    return sum;
  }

  std::vector<std::vector<std::pair<int, double>>> neighbors_;
};

Sides BestSides(int num_photos, const std::vector<PairShare>& pairs) {
  constexpr int kMiddles = 5;
  const SignedGraph graph(num_photos, pairs);
  Sides sides(static_cast<size_t>(num_photos), 1);
  double middle = Median(SharesOf(pairs, sides).within);
  sides = graph.LeadingSides(middle);
  for (int i = 0; i < kMiddles; ++i) {
    graph.ChangeOneByOne(middle, &sides);
    Shares shares = SharesOf(pairs, sides);
    if (shares.within.empty() || shares.between.empty()) break;
    middle = shares.MiddleOfMedians();
  }
  return sides;
}

// Median over photos of the unevenness of what they find of what those of the photos saw that
// `chosen` says.
template <typename Chosen>
double MedianUnevenness(const SparseModel& model, const ExpectedSightings& expected,
                        const std::set<uint32_t>& photos, const Chosen& chosen) {
  std::vector<double> unevenness;
  for (const uint32_t id : photos) {
    std::vector<ExpectedSighting> some;
    for (const ExpectedSighting& one : expected.at(id)) {
      const auto& w = one.witnesses;
      if (std::any_of(w.begin(), w.end(), [&](uint32_t other) {
            return photos.count(other) > 0 && chosen(id, other);
          })) {
        some.push_back(one);
      }
    }
    const SightSummary summary =
        SummarizeSightings(some, model.cameras.at(model.images.at(id).camera_id));
    if (std::isfinite(summary.unevenness)) unevenness.push_back(summary.unevenness);
  }
  return unevenness.empty() ? std::numeric_limits<double>::quiet_NaN() : Median(&unevenness);
}

class RoomSearch {
 public:
  RoomSearch(const SparseModel& model, const ExpectedSightings& expected)
      : model_(model), expected_(expected), common_(CountCommonSightings(expected)) {}

  // Two sides, each taken apart first: pairs of one side that are of two rooms say nothing of it.
  std::vector<std::set<uint32_t>> TakeApart(const std::set<uint32_t>& photos) {
    const std::vector<std::set<uint32_t>> one = {photos};
    const std::vector<uint32_t> ids(photos.begin(), photos.end());
    const std::vector<PairShare> pairs = PairsOf(ids);
    if (pairs.empty()) return one;
    const Sides sides = BestSides(static_cast<int>(ids.size()), pairs);
    std::set<uint32_t> side1, side2;
    for (size_t i = 0; i < ids.size(); ++i) (sides[i] > 0 ? side1 : side2).insert(ids[i]);
    if (std::min(side1.size(), side2.size()) < kMinPhotos) return one;
    Shares shares = SharesOf(pairs, sides);
    if (shares.within.empty() || shares.between.empty()) return one;
    if (Median(&shares.between) > kMaxRatio * Median(&shares.within)) return one;

    std::vector<std::set<uint32_t>> rooms = TakeApart(side1);
    const auto of_side2 = TakeApart(side2);
    rooms.insert(rooms.end(), of_side2.begin(), of_side2.end());
    std::map<uint32_t, size_t> room_of;
    for (size_t room = 0; room < rooms.size(); ++room) {
      for (const uint32_t id : rooms[room]) room_of[id] = room;
    }
    return AreBelieved(
               photos, ids, pairs, room_of,
               [&](uint32_t a, uint32_t b) { return (side1.count(a) > 0) != (side1.count(b) > 0); })
               ? rooms
               : one;
  }

  double share_within = std::numeric_limits<double>::quiet_NaN(), share_between = share_within;

 private:
  std::vector<PairShare> PairsOf(const std::vector<uint32_t>& ids) const {
    std::map<uint32_t, int> index;
    for (const uint32_t id : ids) index.emplace(id, static_cast<int>(index.size()));
    std::vector<PairShare> pairs;
    for (const auto& [pair, sights] : common_) {
      if (sights.num_expected < kMinExpectedOfPair) continue;
      const auto first = index.find(pair.first), second = index.find(pair.second);
      if (first == index.end() || second == index.end()) continue;
      pairs.push_back({first->second, second->second, sights.Share()});
    }
    return pairs;
  }

  template <typename Across>
  bool AreBelieved(const std::set<uint32_t>& photos, const std::vector<uint32_t>& ids,
                   const std::vector<PairShare>& pairs, const std::map<uint32_t, size_t>& room_of,
                   const Across& across) {
    const auto same_room = [&](uint32_t a, uint32_t b) { return room_of.at(a) == room_of.at(b); };
    Shares shares;
    for (const PairShare& pair : pairs) {
      const uint32_t a = ids[static_cast<size_t>(pair.photo1)],
                     b = ids[static_cast<size_t>(pair.photo2)];
      if (same_room(a, b)) shares.within.push_back(pair.share);
      if (across(a, b)) shares.between.push_back(pair.share);
    }
    if (shares.within.empty() || shares.between.empty()) return false;
    const double within = Median(&shares.within), between = Median(&shares.between),
                 middle = (within + between) / 2;
    const auto share_if = [](const std::vector<double>& values, const auto& predicate) {
      return static_cast<double>(std::count_if(values.begin(), values.end(), predicate)) /
             static_cast<double>(values.size());
    };
    const double wrong = std::max(share_if(shares.within, [&](double x) { return x < middle; }),
                                  share_if(shares.between, [&](double x) { return x > middle; }));
    if (between > kMaxRatio * within || wrong > kMaxWrong) return false;
    if (between > kFarRatio * within || wrong > kFarWrong) {
      const double uneven_between = MedianUnevenness(model_, expected_, photos, across),
                   uneven_within = MedianUnevenness(model_, expected_, photos, same_room);
      if (!(uneven_between > kMinUneven * uneven_within)) return false;
    }
    if (!(between / within <= share_between / share_within)) {
      share_within = within;
      share_between = between;
    }
    return true;
  }

  const SparseModel& model_;
  const ExpectedSightings& expected_;
  const CommonOfPairs common_;
};

}  // namespace

LookalikeRooms FindLookalikeRooms(const SparseModel& model, const ExpectedSightings& expected) {
  std::set<uint32_t> photos;
  for (const auto& [id, sightings] : expected) photos.insert(id);
  RoomSearch search(model, expected);
  LookalikeRooms found;
  found.rooms = search.TakeApart(photos);
  found.share_within = search.share_within;
  found.share_between = search.share_between;
  std::stable_sort(found.rooms.begin(), found.rooms.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return found;
}

}  // namespace roomtex
