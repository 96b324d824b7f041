#include "texture/sampling/photo_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_set>
#include <utility>

#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Cells are as wide as so many pixels of the photos, and hold so many samples.
constexpr double kPixelsAcross = 16, kSamplesOfCell = 48;
constexpr double kMostCells = 100000;
constexpr float kFewestSamples = 8;  // that say something of a photo in a cell
constexpr float kLeastShare = 0.4f;  // of the samples of a cell that its photo must see
// What the noise of a photo adds to the variance of its colours, roots of linear light, three
// channels.
constexpr float kNoise = 4e-4f;
// What the mean of the photos keeps of their variance: from here on their detail comes from one,
// and from here on down all of it.
constexpr float kAlike = 0.9f, kUnlike = 0.6f;
// What speaks against a photo, beside being unlike the others, and for its neighbours' choice.
// Chosen on the kitchen of docs/texture.md; halving or doubling one moves little.
constexpr float kFewPixels = 0.3f, kBlurred = 0.5f, kMissing = 1;
constexpr float kSmoothness = 1, kChange = 0.1f;
constexpr int kRounds = 12;

// Over the samples of a cell that a photo sees. Colours are square roots of linear light, squares
// those of three channels together.
struct PhotoSums {
  int photo = 0;
  float count = 0, weight = 0;
  Eigen::Vector3f color = Eigen::Vector3f::Zero();
  float square = 0;
  float steps = 0, step_square = 0;  // between neighbouring samples

  void Add(const PhotoSums& other) {
    count += other.count;
    weight += other.weight;
    color += other.color;
    square += other.square;
    steps += other.steps;
    step_square += other.step_square;
  }
  bool IsSame(const PhotoSums& other) const { return photo == other.photo; }
  float Variance() const { return std::max(0.0f, (square - color.squaredNorm() / count) / count); }
  float Fineness() const { return step_square / std::max(steps, 1.0f) + 2 * kNoise; }
};

// Over those that two photos see.
struct PairSums {
  int a = 0, b = 0;  // a < b
  float count = 0;
  Eigen::Vector3f color_a = Eigen::Vector3f::Zero(), color_b = Eigen::Vector3f::Zero();
  float aa = 0, bb = 0, ab = 0;

  void Add(const PairSums& other) {
    count += other.count;
    color_a += other.color_a;
    color_b += other.color_b;
    aa += other.aa;
    bb += other.bb;
    ab += other.ab;
  }
  bool IsSame(const PairSums& other) const { return a == other.a && b == other.b; }
  float Covariance() const { return (ab - color_a.dot(color_b) / count) / count; }
  // Geometric mean of the variances.
  float Variance() const {
    const float a2 = aa - color_a.squaredNorm() / count, b2 = bb - color_b.squaredNorm() / count;
    return std::sqrt(std::max(0.0f, a2) * std::max(0.0f, b2)) / count;
  }
};

template <typename Sums>
void AddTo(std::vector<Sums>* all, const Sums& some) {
  const auto same =
      std::find_if(all->begin(), all->end(), [&](const Sums& s) { return s.IsSame(some); });
  if (same == all->end()) {
    all->push_back(some);
  } else {
    same->Add(some);
  }
}

struct CellSums {
  float count = 0;  // samples
  std::vector<PhotoSums> photos;
  std::vector<PairSums> pairs;
};

struct SumsOfCells {
  std::unordered_map<uint64_t, int> number;  // of a cell, by its key
  std::vector<Eigen::Vector3i> cells;
  std::vector<CellSums> sums;

  CellSums& At(uint64_t key, const Eigen::Vector3i& cell) {
    const auto [place, is_new] = number.emplace(key, static_cast<int>(cells.size()));
    if (is_new) {
      cells.push_back(cell);
      sums.emplace_back();
    }
    return sums[place->second];
  }
};

struct Candidate {
  int photo = 0;
  float cost = 0;
};

// What a cell may choose from.
struct CellChoice {
  std::vector<Candidate> candidates;
  std::vector<float> apart;  // candidates x candidates, 0 = they show the same, 1 = the contrary
  float texture = 0;         // 0 = nothing but noise ... 1
  std::vector<int> neighbours;
  int chosen = 0;  // candidate

  int NumberOf(int photo) const {
    for (size_t i = 0; i < candidates.size(); ++i) {
      if (candidates[i].photo == photo) return static_cast<int>(i);
    }
    return -1;
  }
  float Apart(int photo_a, int photo_b) const {
    const int a = NumberOf(photo_a), b = NumberOf(photo_b);
    if (a < 0 || b < 0) return 1;
    return apart[static_cast<size_t>(a) * candidates.size() + b];
  }
};

Eigen::Vector3d PointOf(const SampleTile& tile, int i) {
  const PointBlock& p = tile.points;
  return p.origin + Eigen::Vector3f(p.x[i], p.y[i], p.z[i]).cast<double>();
}

// What the photos kept show of one sample.
struct SampleColors {
  std::vector<int> photos;
  std::vector<Eigen::Vector3f> roots;

  void Clear() {
    photos.clear();
    roots.clear();
  }
};

void SumSample(const SampleColors& now, const SampleColors& before, const Observation* seen,
               CellSums* sums) {
  sums->count += 1;
  for (size_t k = 0; k < now.photos.size(); ++k) {
    PhotoSums own;
    own.photo = now.photos[k];
    own.count = 1;
    own.weight = UnpackWeight(seen[k].weight);
    own.color = now.roots[k];
    own.square = now.roots[k].squaredNorm();
    for (size_t p = 0; p < before.photos.size(); ++p) {
      if (before.photos[p] != own.photo) continue;
      own.steps = 1;
      own.step_square = (now.roots[k] - before.roots[p]).squaredNorm();
    }
    AddTo(&sums->photos, own);
    for (size_t l = 0; l < now.photos.size(); ++l) {
      if (now.photos[l] <= own.photo) continue;
      PairSums pair;
      pair.a = own.photo;
      pair.b = now.photos[l];
      pair.count = 1;
      pair.color_a = now.roots[k];
      pair.color_b = now.roots[l];
      pair.aa = own.square;
      pair.bb = now.roots[l].squaredNorm();
      pair.ab = now.roots[k].dot(now.roots[l]);
      AddTo(&sums->pairs, pair);
    }
  }
}

// Photos that see enough of a cell.
std::vector<PhotoSums> PhotosOf(const CellSums& sums) {
  std::vector<PhotoSums> photos;
  for (const PhotoSums& own : sums.photos) {
    if (own.count >= kFewestSamples && own.count >= kLeastShare * sums.count) photos.push_back(own);
  }
  return photos;
}

// Fills in all but the neighbours. Returns the strength that the cell's choice deserves.
float JudgeCell(const CellSums& sums, CellChoice* cell) {
  const std::vector<PhotoSums> photos = PhotosOf(sums);
  const size_t n = photos.size();
  for (const PhotoSums& photo : photos) cell->candidates.push_back({photo.photo, 0});
  cell->apart.assign(n * n, 1);
  if (n < 2) return 0;
  std::vector<float> variances(n), weights(n);
  float most_weight = 0, finest = 0;
  for (size_t i = 0; i < n; ++i) {
    weights[i] = photos[i].weight / photos[i].count;
    variances[i] = photos[i].Variance();
    most_weight = std::max(most_weight, weights[i]);
    finest = std::max(finest, photos[i].Fineness());
    cell->apart[i * n + i] = 0;
  }
  std::vector<float> unlike(n, 0), others(n, 0);
  float kept = 0, all = 0;
  for (const PairSums& pair : sums.pairs) {
    const int i = cell->NumberOf(pair.a), j = cell->NumberOf(pair.b);
    if (i < 0 || j < 0 || pair.count < kFewestSamples) continue;
    const float covariance = pair.Covariance(), variance = pair.Variance();
    const float likeness = std::clamp(covariance / (variance + kNoise), -1.0f, 1.0f);
    const float apart = (1 - likeness) / 2;
    cell->apart[i * n + j] = cell->apart[j * n + i] = apart;
    unlike[i] += weights[j] * pair.count * apart;
    unlike[j] += weights[i] * pair.count * apart;
    others[i] += weights[j] * pair.count;
    others[j] += weights[i] * pair.count;
    kept += weights[i] * weights[j] * pair.count * std::min(covariance, variance);
    all += weights[i] * weights[j] * pair.count * variance;
  }
  const float typical = Median(&variances);
  cell->texture = typical / (typical + kNoise);
  for (size_t i = 0; i < n; ++i) {
    const float alone = others[i] > 0 ? unlike[i] / others[i] : 1;
    const float blur = 1 - std::sqrt(photos[i].Fineness() / finest);
    cell->candidates[i].cost = cell->texture * (alone + kBlurred * blur) +
                               kFewPixels * (1 - weights[i] / most_weight) +
                               kMissing * (1 - photos[i].count / sums.count);
  }
  // Four times the noise is no detail yet, eight times are.
  const float textured = std::clamp(typical / (4 * kNoise) - 1, 0.0f, 1.0f);
  const float lost = all > 0 ? (kAlike - kept / all) / (kAlike - kUnlike) : 0;
  return textured * std::clamp(lost, 0.0f, 1.0f);
}

float CostOf(const std::vector<CellChoice>& cells, const CellChoice& cell,
             const Candidate& candidate, float smoothness) {
  float seams = 0, count = 0;
  for (const int number : cell.neighbours) {
    const CellChoice& other = cells[number];
    if (other.candidates.empty()) continue;
    ++count;
    const int theirs = other.candidates[other.chosen].photo;
    if (theirs == candidate.photo) continue;
    seams += kChange + (cell.texture * cell.Apart(candidate.photo, theirs) +
                        other.texture * other.Apart(candidate.photo, theirs)) /
                           2;
  }
  return candidate.cost + (count > 0 ? smoothness * seams / count : 0);
}

// Iterated conditional modes (Besag 1986, "On the Statistical Analysis of Dirty Pictures"); the
// smoothness grows, so that large regions form before small ones hold out.
void Choose(std::vector<CellChoice>* cells) {
  for (int round = 0; round <= kRounds; ++round) {
    const float smoothness =
        kSmoothness * std::min(1.0f, 2 * static_cast<float>(round) / static_cast<float>(kRounds));
    for (CellChoice& cell : *cells) {
      float least = std::numeric_limits<float>::infinity();
      int best = 0;
      for (size_t i = 0; i < cell.candidates.size(); ++i) {
        const float cost = CostOf(*cells, cell, cell.candidates[i], round == 0 ? 0 : smoothness);
        if (!(cost < least)) continue;
        least = cost;
        best = static_cast<int>(i);
      }
      cell.chosen = best;
    }
  }
}

}  // namespace

uint64_t PhotoChoice::Key(const Eigen::Vector3i& cell) {
  constexpr int kHalf = 1 << 20;
  uint64_t key = 0;
  for (int k = 0; k < 3; ++k) {
    key = key << 21 | static_cast<uint64_t>(std::clamp(cell[k], -kHalf, kHalf - 1) + kHalf);
  }
  return key;
}

Eigen::Vector3i PhotoChoice::CellOf(const Eigen::Vector3d& x_in_scan) const {
  return InCells(x_in_scan).array().floor().cast<int>();
}

const PhotoChoice::Place& PhotoChoice::Reader::At(const Eigen::Vector3d& x_in_scan) {
  const Eigen::Vector3d place = choice_.InCells(x_in_scan).array() - 0.5;
  const Eigen::Vector3i first = place.array().floor().cast<int>();
  if (first != first_) GoTo(first);
  place_ = {};
  if (!is_any_) return place_;
  const Eigen::Vector3f t = (place - first.cast<double>()).cast<float>();
  float sum = 0;
  for (int k = 0; k < 8; ++k) {
    if (around_[k] == nullptr) continue;
    float share = 1;
    for (int axis = 0; axis < 3; ++axis) share *= (k >> axis & 1) != 0 ? t[axis] : 1 - t[axis];
    sum += share;
    if (around_[k]->photo < 0) continue;
    place_.strength += share * around_[k]->strength;
    place_.photos[place_.count] = around_[k]->photo;
    place_.shares[place_.count++] = share;
  }
  if (sum > 0) place_.strength /= sum;
  return place_;
}

void PhotoChoice::Reader::GoTo(const Eigen::Vector3i& first) {
  first_ = first;
  is_any_ = false;
  for (int k = 0; k < 8; ++k) {
    const Eigen::Vector3i cell = first + Eigen::Vector3i(k & 1, k >> 1 & 1, k >> 2);
    const auto found = choice_.number_.find(Key(cell));
    around_[k] = found == choice_.number_.end() ? nullptr : &choice_.cells_[found->second];
    is_any_ = is_any_ || (around_[k] != nullptr && around_[k]->strength > 0);
  }
}

class PhotoChooser {
 public:
  PhotoChooser(const PhotoPassInput& input, const ObservationStore& store,
               const std::vector<Eigen::Vector3f>& gains, const std::vector<PhotoView>& photos,
               int num_threads)
      : input_(input), store_(store), gains_(gains), photos_(photos), num_threads_(num_threads) {}

  PhotoChoice Make(bool everywhere) {
    const double size = CellSize();
    if (!(size > 0)) return {};
    choice_ = PhotoChoice(Origin(), size);
    SumUp();
    const auto count = static_cast<int>(sums_.cells.size());
    choice_.cells_.resize(count);
    std::vector<CellChoice> cells(count);
    constexpr int kAtOnce = 256;
    ParallelFor(num_threads_, 0, (count + kAtOnce - 1) / kAtOnce, [&](int block) {
      for (int c = block * kAtOnce; c < std::min(count, (block + 1) * kAtOnce); ++c) {
        const float strength = JudgeCell(sums_.sums[c], &cells[c]);
        choice_.cells_[c].strength = everywhere ? 1 : strength;
        sums_.sums[c] = {};
        cells[c].neighbours = Neighbours(sums_.cells[c]);
      }
    });
    Choose(&cells);
    for (int c = 0; c < count; ++c) {
      if (cells[c].candidates.empty()) continue;
      choice_.cells_[c].photo = cells[c].candidates[cells[c].chosen].photo;
    }
    choice_.number_ = std::move(sums_.number);
    return std::move(choice_);
  }

 private:
  Eigen::Vector3d Origin() const { return input_.samples[0].points.origin; }

  // Metres; 0 = no photo sees anything.
  double CellSize() const {
    const size_t stride = std::max<size_t>(1, store_.num_samples() / 50000);
    std::vector<double> pixels;  // of the best photo, metres on the surface
    ForEachSeen([&](const SampleTile& tile, int i, size_t slot) {
      if (slot % stride != 0) return;
      const PhotoView& photo = photos_[store_.Begin(slot)->photo];
      pixels.push_back((photo.Centre() - PointOf(tile, i)).norm() / photo.camera.MeanFocalLength());
    });
    const double size = kPixelsAcross * Median(&pixels);
    if (!(size > 0)) return 0;
    const PhotoChoice cells(Origin(), size);
    std::unordered_set<uint64_t> keys;
    double num_seen = 0;
    uint64_t last = 0;
    ForEachSeen([&](const SampleTile& tile, int i, size_t) {
      ++num_seen;
      const uint64_t key = PhotoChoice::Key(cells.CellOf(PointOf(tile, i)));
      if (key != last) keys.insert(key);
      last = key;
    });
    // The samples of a cell grow with its area.
    const double have = num_seen / static_cast<double>(std::max<size_t>(1, keys.size()));
    const double want = std::max(kSamplesOfCell, num_seen / kMostCells);
    return size * std::sqrt(std::max(1.0, want / have));
  }

  template <typename Body>
  void ForEachSeen(const Body& body) const {
    for (const SampleTile& tile : input_.samples) {
      for (int i = 0; i < tile.points.size(); ++i) {
        const size_t slot = static_cast<size_t>(tile.first_slot) + i;
        if (store_.Count(slot) > 0) body(tile, i, slot);
      }
    }
  }

  // Chunks of tiles side by side, added up in their order.
  void SumUp() {
    constexpr int kTilesOfChunk = 16, kChunksAtOnce = 64;
    const auto num_tiles = static_cast<int>(input_.samples.size());
    const int num_chunks = (num_tiles + kTilesOfChunk - 1) / kTilesOfChunk;
    for (int first = 0; first < num_chunks; first += kChunksAtOnce) {
      const int count = std::min(kChunksAtOnce, num_chunks - first);
      std::vector<SumsOfCells> of_chunk(count);
      ParallelFor(num_threads_, 0, count, [&](int i) {
        const int begin = (first + i) * kTilesOfChunk;
        for (int t = begin; t < std::min(num_tiles, begin + kTilesOfChunk); ++t) {
          SumTile(input_.samples[t], &of_chunk[i]);
        }
      });
      for (const SumsOfCells& some : of_chunk) {
        for (size_t c = 0; c < some.cells.size(); ++c) {
          CellSums& sums = sums_.At(PhotoChoice::Key(some.cells[c]), some.cells[c]);
          sums.count += some.sums[c].count;
          for (const PhotoSums& photo : some.sums[c].photos) AddTo(&sums.photos, photo);
          for (const PairSums& pair : some.sums[c].pairs) AddTo(&sums.pairs, pair);
        }
      }
    }
  }

  void SumTile(const SampleTile& tile, SumsOfCells* result) const {
    SampleColors now, before;
    for (int i = 0; i < tile.points.size(); ++i) {
      std::swap(now, before);
      if (i == 0 || tile.index[i] != tile.index[i - 1] + 1) before.Clear();
      now.Clear();
      const size_t slot = static_cast<size_t>(tile.first_slot) + i;
      const Observation* seen = store_.Begin(slot);
      for (int k = 0; k < store_.Count(slot) && MayGiveDetail(seen[k], seen[0]); ++k) {
        const Eigen::Vector3f color =
            UnpackColor(seen[k].color).cwiseProduct(gains_[seen[k].photo]);
        now.photos.push_back(seen[k].photo);
        now.roots.push_back(color.cwiseMax(0).cwiseSqrt());
      }
      if (now.photos.empty()) continue;
      const Eigen::Vector3i cell = choice_.CellOf(PointOf(tile, i));
      SumSample(now, before, seen, &result->At(PhotoChoice::Key(cell), cell));
    }
  }

  std::vector<int> Neighbours(const Eigen::Vector3i& cell) const {
    std::vector<int> neighbours;
    for (int k = 0; k < 27; ++k) {
      const Eigen::Vector3i step(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
      const auto found = sums_.number.find(PhotoChoice::Key(cell + step));
      if (!step.isZero() && found != sums_.number.end()) neighbours.push_back(found->second);
    }
    return neighbours;
  }

  const PhotoPassInput& input_;
  const ObservationStore& store_;
  const std::vector<Eigen::Vector3f>& gains_;
  const std::vector<PhotoView>& photos_;
  int num_threads_;
  PhotoChoice choice_;
  SumsOfCells sums_;
};

PhotoChoice ChoosePhotos(const PhotoPassInput& input, const ObservationStore& store,
                         const std::vector<Eigen::Vector3f>& gains,
                         const std::vector<PhotoView>& photos, const BlendOptions& blend,
                         int num_threads) {
  if (blend.mode == "average" || blend.detail || input.samples.empty()) return {};
  return PhotoChooser(input, store, gains, photos, num_threads).Make(blend.mode == "select");
}

}  // namespace roomtex
