#include "colmap_ext/feature_cache.h"

#include <algorithm>
#include <iterator>
#include <numeric>

#include "colmap_ext/photo_signature.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr int kMaxFeaturesInMemory = 1500000;
constexpr int kNumWords = 64;
constexpr int kMaxWordPhotos = 500, kDescriptorsPerWordPhoto = 100;
constexpr int kMaxAxesPhotos = 512, kMaxDimensions = 256;
constexpr int kPhotosAtATime = 64;

// At most `count` of 0 .. size - 1, evenly spaced.
std::vector<int> EvenChoice(size_t size, int count) {
  const size_t number = std::min(size, static_cast<size_t>(count));
  std::vector<int> chosen(number);
  for (size_t i = 0; i < number; ++i) chosen[i] = static_cast<int>(i * size / number);
  return chosen;
}

std::vector<int> EvenChoiceOf(const std::vector<int>& photos, int count) {
  std::vector<int> chosen = EvenChoice(photos.size(), count);
  for (int& photo : chosen) photo = photos[static_cast<size_t>(photo)];
  return chosen;
}

// Visual words of an even choice of these photos and of their descriptors.
Eigen::MatrixXf LearnWordsOf(const std::vector<int>& with_features, FeatureCache* features,
                             uint64_t seed, Progress* progress) {
  const std::vector<int> photos = EvenChoiceOf(with_features, kMaxWordPhotos);
  progress->Stage("read features", static_cast<int>(photos.size()));
  std::vector<uint8_t> sample;
  for (const int photo : photos) {
    features->Load({photo});
    const std::vector<uint8_t>& bytes = features->At(photo).descriptors;
    for (const int row : EvenChoice(bytes.size() / kSiftSize, kDescriptorsPerWordPhoto)) {
      const auto first = bytes.begin() + static_cast<std::ptrdiff_t>(row) * kSiftSize;
      sample.insert(sample.end(), first, first + kSiftSize);
    }
    progress->Tick();
  }
  return LearnWords(UnitDescriptors(sample), kNumWords, seed);
}

// use(position in `photos`, VLAD), by several threads; blocks of photos in memory.
template <typename Use>
void ForEachVlad(const std::vector<int>& photos, const Eigen::MatrixXf& words, int num_threads,
                 FeatureCache* features, Progress* progress, const Use& use) {
  for (size_t first = 0; first < photos.size(); first += kPhotosAtATime) {
    const size_t count = std::min<size_t>(kPhotosAtATime, photos.size() - first);
    const auto begin = photos.begin() + static_cast<std::ptrdiff_t>(first);
    features->Load({begin, begin + static_cast<std::ptrdiff_t>(count)});
    ParallelFor(num_threads, 0, static_cast<int>(count), [&](int i) {
      const size_t at = first + static_cast<size_t>(i);
      use(static_cast<Eigen::Index>(at),
          AggregateDescriptors(UnitDescriptors(features->At(photos[at]).descriptors), words));
    });
    for (size_t i = 0; i < count; ++i) progress->Tick();
  }
}

}  // namespace

FeatureCache::FeatureCache(const Database& database, int num_features)
    : database_(&database), num_features_(num_features), cameras_(database.ReadCameras()) {
  for (const auto& [image_id, image] : database.ReadImages()) images_.push_back(image);
}

size_t FeatureCache::max_photos() const {
  return static_cast<size_t>(kMaxFeaturesInMemory / num_features_);
}

std::vector<int> FeatureCache::PhotosWithFeatures() const {
  const std::map<uint32_t, size_t> counts = database_->CountKeypoints();
  std::vector<int> photos;
  for (int photo = 0; photo < num_photos(); ++photo) {
    const auto count = counts.find(images_[static_cast<size_t>(photo)].image_id);
    if (count != counts.end() && count->second > 0) photos.push_back(photo);
  }
  return photos;
}

void FeatureCache::Load(const std::set<int>& photos) {
  if (features_.size() + photos.size() > max_photos()) {
    for (auto it = features_.begin(); it != features_.end();) {
      it = photos.count(it->first) > 0 ? std::next(it) : features_.erase(it);
    }
  }
  for (const int photo : photos) {
    if (features_.count(photo) > 0) continue;
    const DatabaseImage& image = images_[static_cast<size_t>(photo)];
    features_[photo] =
        UndistortFeatures(database_->ReadLargestFeatures(image.image_id, num_features_),
                          cameras_.at(image.camera_id));
  }
}

Eigen::MatrixXf SignPhotos(FeatureCache* features, int num_threads, uint64_t random_seed,
                           Progress* progress) {
  // Every other photo may be of a bare wall: an even choice of all could be of those alone.
  const std::vector<int> with_features = features->PhotosWithFeatures();
  if (with_features.empty()) return Eigen::MatrixXf::Zero(1, features->num_photos());
  const Eigen::MatrixXf words = LearnWordsOf(with_features, features, random_seed, progress);
  const std::vector<int> for_axes = EvenChoiceOf(with_features, kMaxAxesPhotos);
  progress->Stage("signatures", static_cast<int>(for_axes.size()) + features->num_photos());
  Eigen::MatrixXf vlads(words.size(), static_cast<Eigen::Index>(for_axes.size()));
  ForEachVlad(for_axes, words, num_threads, features, progress,
              [&](Eigen::Index at, const Eigen::VectorXf& vlad) { vlads.col(at) = vlad; });
  const SignatureAxes axes = LearnAxes(vlads, kMaxDimensions);
  vlads.resize(0, 0);
  Eigen::MatrixXf signatures(axes.axes.rows(), features->num_photos());
  std::vector<int> all(static_cast<size_t>(features->num_photos()));
  std::iota(all.begin(), all.end(), 0);
  ForEachVlad(all, words, num_threads, features, progress,
              [&](Eigen::Index at, const Eigen::VectorXf& vlad) {
                signatures.col(at) = axes.Shorten(vlad);
              });
  return signatures;
}

}  // namespace roomtex
