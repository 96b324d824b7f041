#pragma once
// What a pattern is worth, measured on its pixels.

#include <opencv2/core/mat.hpp>

#include "capture/pattern/pattern_features.h"

namespace roomtex {

struct PatternQuality {
  int features = 0;  // places of SIFT features
  // Features that a camera would find again: in the pattern as photographed (a blur of one pixel,
  // 60 % of the contrast, noise of 2 grey levels) the nearest descriptor lies at the feature's
  // place, and nearer than 0.8 of the nearest one elsewhere. Taken from a sample of 6000.
  int num_distinct = 0;
  double distinct_share = 0;   // of the features
  double ratio_median = 1;     // distance of the descriptor at the place over the nearest elsewhere
  double brightness = 0;       // mean grey value, 1 = white
  double light = 0;            // light that leaves the projector, 1 = white picture
  int similar_neighbours = 0;  // pairs of neighbouring blocks that look alike (pattern_steps.h)
};

// features: FindFeatures(pattern).
PatternQuality MeasurePattern(const cv::Mat1b& pattern, const PatternFeatures& features, int blocks,
                              int num_threads);

// Distinct features that a pattern of this size should have: 10 000 at 1920 x 1080 and more (thesis
// 5.1.2), fewer in proportion to the area below.
int WantedFeatures(cv::Size size);
// Least brightness: darker patterns do not light the room.
inline constexpr double kLeastBrightness = 0.5;

// Share of the features of one pattern (a sample of 6000) that find a partner in the other one: the
// ratio of nearest to second nearest is below 0.8.
double MatchedShare(const PatternFeatures& pattern, const PatternFeatures& other, int num_threads);
// Beyond this share two patterns are confused.
inline constexpr double kMostMatchedShare = 0.01;

}  // namespace roomtex
