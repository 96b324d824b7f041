#include "colmap_ext/pair_groups.h"

namespace roomtex {
namespace {

// Of the matches, and of the features in between, so many obey one motion where two photos show
// one place. Measured on simulated rooms with the same furniture: of 97 pairs of two rooms none, of
// 43 of one room 28 with the 1500 largest features of a photo, and more with all 4000.
constexpr double kCertainShare = 0.82, kCertainDensity = 0.12, kCertainInliers = 4;
constexpr int kMaxFailures = 4;  // of two groups
constexpr int kSmallGroup = 4;   // has fewer photos

}  // namespace

bool PairGroups::IsCertain(const PairCheck& check) const {
  return check.num_inliers >= kCertainInliers * min_num_inliers_ &&
         check.num_inliers >= kCertainShare * check.num_matches &&
         check.num_inliers >= kCertainDensity * check.num_in_hull;
}

bool PairGroups::IsOpen(const PhotoPairKey& key) {
  const int set1 = sets_.Find(key.first), set2 = sets_.Find(key.second);
  if (set1 == set2) return false;
  const auto evidence = evidence_.find(KeyOf(set1, set2));
  return evidence == evidence_.end() || evidence->second.num_failed < kMaxFailures;
}

void PairGroups::JoinIfCertain(const PhotoPairKey& key, const PairCheck& check) {
  const int set1 = sets_.Find(key.first), set2 = sets_.Find(key.second);
  if (set1 == set2) return;
  Evidence& evidence = evidence_[KeyOf(set1, set2)];
  if (!IsCertain(check)) {
    ++evidence.num_failed;
    return;
  }
  ++evidence.num_certain;
  if (std::min(sets_.SizeOf(set1), sets_.SizeOf(set2)) < kSmallGroup ||
      (evidence.num_certain >= 2 && evidence.num_certain > evidence.num_failed)) {
    sets_.Join(set1, set2);
  }
}

void PairGroups::JoinByEvidence() {
  // What was found when the groups were smaller counts.
  std::map<PhotoPairKey, Evidence> all;
  for (const auto& [sets, evidence] : evidence_) {
    Evidence& sum = all[KeyOf(sets_.Find(sets.first), sets_.Find(sets.second))];
    sum.num_certain += evidence.num_certain;
    sum.num_failed += evidence.num_failed;
  }
  for (const auto& [sets, evidence] : all) {
    if (evidence.num_certain > evidence.num_failed) sets_.Join(sets.first, sets.second);
  }
}

void PairGroups::JoinIfSmall(const PhotoPairKey& key) {
  const int set1 = sets_.Find(key.first), set2 = sets_.Find(key.second);
  if (std::min(sets_.SizeOf(set1), sets_.SizeOf(set2)) < kSmallGroup) sets_.Join(set1, set2);
}

}  // namespace roomtex
