#pragma once
// The pattern that a projector throws onto bare walls, so that photos of them hold features (thesis
// 5.1.2): a detailed image, its intensity inverted, cut into blocks, the blocks shuffled.

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace roomtex {

class OptionFields;

struct PatternOptions {
  // Pixels of the projector. The pattern must be shown pixel by pixel, not scaled.
  int width = 1920, height = 1080;
  // The image is cut into blocks x blocks of them (thesis: 16 x 16).
  int blocks = 16;
  // A projector each: patterns of different seeds hold no features in common.
  int random_seed = 0;
  // Mean grey value, 1 = white; larger = more light, less contrast. 0.65 sends out 45 % of the
  // light of a white picture.
  double brightness = 0.65;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// The pattern made of a built-in image: shapes of 5 pixels up to a fifth of its height, at every
// scale about as many as fit, so that cameras near and far find features. Bytes depend on the
// options only. Throws UsageError for Problems().
cv::Mat1b MakePattern(const PatternOptions& options);

// The pattern made of a photo (8-bit BGR or grey, of any size: scaled to cover the projector's
// picture, the overhang cut off evenly). What the photo shows would be the same for every seed, so
// half of the detail comes from the built-in image.
cv::Mat1b MakePattern(const cv::Mat& photo, const PatternOptions& options);

}  // namespace roomtex
