#include "capture/pattern/pattern_quality.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "capture/pattern/pattern_steps.h"
#include "core/photo.h"
#include "core/random_stream.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr int kSample = 6000;
constexpr double kRatio = 0.8;  // Lowe 2004; COLMAP's default too
constexpr float kSamePlace = 2.0f;

// Evenly over the features, which OpenCV orders by place.
PatternFeatures Sample(const PatternFeatures& features) {
  PatternFeatures sample;
  const size_t count = features.places.size(), wanted = std::min<size_t>(count, kSample);
  for (size_t k = 0; k < wanted; ++k) {
    const size_t i = k * count / wanted;
    sample.places.push_back(features.places[i]);
    sample.sizes.push_back(features.sizes[i]);
    sample.descriptors.push_back(features.descriptors[i]);
  }
  return sample;
}

cv::Mat1b Photographed(const cv::Mat1b& pattern) {
  cv::Mat1f seen(pattern);
  cv::GaussianBlur(seen, seen, {}, 1);
  seen = 0.6 * seen + 40;
  RandomStream random(7);
  for (float& value : seen) value += static_cast<float>(2 * random.Gaussian());
  return cv::Mat1b(seen);
}

}  // namespace

PatternQuality MeasurePattern(const cv::Mat1b& pattern, const PatternFeatures& features, int blocks,
                              int num_threads) {
  PatternQuality quality;
  quality.features = features.CountPlaces();
  quality.brightness = cv::mean(pattern)[0] / 255;
  double light = 0;
  for (const uchar grey : pattern) light += LinearFromSrgbByte()[grey];
  quality.light = light / static_cast<double>(pattern.total());
  quality.similar_neighbours = CountSimilarNeighbours(pattern, blocks);

  const PatternFeatures sample = Sample(features);
  if (sample.places.empty()) return quality;
  const PatternFeatures seen = FindFeatures(Photographed(pattern), 0, 0.02);
  const auto matches = MatchFeatures(sample, seen, 2 * kSamePlace, num_threads);
  std::vector<double> ratios;
  int distinct = 0;
  for (size_t i = 0; i < matches.size(); ++i) {
    double ratio = 1;
    if (matches[i].nearest >= 0) {
      const cv::Point2f step = seen.places[matches[i].nearest] - sample.places[i];
      if (std::hypot(step.x, step.y) < kSamePlace) ratio = matches[i].Ratio();
    }
    ratios.push_back(ratio);
    distinct += ratio < kRatio;
  }
  quality.ratio_median = Median(&ratios);
  quality.distinct_share = static_cast<double>(distinct) / static_cast<double>(matches.size());
  quality.num_distinct = static_cast<int>(quality.distinct_share * quality.features);
  return quality;
}

int WantedFeatures(cv::Size size) {
  const double share = static_cast<double>(size.area()) / (1920.0 * 1080.0);
  return static_cast<int>(10000 * std::min(1.0, share));
}

double MatchedShare(const PatternFeatures& pattern, const PatternFeatures& other, int num_threads) {
  const PatternFeatures sample = Sample(pattern);
  if (sample.places.empty() || other.places.empty()) return 0;
  int matched = 0;
  for (const FeatureMatch& match : MatchFeatures(sample, other, 0, num_threads)) {
    matched += match.Ratio() < kRatio;
  }
  return static_cast<double>(matched) / static_cast<double>(sample.places.size());
}

}  // namespace roomtex
