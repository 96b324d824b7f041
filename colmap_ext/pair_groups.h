#pragma once
// Photos of one place, kept apart from those of another that looks alike. Rooms with the same
// furniture agree on large things and not on the small ones in between: groups grow by pairs that
// are certain after a thorough look.

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "colmap_ext/pair_check.h"
#include "colmap_ext/view_graph.h"

namespace roomtex {

using PhotoPairKey = std::pair<int, int>;  // smaller first

inline PhotoPairKey KeyOf(int a, int b) { return {std::min(a, b), std::max(a, b)}; }

class PairGroups {
 public:
  // min_num_inliers: of a pair that agrees; certain ones have several times as many.
  PairGroups(int num_photos, int min_num_inliers)
      : min_num_inliers_(min_num_inliers), sets_(num_photos) {}

  void Join(const PhotoPairKey& key) { sets_.Join(key.first, key.second); }
  // check: a thorough one. Do its features show one place?
  bool IsCertain(const PairCheck& check) const;
  bool AreJoined(const PhotoPairKey& key) {
    return sets_.Find(key.first) == sets_.Find(key.second);
  }
  // Is a thorough look at this pair worth it: of two groups that have not failed often?
  bool IsOpen(const PhotoPairKey& key);
  // check: the thorough one. A certain pair takes a small group along; large ones join by two, or
  // by more than speak against.
  void JoinIfCertain(const PhotoPairKey& key, const PairCheck& check);
  // Groups that most of what was found speaks for, be it one pair.
  void JoinByEvidence();
  // Groups of few photos join where they fit best, whether that is certain or not.
  void JoinIfSmall(const PhotoPairKey& key);

  // Each ascending; the largest first.
  std::vector<std::vector<int>> Lists() { return sets_.Groups(); }

 private:
  struct Evidence {
    int num_certain = 0, num_failed = 0;
  };

  int min_num_inliers_;
  DisjointSets sets_;
  std::map<PhotoPairKey, Evidence> evidence_;  // of two groups, by their smallest photos
};

}  // namespace roomtex
