#pragma once
// SIFT features (Lowe 2004; thesis 5.3) of patterns and of photos of them, and their matching.
// Exact, and the same for every number of threads.

#include <array>
#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

namespace roomtex {

struct PatternFeatures {
  std::vector<cv::Point2f> places;  // OpenCV's pixels; a place with two orientations stands twice
  std::vector<float> sizes;         // diameter, pixels
  std::vector<std::array<int16_t, 128>> descriptors;
  // Every place counted once.
  int CountPlaces() const;
};

// OpenCV's SIFT. limit: the strongest ones only, 0 = all. contrast: the least contrast of a
// feature; 0.04 is OpenCV's default, a photo of a pattern wants COLMAP's 0.02.
PatternFeatures FindFeatures(const cv::Mat1b& image, int limit = 0, double contrast = 0.04);

struct FeatureMatch {
  int nearest = -1;    // feature of `train`
  float distance = 0;  // of the descriptors
  // The smallest distance among the features of `train` that lie farther than `apart` pixels from
  // the nearest one: two orientations of one place are no rivals. Infinity if there are none.
  float rival = 0;
  float Ratio() const { return rival > 0 ? distance / rival : 1.0f; }
};
// One per feature of `query`.
std::vector<FeatureMatch> MatchFeatures(const PatternFeatures& query, const PatternFeatures& train,
                                        float apart, int num_threads);

}  // namespace roomtex
