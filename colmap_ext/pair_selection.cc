#include "colmap_ext/pair_selection.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "colmap_ext/pair_check.h"
#include "colmap_ext/photo_signature.h"
#include "colmap_ext/view_graph.h"
#include "core/error.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr int kNumWords = 64;
constexpr int kMaxWordPhotos = 500, kDescriptorsPerWordPhoto = 100;
constexpr int kMaxAxesPhotos = 512, kMaxDimensions = 256;
constexpr int kPairsAtATime = 1000, kPhotosAtATime = 64, kMaxFeaturesInMemory = 1500000;
// A thorough check takes so many times the features. Of the matches, and of the features in
// between, so many obey one motion where two photos show one place. Measured on simulated rooms
// with the same furniture: of 97 pairs of two rooms none, of 43 of one room 28 with the 1500
// largest features of a photo, and more with all 4000.
constexpr int kThoroughFeatures = 4;
constexpr double kCertainShare = 0.82, kCertainDensity = 0.12, kCertainInliers = 4;
constexpr int kThoroughAtATime = 16, kMaxFailures = 4;  // of two groups
// Groups of fewer photos join where they fit best, whether that is certain or not.
constexpr int kSmallGroup = 4;
constexpr double kBridgeInliers = 2;  // of a pair of them, over --Pairs.min_num_inliers
constexpr int kBridgeChecks = 20, kBridgeRounds = 2;  // per group
constexpr int kMaxGuessGroup = 2, kGuesses = 6;

using PhotoPairKey = std::pair<int, int>;  // smaller first

PhotoPairKey KeyOf(int a, int b) { return {std::min(a, b), std::max(a, b)}; }

// At most `count` of 0 .. size - 1, evenly spaced.
std::vector<int> EvenChoice(size_t size, int count) {
  const size_t number = std::min(size, static_cast<size_t>(count));
  std::vector<int> chosen(number);
  for (size_t i = 0; i < number; ++i) chosen[i] = static_cast<int>(i * size / number);
  return chosen;
}

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
        num_features_(options.num_features),
        sets_(0) {}

  PairSelection Run() {
    ReadPhotos();
    MakeSignatures();
    ProposeFirst();
    progress_.Stage("check pairs", static_cast<int>(proposed_.size()));
    CheckProposed();
    for (int round = 0; round < options_.num_rounds; ++round) {
      ProposeNeighbors();
      if (proposed_.empty()) break;
      progress_.Stage("check neighbors", static_cast<int>(proposed_.size()));
      CheckProposed();
    }
    num_features_ = kThoroughFeatures * options_.num_features;
    features_.clear();
    JoinCertain();
    JoinSmall();
    for (int round = 0; round < kBridgeRounds && CheckBridges(); ++round) {
    }
    return Select();
  }

 private:
  int NumPhotos() const { return static_cast<int>(photos_.size()); }

  size_t MaxPhotosInMemory() const {
    return static_cast<size_t>(kMaxFeaturesInMemory / num_features_);
  }

  void ReadPhotos();
  void Load(const std::set<int>& photos);
  void MakeSignatures();
  Eigen::VectorXf VladOf(int photo) const {
    return AggregateDescriptors(UnitDescriptors(features_.at(photo).descriptors), words_);
  }
  // Of all photos, in order, by blocks.
  template <typename Use>
  void ForEachVlad(const std::vector<int>& photos, const Use& use);

  void Propose(int a, int b, PairSource source);
  void ProposeRow(const std::vector<int>& row, PairSource source, bool within_folder);
  void ProposeFirst();
  void ProposeNeighbors();
  std::vector<PairCheck> CheckAll(const std::vector<PhotoPairKey>& pairs);
  void CheckProposed();
  std::vector<PhotoPairKey> Strongest() const;
  bool IsCertain(const PairCheck& check) const;
  void JoinIfCertain(const PhotoPairKey& key, const PairCheck& check);
  void JoinCertain();
  void JoinSmall();
  bool CheckBridges();
  std::vector<PhotoPairKey> BridgesOf(const std::vector<int>& group,
                                      const std::vector<int>& group_of) const;

  double WeightOf(const PairEdge& edge) const;
  void ListGuesses(const std::vector<std::vector<int>>& groups);
  PairSelection Select();

  const Database& database_;
  const std::vector<PhotoHint>& hints_;
  const PairOptions& options_;
  const int num_threads_;
  const uint64_t seed_;
  Progress& progress_;

  std::map<uint32_t, Camera> cameras_;
  std::vector<DatabaseImage> images_;
  std::vector<PairPhoto> photos_;
  int num_features_;  // that a check compares now
  std::map<int, ComparedFeatures> features_;
  Eigen::MatrixXf words_, signatures_;  // signatures_: a column per photo
  std::map<PhotoPairKey, PairEdge> edges_;
  std::map<PhotoPairKey, PairSource> proposed_;
  DisjointSets sets_;
  // Of two sets, by their smallest photos: certain pairs and others.
  struct Evidence {
    int num_certain = 0, num_failed = 0;
  };
  std::map<PhotoPairKey, Evidence> evidence_;
  int num_checked_ = 0, num_in_database_ = 0;
};

void PairSearch::ReadPhotos() {
  cameras_ = database_.ReadCameras();
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
    images_.push_back(image);
    const Camera& camera = cameras_.at(image.camera_id);
    if (camera.IsPanorama()) {
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

// Features of these photos into memory; others make room.
void PairSearch::Load(const std::set<int>& photos) {
  if (features_.size() + photos.size() > MaxPhotosInMemory()) {
    for (auto it = features_.begin(); it != features_.end();) {
      it = photos.count(it->first) > 0 ? std::next(it) : features_.erase(it);
    }
  }
  for (const int photo : photos) {
    if (features_.count(photo) > 0) continue;
    const DatabaseImage& image = images_[static_cast<size_t>(photo)];
    features_[photo] = UndistortFeatures(
        database_.ReadLargestFeatures(image.image_id, num_features_), cameras_.at(image.camera_id));
  }
}

template <typename Use>
void PairSearch::ForEachVlad(const std::vector<int>& photos, const Use& use) {
  for (size_t first = 0; first < photos.size(); first += kPhotosAtATime) {
    const size_t count = std::min<size_t>(kPhotosAtATime, photos.size() - first);
    const auto begin = photos.begin() + static_cast<std::ptrdiff_t>(first);
    Load({begin, begin + static_cast<std::ptrdiff_t>(count)});
    ParallelFor(num_threads_, 0, static_cast<int>(count), [&](int i) {
      const size_t at = first + static_cast<size_t>(i);
      use(static_cast<Eigen::Index>(at), VladOf(photos[at]));
    });
    for (size_t i = 0; i < count; ++i) progress_.Tick();
  }
}

void PairSearch::MakeSignatures() {
  const std::vector<int> for_words = EvenChoice(photos_.size(), kMaxWordPhotos);
  const std::vector<int> for_axes = EvenChoice(photos_.size(), kMaxAxesPhotos);
  progress_.Stage("read features", static_cast<int>(for_words.size()));
  std::vector<uint8_t> sample;
  for (const int photo : for_words) {
    Load({photo});
    const std::vector<uint8_t>& bytes = features_.at(photo).descriptors;
    for (const int row : EvenChoice(bytes.size() / kSiftSize, kDescriptorsPerWordPhoto)) {
      const auto first = bytes.begin() + static_cast<std::ptrdiff_t>(row) * kSiftSize;
      sample.insert(sample.end(), first, first + kSiftSize);
    }
    progress_.Tick();
  }
  progress_.Stage("signatures", static_cast<int>(for_axes.size() + photos_.size()));
  words_ = LearnWords(UnitDescriptors(sample), kNumWords, seed_);
  Eigen::MatrixXf vlads(words_.size(), static_cast<Eigen::Index>(for_axes.size()));
  ForEachVlad(for_axes,
              [&](Eigen::Index at, const Eigen::VectorXf& vlad) { vlads.col(at) = vlad; });
  const SignatureAxes axes = LearnAxes(vlads, kMaxDimensions);
  vlads.resize(0, 0);
  signatures_.resize(axes.axes.rows(), NumPhotos());
  std::vector<int> all(photos_.size());
  std::iota(all.begin(), all.end(), 0);
  ForEachVlad(all, [&](Eigen::Index at, const Eigen::VectorXf& vlad) {
    signatures_.col(at) = axes.Shorten(vlad);
  });
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
  for (const int photo : placed) {
    std::vector<std::pair<double, int>> nearest;
    const auto& here = *hints_[static_cast<size_t>(photo)].place;
    for (const int other : placed) {
      const auto& there = *hints_[static_cast<size_t>(other)].place;
      if (other == photo) continue;
      nearest.emplace_back(std::hypot(here[0] - there[0], here[1] - there[1]), other);
    }
    const size_t count = std::min(nearest.size(), static_cast<size_t>(options_.num_by_place));
    std::partial_sort(nearest.begin(), nearest.begin() + static_cast<std::ptrdiff_t>(count),
                      nearest.end());
    for (size_t i = 0; i < count; ++i) Propose(photo, nearest[i].second, PairSource::kPlace);
  }
}

// Neighbours of neighbours, those that most of the evidence leads to.
void PairSearch::ProposeNeighbors() {
  std::vector<std::vector<std::pair<int, double>>> neighbors(photos_.size());
  for (const auto& [key, edge] : edges_) {
    if (!edge.agrees) continue;
    neighbors[static_cast<size_t>(key.first)].emplace_back(key.second, WeightOf(edge));
    neighbors[static_cast<size_t>(key.second)].emplace_back(key.first, WeightOf(edge));
  }
  for (int photo = 0; photo < NumPhotos(); ++photo) {
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
      if (photos.size() + 2 > MaxPhotosInMemory() && count > 0) break;
      photos.insert(pairs[first + count].first);
      photos.insert(pairs[first + count].second);
    }
    Load(photos);
    ParallelFor(num_threads_, 0, static_cast<int>(count), [&](int i) {
      const size_t at = first + static_cast<size_t>(i);
      checks[at] =
          CheckPair(features_.at(pairs[at].first), features_.at(pairs[at].second), options_.check);
      progress_.Tick();
    });
  }
  num_checked_ += static_cast<int>(pairs.size());
  return checks;
}

void PairSearch::CheckProposed() {
  std::vector<PhotoPairKey> pairs;
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
  }
  proposed_.clear();
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

bool PairSearch::IsCertain(const PairCheck& check) const {
  return check.num_inliers >= kCertainInliers * options_.min_num_inliers &&
         check.num_inliers >= kCertainShare * check.num_matches &&
         check.num_inliers >= kCertainDensity * check.num_in_hull;
}

// One certain pair takes a small set along; large ones join by two, or by more than speak against.
void PairSearch::JoinIfCertain(const PhotoPairKey& key, const PairCheck& check) {
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

// A spanning forest of the strongest pairs (Kruskal), each looked at with many features.
void PairSearch::JoinCertain() {
  sets_ = DisjointSets(NumPhotos());
  const std::vector<PhotoPairKey> strongest = Strongest();
  progress_.Stage("look thoroughly");
  std::vector<PhotoPairKey> pairs;
  const auto look = [&] {
    const std::vector<PairCheck> checks = CheckAll(pairs);
    for (size_t i = 0; i < pairs.size(); ++i) JoinIfCertain(pairs[i], checks[i]);
    pairs.clear();
  };
  for (const PhotoPairKey& key : strongest) {
    if (edges_.at(key).source == PairSource::kDatabase || options_.join_lookalikes) {
      sets_.Join(key.first, key.second);
    }
    const int set1 = sets_.Find(key.first), set2 = sets_.Find(key.second);
    const auto evidence = evidence_.find(KeyOf(set1, set2));
    if (set1 == set2 ||
        (evidence != evidence_.end() && evidence->second.num_failed >= kMaxFailures)) {
      continue;
    }
    pairs.push_back(key);
    if (pairs.size() == kThoroughAtATime) look();
  }
  look();
  // Sets that most of what was found speaks for, be it one pair. What was found when they were
  // smaller counts.
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

void PairSearch::JoinSmall() {
  for (const PhotoPairKey& key : Strongest()) {
    const int set1 = sets_.Find(key.first), set2 = sets_.Find(key.second);
    if (std::min(sets_.SizeOf(set1), sets_.SizeOf(set2)) < kSmallGroup) sets_.Join(set1, set2);
  }
}

// The pairs that could connect a group to others, by signature.
std::vector<PhotoPairKey> PairSearch::BridgesOf(const std::vector<int>& group,
                                                const std::vector<int>& group_of) const {
  std::vector<std::pair<double, PhotoPairKey>> found;
  for (const int photo : group) {
    if (photos_[static_cast<size_t>(photo)].num_features == 0) continue;
    const Eigen::VectorXf similarities = signatures_.transpose() * signatures_.col(photo);
    for (int other = 0; other < NumPhotos(); ++other) {
      if (group_of[static_cast<size_t>(other)] == group_of[static_cast<size_t>(photo)] ||
          photos_[static_cast<size_t>(other)].num_features == 0) {
        continue;
      }
      const auto edge = edges_.find(KeyOf(photo, other));
      if (edge != edges_.end() &&
          (edge->second.in_database || edge->second.source == PairSource::kBridge)) {
        continue;
      }
      // What agrees was looked at thoroughly, or in vain often enough.
      if (edge != edges_.end() && edge->second.agrees) continue;
      found.emplace_back(-similarities[other], KeyOf(photo, other));
    }
    if (found.size() > kBridgeChecks) {
      std::nth_element(found.begin(), found.begin() + kBridgeChecks, found.end());
      found.resize(kBridgeChecks);
    }
  }
  std::vector<PhotoPairKey> pairs;
  for (const auto& [score, key] : found) pairs.push_back(key);
  return pairs;
}

// False if nothing is left to connect.
bool PairSearch::CheckBridges() {
  const std::vector<std::vector<int>> groups = sets_.Groups();
  if (groups.size() < 2) return false;
  std::vector<int> group_of(photos_.size());
  for (size_t group = 0; group < groups.size(); ++group) {
    for (const int photo : groups[group]) {
      group_of[static_cast<size_t>(photo)] = static_cast<int>(group);
    }
  }
  std::vector<std::vector<PhotoPairKey>> bridges(groups.size());
  ParallelFor(num_threads_, 1, static_cast<int>(groups.size()), [&](int group) {
    bridges[static_cast<size_t>(group)] = BridgesOf(groups[static_cast<size_t>(group)], group_of);
  });
  std::set<PhotoPairKey> unique;
  for (const auto& of_group : bridges) unique.insert(of_group.begin(), of_group.end());
  if (unique.empty()) return false;
  const std::vector<PhotoPairKey> pairs(unique.begin(), unique.end());
  progress_.Stage("connect groups", static_cast<int>(pairs.size()));
  const std::vector<PairCheck> checks = CheckAll(pairs);
  bool connects = false;
  for (size_t i = 0; i < pairs.size(); ++i) {
    PairEdge& edge = edges_[pairs[i]];
    std::tie(edge.photo1, edge.photo2) = pairs[i];
    edge.source = PairSource::kBridge;
    edge.num_matches = checks[i].num_matches;
    edge.num_inliers = checks[i].num_inliers;
    edge.agrees = edge.num_inliers >= kBridgeInliers * options_.min_num_inliers;
    if (!edge.agrees) continue;
    connects = true;
    JoinIfCertain(pairs[i], checks[i]);
  }
  JoinSmall();
  return connects;
}

// Photos that nothing connects get the pairs most like them: COLMAP compares all features.
void PairSearch::ListGuesses(const std::vector<std::vector<int>>& groups) {
  for (size_t group = 1; group < groups.size(); ++group) {
    if (groups[group].size() > kMaxGuessGroup) continue;
    for (const int photo : groups[group]) {
      if (photos_[static_cast<size_t>(photo)].num_features == 0) continue;
      Eigen::VectorXf similarities = signatures_.transpose() * signatures_.col(photo);
      std::vector<std::pair<float, int>> best;
      for (int other = 0; other < NumPhotos(); ++other) {
        if (other == photo || photos_[static_cast<size_t>(other)].num_features == 0) continue;
        best.emplace_back(-similarities[other], other);
      }
      const size_t count = std::min<size_t>(best.size(), kGuesses);
      std::partial_sort(best.begin(), best.begin() + static_cast<std::ptrdiff_t>(count),
                        best.end());
      for (size_t i = 0; i < count; ++i) {
        PairEdge& edge = edges_[KeyOf(photo, best[i].second)];
        std::tie(edge.photo1, edge.photo2) = KeyOf(photo, best[i].second);
        edge.listed = !edge.in_database;
      }
    }
  }
}

PairSelection PairSearch::Select() {
  PairSelection selection;
  selection.groups = sets_.Groups();
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
  }
  return "";
}

PairSelection SelectPairs(const Database& database, const std::vector<PhotoHint>& hints,
                          const PairOptions& options, int num_threads, uint64_t random_seed,
                          Progress* progress) {
  return PairSearch(database, hints, options, num_threads, random_seed, progress).Run();
}

}  // namespace roomtex
