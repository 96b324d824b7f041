#include "capture/pattern/pattern_features.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <opencv2/features2d.hpp>

#include "core/parallel.h"

namespace roomtex {
namespace {

using Descriptor = std::array<int16_t, 128>;

constexpr int kTogether = 4;  // descriptors compared side by side

int32_t Dot(const Descriptor& a, const Descriptor& b) {
  int32_t sum = 0;
  for (int i = 0; i < 128; ++i) sum += static_cast<int32_t>(a[i]) * b[i];
  return sum;
}

std::vector<int32_t> SquaredLengths(const std::vector<Descriptor>& descriptors) {
  std::vector<int32_t> lengths;
  lengths.reserve(descriptors.size());
  for (const Descriptor& d : descriptors) lengths.push_back(Dot(d, d));
  return lengths;
}

// squared distances of queries[0 .. count-1] to every descriptor of train.
void Distances(const Descriptor* queries, int count, const std::vector<Descriptor>& train,
               const std::vector<int32_t>& train_lengths, std::vector<int32_t>* distances) {
  for (int q = 0; q < count; ++q) distances[q].resize(train.size());
  std::array<int32_t, kTogether> lengths{};
  for (int q = 0; q < count; ++q) lengths[q] = Dot(queries[q], queries[q]);
  for (size_t t = 0; t < train.size(); ++t) {
    for (int q = 0; q < count; ++q) {
      distances[q][t] = lengths[q] + train_lengths[t] - 2 * Dot(queries[q], train[t]);
    }
  }
}

FeatureMatch Best(const std::vector<int32_t>& distances, const std::vector<cv::Point2f>& places,
                  float apart) {
  FeatureMatch match;
  const auto least = std::min_element(distances.begin(), distances.end());
  match.nearest = static_cast<int>(least - distances.begin());
  match.distance = std::sqrt(static_cast<float>(*least));
  const cv::Point2f at = places[match.nearest];
  int32_t rival = std::numeric_limits<int32_t>::max();
  for (size_t t = 0; t < distances.size(); ++t) {
    if (distances[t] >= rival) continue;
    const cv::Point2f step = places[t] - at;
    if (step.dot(step) > apart * apart) rival = distances[t];
  }
  match.rival = rival == std::numeric_limits<int32_t>::max()
                    ? std::numeric_limits<float>::infinity()
                    : std::sqrt(static_cast<float>(rival));
  return match;
}

}  // namespace

int PatternFeatures::CountPlaces() const {
  std::vector<std::array<float, 3>> all;
  for (size_t i = 0; i < places.size(); ++i) all.push_back({places[i].x, places[i].y, sizes[i]});
  std::sort(all.begin(), all.end());
  return static_cast<int>(std::unique(all.begin(), all.end()) - all.begin());
}

PatternFeatures FindFeatures(const cv::Mat1b& image, int limit, double contrast) {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  cv::SIFT::create(limit, 3, contrast)
      ->detectAndCompute(image, cv::noArray(), keypoints, descriptors);
  PatternFeatures features;
  features.descriptors.resize(keypoints.size());
  for (size_t i = 0; i < keypoints.size(); ++i) {
    features.places.push_back(keypoints[i].pt);
    features.sizes.push_back(keypoints[i].size);
    const float* row = descriptors.ptr<float>(static_cast<int>(i));
    for (int k = 0; k < 128; ++k) {
      features.descriptors[i][k] = static_cast<int16_t>(std::lround(row[k]));
    }
  }
  return features;
}

std::vector<FeatureMatch> MatchFeatures(const PatternFeatures& query, const PatternFeatures& train,
                                        float apart, int num_threads) {
  const int num_queries = static_cast<int>(query.places.size());
  std::vector<FeatureMatch> matches(num_queries);
  if (train.places.empty()) return matches;
  const std::vector<int32_t> train_lengths = SquaredLengths(train.descriptors);
  ParallelFor(num_threads, 0, (num_queries + kTogether - 1) / kTogether, [&](int group) {
    const int first = group * kTogether, count = std::min(kTogether, num_queries - first);
    std::vector<int32_t> distances[kTogether];
    Distances(&query.descriptors[first], count, train.descriptors, train_lengths, distances);
    for (int q = 0; q < count; ++q) matches[first + q] = Best(distances[q], train.places, apart);
  });
  return matches;
}

}  // namespace roomtex
