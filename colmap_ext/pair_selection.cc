#include "colmap_ext/pair_selection.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "colmap_ext/feature_cache.h"
#include "colmap_ext/nearest_places.h"
#include "colmap_ext/pair_check.h"
#include "colmap_ext/pair_groups.h"
#include "colmap_ext/photo_signature.h"
#include "colmap_ext/view_graph.h"
#include "core/error.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr int kPairsAtATime = 1000;
constexpr int kThoroughFeatures = 4;  // a thorough check takes so many times the features
constexpr int kMostNeighbors = 256;   // of one photo, that lead on to others
constexpr int kThoroughAtATime = 16;
constexpr double kBridgeInliers = 2;  // of a pair of them, over --Pairs.min_num_inliers
constexpr int kBridgeChecks = 20;     // per group, and per loose end of one, and round
constexpr int kBridgeRounds = 2;      // though no group grows
constexpr int kMaxExpansions = 8;     // rounds that each add something
constexpr int kMaxGuessGroup = 2, kGuesses = 6;

std::string FolderOf(const std::string& name) {
  const size_t slash = name.rfind('/');
  return slash == std::string::npos ? "" : name.substr(0, slash);
}

class PairSearch {
 public:
  PairSearch(const Database& database, const std::vector<PhotoHint>& hints,
             const PairOptions& options, int num_threads, uint64_t random_seed, Progress* progress)
      : database_(database),
        hints_(hints),
        options_(options),
        num_threads_(num_threads),
        seed_(random_seed),
        progress_(*progress),
        groups_(0, options.min_num_inliers) {}

  PairSelection Run() {
    ReadPhotos();
    UseFeatures(options_.num_features);
    signatures_ = SignPhotos(&*features_, num_threads_, seed_, &progress_);
    ProposeFirst();
    progress_.Stage("check pairs", static_cast<int>(proposed_.size()));
    CheckProposed();
    std::vector<int> all(photos_.size());
    std::iota(all.begin(), all.end(), 0);
    for (int round = 0; round < options_.num_rounds; ++round) {
      ProposeNeighbors(all);
      if (proposed_.empty()) break;
      progress_.Stage("check neighbors", static_cast<int>(proposed_.size()));
      CheckProposed();
    }
    JoinCertain();
    JoinSmall();
    Expand();
    return Select();
  }

 private:
  int NumPhotos() const { return static_cast<int>(photos_.size()); }

  void ReadPhotos();
  void UseFeatures(int num_features);

  void Propose(int a, int b, PairSource source);
  void ProposeRow(const std::vector<int>& row, PairSource source, bool within_folder);
  void ProposeFirst();
  void KeepStrongest(std::vector<std::pair<int, double>>* neighbors) const;
  void ProposeNeighbors(const std::vector<int>& photos);
  std::vector<PairCheck> CheckAll(const std::vector<PhotoPairKey>& pairs);
  std::vector<PhotoPairKey> CheckProposed();
  std::vector<PhotoPairKey> Strongest() const;
  void JoinCertain();
  void JoinSmall();
  void Expand();
  std::vector<PhotoPairKey> CheckBridges();
  std::vector<PhotoPairKey> CloseLoops();
  std::vector<PhotoPairKey> BestBetween(const std::vector<std::vector<int>>& sets,
                                        const AcceptsSimilar& accepts) const;
  void CheckAround(std::vector<PhotoPairKey> found);
  bool MayBridge(int photo, int other) const;
  std::vector<int> GroupOfEach();

  double WeightOf(const PairEdge& edge) const;
  void ListGuesses(const std::vector<std::vector<int>>& groups);
  PairSelection Select();

  const Database& database_;
  const std::vector<PhotoHint>& hints_;
  const PairOptions& options_;
  const int num_threads_;
  const uint64_t seed_;
  Progress& progress_;

  std::vector<PairPhoto> photos_;
  std::optional<FeatureCache> features_;  // that a check compares now
  int num_features_used_ = 0;             // of a photo
  Eigen::MatrixXf signatures_;            // a column per photo
  std::map<PhotoPairKey, PairEdge> edges_;
  std::map<PhotoPairKey, PairSource> proposed_;
  PairGroups groups_;
  int num_checked_ = 0, num_in_database_ = 0;
};

void PairSearch::ReadPhotos() {
  const std::map<uint32_t, Camera> cameras = database_.ReadCameras();
  const std::map<uint32_t, size_t> counts = database_.CountKeypoints();
  std::map<uint32_t, int> photo_of_id;
  int num_with_features = 0;
  for (const auto& [image_id, image] : database_.ReadImages()) {
    const auto count = counts.find(image_id);
    PairPhoto photo;
    photo.image_id = image_id;
    photo.name = image.name;
    photo.num_features = count == counts.end() ? 0 : count->second;
    num_with_features += photo.num_features > 0;
    photo_of_id[image_id] = NumPhotos();
    photos_.push_back(photo);
    if (cameras.at(image.camera_id).IsPanorama()) {
      throw InputError(database_.path(), "camera " + std::to_string(image.camera_id),
                       "is EQUIRECTANGULAR: panoramas have no picture plane to compare",
                       "Cut them into faces with roomtex-import");
    }
  }
  if (photos_.empty()) {
    throw InputError(database_.path(), "", "holds no images", "Run colmap feature_extractor first");
  }
  if (num_with_features < 2) {
    throw InputError(
        database_.path(), "",
        std::to_string(num_with_features) + " of " + std::to_string(photos_.size()) +
            " photos has features, and a pair takes two",
        photos_.size() < 2
            ? "Add photos with colmap feature_extractor"
            : "Run colmap feature_extractor again; photos of blank walls need a projected pattern");
  }
  for (const auto& [ids, num_matches] : database_.CountMatches()) {
    PairEdge edge;
    std::tie(edge.photo1, edge.photo2) = KeyOf(photo_of_id[ids.first], photo_of_id[ids.second]);
    edge.source = PairSource::kDatabase;
    edge.num_matches = edge.num_inliers = static_cast<int>(num_matches);
    edge.agrees = num_matches > 0;
    edge.in_database = true;
    edges_[{edge.photo1, edge.photo2}] = edge;
    ++num_in_database_;
  }
}

void PairSearch::UseFeatures(int num_features) {
  if (num_features == num_features_used_) return;
  features_.emplace(database_, num_features);
  num_features_used_ = num_features;
}

void PairSearch::Propose(int a, int b, PairSource source) {
  if (a == b || photos_[static_cast<size_t>(a)].num_features == 0 ||
      photos_[static_cast<size_t>(b)].num_features == 0) {
    return;
  }
  if (edges_.count(KeyOf(a, b)) == 0) proposed_.emplace(KeyOf(a, b), source);
}

// Photos with the next ones of a row.
void PairSearch::ProposeRow(const std::vector<int>& row, PairSource source, bool within_folder) {
  for (size_t i = 0; i < row.size(); ++i) {
    const size_t end = std::min(row.size(), i + 1 + static_cast<size_t>(options_.num_in_sequence));
    for (size_t k = i + 1; k < end; ++k) {
      const std::string &name1 = photos_[static_cast<size_t>(row[i])].name,
                        &name2 = photos_[static_cast<size_t>(row[k])].name;
      if (!within_folder || FolderOf(name1) == FolderOf(name2)) Propose(row[i], row[k], source);
    }
  }
}

void PairSearch::ProposeFirst() {
  const auto similar = MostSimilar(signatures_, options_.num_candidates, num_threads_);
  for (int photo = 0; photo < NumPhotos(); ++photo) {
    for (const SimilarPhoto& other : similar[static_cast<size_t>(photo)]) {
      Propose(photo, other.photo, PairSource::kSignature);
    }
  }
  std::vector<int> row(photos_.size());
  std::iota(row.begin(), row.end(), 0);
  std::sort(row.begin(), row.end(), [&](int a, int b) {
    return photos_[static_cast<size_t>(a)].name < photos_[static_cast<size_t>(b)].name;
  });
  ProposeRow(row, PairSource::kSequence, true);
  if (hints_.empty()) return;
  std::vector<int> timed, placed;
  for (const int photo : row) {
    if (!hints_[static_cast<size_t>(photo)].date_time.empty()) timed.push_back(photo);
    if (hints_[static_cast<size_t>(photo)].place) placed.push_back(photo);
  }
  std::stable_sort(timed.begin(), timed.end(), [&](int a, int b) {
    return hints_[static_cast<size_t>(a)].date_time < hints_[static_cast<size_t>(b)].date_time;
  });
  ProposeRow(timed, PairSource::kTime, false);
  std::vector<Place> places;
  places.reserve(placed.size());
  for (const int photo : placed) places.push_back(*hints_[static_cast<size_t>(photo)].place);
  const auto nearest = NearestPlaces(places, options_.num_by_place);
  for (size_t i = 0; i < placed.size(); ++i) {
    for (const int other : nearest[i]) {
      Propose(placed[i], placed[static_cast<size_t>(other)], PairSource::kPlace);
    }
  }
}

// Of a photo with very many neighbours the strongest count: all that agree with it would look
// through all of them.
void PairSearch::KeepStrongest(std::vector<std::pair<int, double>>* neighbors) const {
  const auto most = std::max<std::ptrdiff_t>(kMostNeighbors, 2 * options_.max_neighbors);
  if (static_cast<std::ptrdiff_t>(neighbors->size()) <= most) return;
  std::nth_element(neighbors->begin(), neighbors->begin() + most, neighbors->end(),
                   [](const auto& a, const auto& b) {
                     return a.second != b.second ? a.second > b.second : a.first < b.first;
                   });
  neighbors->resize(static_cast<size_t>(most));
  std::sort(neighbors->begin(), neighbors->end());
}

// Neighbours of neighbours, those that most of the evidence leads to.
void PairSearch::ProposeNeighbors(const std::vector<int>& photos) {
  std::vector<std::vector<std::pair<int, double>>> neighbors(photos_.size());
  for (const auto& [key, edge] : edges_) {
    if (!edge.agrees) continue;
    neighbors[static_cast<size_t>(key.first)].emplace_back(key.second, WeightOf(edge));
    neighbors[static_cast<size_t>(key.second)].emplace_back(key.first, WeightOf(edge));
  }
  for (auto& list : neighbors) KeepStrongest(&list);
  for (const int photo : photos) {
    const auto& own = neighbors[static_cast<size_t>(photo)];
    if (own.size() >= 2 * static_cast<size_t>(options_.max_neighbors)) continue;
    std::map<int, double> evidence;
    for (const auto& [neighbor, weight] : own) {
      for (const auto& [other, other_weight] : neighbors[static_cast<size_t>(neighbor)]) {
        evidence[other] += std::min(weight, other_weight);
      }
    }
    std::vector<std::pair<double, int>> best;
    for (const auto& [other, sum] : evidence) {
      if (other != photo && edges_.count(KeyOf(photo, other)) == 0) best.emplace_back(-sum, other);
    }
    std::sort(best.begin(), best.end());
    const size_t count = std::min(best.size(), static_cast<size_t>(options_.num_candidates / 2));
    for (size_t i = 0; i < count; ++i) Propose(photo, best[i].second, PairSource::kNeighbors);
  }
}

std::vector<PairCheck> PairSearch::CheckAll(const std::vector<PhotoPairKey>& pairs) {
  std::vector<PairCheck> checks(pairs.size());
  size_t count = 0;
  for (size_t first = 0; first < pairs.size(); first += count) {
    std::set<int> photos;
    for (count = 0; first + count < pairs.size() && count < kPairsAtATime; ++count) {
      if (photos.size() + 2 > features_->max_photos() && count > 0) break;
      photos.insert(pairs[first + count].first);
      photos.insert(pairs[first + count].second);
    }
    features_->Load(photos);
    ParallelFor(num_threads_, 0, static_cast<int>(count), [&](int i) {
      const size_t at = first + static_cast<size_t>(i);
      checks[at] = CheckPair(features_->At(pairs[at].first), features_->At(pairs[at].second),
                             options_.check);
      progress_.Tick();
    });
  }
  num_checked_ += static_cast<int>(pairs.size());
  return checks;
}

// Those that agree.
std::vector<PhotoPairKey> PairSearch::CheckProposed() {
  UseFeatures(options_.num_features);
  std::vector<PhotoPairKey> pairs, agreeing;
  for (const auto& [key, source] : proposed_) pairs.push_back(key);
  const std::vector<PairCheck> checks = CheckAll(pairs);
  for (size_t i = 0; i < pairs.size(); ++i) {
    PairEdge edge;
    std::tie(edge.photo1, edge.photo2) = pairs[i];
    edge.source = proposed_.at(pairs[i]);
    edge.num_matches = checks[i].num_matches;
    edge.num_inliers = checks[i].num_inliers;
    edge.agrees = edge.num_inliers >= options_.min_num_inliers;
    edges_[pairs[i]] = edge;
    if (edge.agrees) agreeing.push_back(pairs[i]);
  }
  proposed_.clear();
  return agreeing;
}

// The database counts matches of all features, a check those of the few that it compares.
double PairSearch::WeightOf(const PairEdge& edge) const {
  if (edge.source == PairSource::kBridge) return edge.num_inliers / double{kThoroughFeatures};
  if (edge.source != PairSource::kDatabase) return edge.num_inliers;
  const size_t num_features =
      std::max<size_t>(1, std::min(photos_[static_cast<size_t>(edge.photo1)].num_features,
                                   photos_[static_cast<size_t>(edge.photo2)].num_features));
  return edge.num_inliers *
         std::min(1.0, options_.num_features / static_cast<double>(num_features));
}

// Pairs that agree, the strongest first.
std::vector<PhotoPairKey> PairSearch::Strongest() const {
  std::vector<std::pair<double, PhotoPairKey>> found;
  for (const auto& [key, edge] : edges_) {
    if (edge.agrees) found.emplace_back(-WeightOf(edge), key);
  }
  std::sort(found.begin(), found.end());
  std::vector<PhotoPairKey> keys;
  keys.reserve(found.size());
  for (const auto& [weight, key] : found) keys.push_back(key);
  return keys;
}

// A spanning forest of the strongest pairs (Kruskal), each looked at with many features.
void PairSearch::JoinCertain() {
  groups_ = PairGroups(NumPhotos(), options_.min_num_inliers);
  UseFeatures(kThoroughFeatures * options_.num_features);
  progress_.Stage("look thoroughly");
  std::vector<PhotoPairKey> pairs;
  const auto look = [&] {
    const std::vector<PairCheck> checks = CheckAll(pairs);
    for (size_t i = 0; i < pairs.size(); ++i) groups_.JoinIfCertain(pairs[i], checks[i]);
    pairs.clear();
  };
  for (const PhotoPairKey& key : Strongest()) {
    if (edges_.at(key).source == PairSource::kDatabase || options_.join_lookalikes) {
      groups_.Join(key);
    }
    if (!groups_.IsOpen(key)) continue;
    pairs.push_back(key);
    if (pairs.size() == kThoroughAtATime) look();
  }
  look();
  groups_.JoinByEvidence();
}

void PairSearch::JoinSmall() {
  for (const PhotoPairKey& key : Strongest()) groups_.JoinIfSmall(key);
}

// Round after round, until one adds nothing: what connects groups, what closes loops, and what is
// near that. A round costs so many checks per group, loose end and photo that it adds.
void PairSearch::Expand() {
  for (int round = 0; round < kMaxExpansions; ++round) {
    std::vector<PhotoPairKey> found = CheckBridges();
    const std::vector<PhotoPairKey> loops = CloseLoops();
    found.insert(found.end(), loops.begin(), loops.end());
    if (found.empty()) return;
    const auto apart = [&](const PhotoPairKey& key) { return !groups_.AreJoined(key); };
    found.erase(std::remove_if(found.begin(), found.end(), apart), found.end());
    if (found.empty() && round + 1 >= kBridgeRounds) return;
    CheckAround(found);
  }
}

// Neighbours of neighbours of photos that have got new ones.
void PairSearch::CheckAround(std::vector<PhotoPairKey> found) {
  for (int round = 0; round < options_.num_rounds && !found.empty(); ++round) {
    std::set<int> photos;
    for (const auto& [photo1, photo2] : found) photos.insert({photo1, photo2});
    ProposeNeighbors({photos.begin(), photos.end()});
    if (proposed_.empty()) return;
    progress_.Stage("check neighbors", static_cast<int>(proposed_.size()));
    found = CheckProposed();
  }
}

std::vector<int> PairSearch::GroupOfEach() {
  std::vector<int> group_of(photos_.size());
  const std::vector<std::vector<int>> groups = groups_.Lists();
  for (size_t group = 0; group < groups.size(); ++group) {
    for (const int photo : groups[group]) {
      group_of[static_cast<size_t>(photo)] = static_cast<int>(group);
    }
  }
  return group_of;
}

// Of each set of photos the pairs with others that are most alike, by signature, of those that
// `accepts`.
std::vector<PhotoPairKey> PairSearch::BestBetween(const std::vector<std::vector<int>>& sets,
                                                  const AcceptsSimilar& accepts) const {
  std::vector<int> asking;
  std::vector<size_t> set_of;
  for (size_t set = 0; set < sets.size(); ++set) {
    for (const int photo : sets[set]) {
      if (photos_[static_cast<size_t>(photo)].num_features == 0) continue;
      asking.push_back(photo);
      set_of.push_back(set);
    }
  }
  const auto similar =
      MostSimilarOf(asking, signatures_, kBridgeChecks, num_threads_, [&](int photo, int other) {
        return photos_[static_cast<size_t>(other)].num_features > 0 && accepts(photo, other);
      });
  std::vector<std::vector<std::pair<double, PhotoPairKey>>> of_set(sets.size());
  for (size_t i = 0; i < asking.size(); ++i) {
    for (const SimilarPhoto& one : similar[i]) {
      of_set[set_of[i]].emplace_back(-one.similarity, KeyOf(asking[i], one.photo));
    }
  }
  std::set<PhotoPairKey> best;
  for (auto& found : of_set) {
    std::sort(found.begin(), found.end());
    const size_t count = std::min<size_t>(found.size(), kBridgeChecks);
    for (size_t i = 0; i < count; ++i) best.insert(found[i].second);
  }
  return {best.begin(), best.end()};
}

// Could a look at this pair of two groups connect them?
bool PairSearch::MayBridge(int photo, int other) const {
  const auto edge = edges_.find(KeyOf(photo, other));
  // What agrees was looked at thoroughly, or in vain often enough.
  return edge == edges_.end() || !(edge->second.in_database || edge->second.agrees ||
                                   edge->second.source == PairSource::kBridge);
}

// Looks at what could connect each group but the largest to others; pairs that agree.
std::vector<PhotoPairKey> PairSearch::CheckBridges() {
  std::vector<std::vector<int>> groups = groups_.Lists();
  groups.erase(groups.begin());
  const std::vector<int> group_of = GroupOfEach();
  const std::vector<PhotoPairKey> pairs = BestBetween(groups, [&](int photo, int other) {
    return group_of[static_cast<size_t>(photo)] != group_of[static_cast<size_t>(other)] &&
           MayBridge(photo, other);
  });
  if (pairs.empty()) return {};
  progress_.Stage("connect groups", static_cast<int>(pairs.size()));
  UseFeatures(kThoroughFeatures * options_.num_features);
  const std::vector<PairCheck> checks = CheckAll(pairs);
  std::vector<PhotoPairKey> agreeing;
  for (size_t i = 0; i < pairs.size(); ++i) {
    PairEdge& edge = edges_[pairs[i]];
    std::tie(edge.photo1, edge.photo2) = pairs[i];
    edge.source = PairSource::kBridge;
    edge.num_matches = checks[i].num_matches;
    edge.num_inliers = checks[i].num_inliers;
    edge.agrees = edge.num_inliers >= kBridgeInliers * options_.min_num_inliers;
    if (!edge.agrees) continue;
    agreeing.push_back(pairs[i]);
    groups_.JoinIfCertain(pairs[i], checks[i]);
  }
  JoinSmall();
  return agreeing;
}

// Photos that one pair alone connects to their group may be the end of a loop: looks at what is
// like them elsewhere in the group. What looks alike in two places of a group must be certain.
std::vector<PhotoPairKey> PairSearch::CloseLoops() {
  const std::vector<int> group_of = GroupOfEach();
  const auto same_group = [&](int a, int b) {
    return group_of[static_cast<size_t>(a)] == group_of[static_cast<size_t>(b)];
  };
  std::vector<PhotoPairKey> links;
  for (const auto& [key, edge] : edges_) {
    if (edge.agrees && same_group(key.first, key.second)) links.push_back(key);
  }
  const std::vector<std::vector<int>> ends = LooseEnds(NumPhotos(), links);
  std::vector<int> end_of(photos_.size(), -1);
  for (size_t end = 0; end < ends.size(); ++end) {
    for (const int photo : ends[end]) end_of[static_cast<size_t>(photo)] = static_cast<int>(end);
  }
  const std::vector<PhotoPairKey> pairs = BestBetween(ends, [&](int photo, int other) {
    return same_group(photo, other) &&
           end_of[static_cast<size_t>(photo)] != end_of[static_cast<size_t>(other)] &&
           edges_.count(KeyOf(photo, other)) == 0;
  });
  for (const auto& [photo1, photo2] : pairs) Propose(photo1, photo2, PairSource::kLoop);
  if (proposed_.empty()) return {};
  progress_.Stage("close loops", static_cast<int>(proposed_.size()));
  const std::vector<PhotoPairKey> agreeing = CheckProposed();
  if (options_.join_lookalikes || agreeing.empty()) return agreeing;
  UseFeatures(kThoroughFeatures * options_.num_features);
  const std::vector<PairCheck> checks = CheckAll(agreeing);
  std::vector<PhotoPairKey> certain;
  for (size_t i = 0; i < agreeing.size(); ++i) {
    if (groups_.IsCertain(checks[i])) {
      certain.push_back(agreeing[i]);
    } else {
      edges_.at(agreeing[i]).agrees = false;
    }
  }
  return certain;
}

// Photos that nothing connects get the pairs most like them: COLMAP compares all features.
void PairSearch::ListGuesses(const std::vector<std::vector<int>>& groups) {
  std::vector<int> asking;
  for (size_t group = 1; group < groups.size(); ++group) {
    if (groups[group].size() > kMaxGuessGroup) continue;
    for (const int photo : groups[group]) {
      if (photos_[static_cast<size_t>(photo)].num_features > 0) asking.push_back(photo);
    }
  }
  const auto similar =
      MostSimilarOf(asking, signatures_, kGuesses, num_threads_, [&](int /*photo*/, int other) {
        return photos_[static_cast<size_t>(other)].num_features > 0;
      });
  for (size_t i = 0; i < asking.size(); ++i) {
    for (const SimilarPhoto& one : similar[i]) {
      const PhotoPairKey key = KeyOf(asking[i], one.photo);
      PairEdge& edge = edges_[key];
      std::tie(edge.photo1, edge.photo2) = key;
      edge.listed = !edge.in_database;
    }
  }
}

PairSelection PairSearch::Select() {
  PairSelection selection;
  selection.groups = groups_.Lists();
  selection.num_checked = num_checked_;
  selection.num_in_database = num_in_database_;
  for (size_t group = 0; group < selection.groups.size(); ++group) {
    for (const int photo : selection.groups[group]) {
      photos_[static_cast<size_t>(photo)].group = static_cast<int>(group);
    }
  }
  std::vector<GraphEdge> graph;
  std::vector<PairEdge*> of_graph;
  std::map<PhotoPairKey, int> lookalikes;
  for (auto& [key, edge] : edges_) {
    if (!edge.agrees) continue;
    const PhotoPairKey groups = KeyOf(photos_[static_cast<size_t>(key.first)].group,
                                      photos_[static_cast<size_t>(key.second)].group);
    if (groups.first != groups.second) {
      edge.agrees = false;
      ++lookalikes[groups];
      continue;
    }
    graph.push_back({key.first, key.second, WeightOf(edge)});
    of_graph.push_back(&edge);
    edge.listed = edge.in_database;
  }
  for (const int kept : SparseEdges(NumPhotos(), graph, options_.max_neighbors)) {
    of_graph[static_cast<size_t>(kept)]->listed = true;
  }
  for (const auto& [groups, count] : lookalikes) {
    selection.lookalikes.push_back({groups.first, groups.second, count});
  }
  ListGuesses(selection.groups);
  for (auto& [key, edge] : edges_) {
    if (options_.only_new && edge.in_database) edge.listed = false;
    if (!edge.agrees && !edge.listed) continue;
    if (edge.listed) {
      ++photos_[static_cast<size_t>(key.first)].num_pairs;
      ++photos_[static_cast<size_t>(key.second)].num_pairs;
    }
    selection.edges.push_back(edge);
  }
  selection.photos = std::move(photos_);
  return selection;
}

}  // namespace

const char* PairSourceName(PairSource source) {
  switch (source) {
    case PairSource::kDatabase:
      return "database";
    case PairSource::kSignature:
      return "signature";
    case PairSource::kSequence:
      return "sequence";
    case PairSource::kTime:
      return "time";
    case PairSource::kPlace:
      return "place";
    case PairSource::kNeighbors:
      return "neighbors";
    case PairSource::kBridge:
      return "bridge";
    case PairSource::kLoop:
      return "loop";
  }
  return "";
}

PairSelection SelectPairs(const Database& database, const std::vector<PhotoHint>& hints,
                          const PairOptions& options, int num_threads, uint64_t random_seed,
                          Progress* progress) {
  return PairSearch(database, hints, options, num_threads, random_seed, progress).Run();
}

}  // namespace roomtex
