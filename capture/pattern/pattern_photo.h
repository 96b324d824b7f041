#pragma once
// A photo of the projected pattern: can a camera use it?

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "capture/pattern/pattern_features.h"

namespace roomtex {

// A wall (or floor, or side of a cupboard) that carries part of the pattern.
struct PatternPlane {
  cv::Matx33d photo_from_pattern;  // homography, OpenCV's pixels of the photo and of the pattern
  int matched = 0;                 // features that obey it
  double photo_pixels = 0;         // photo pixels per pattern pixel, in the middle of the matches
};

struct PatternPhotoCheck {
  int features = 0;  // found in the photo, at most 8192 as COLMAP
  int matched = 0;   // of them, whose partner in the pattern is nearer than 0.8 of the next one
  std::vector<PatternPlane> planes;  // largest first
  int on_planes = 0;                 // matched features that a plane explains: the ones to trust
  // Over the largest plane; NaN without one.
  double blur_px = 0;          // Gaussian sigma in the photo's pixels, of camera and projector
  double blur_pattern_px = 0;  // the same in the pattern's pixels
  double contrast = 0;  // of the photo over that of the pattern, 1 = all light is the pattern's
  // Over the largest plane, or the whole photo without one.
  double over_exposed = 0;  // share of pixels above 250
  double mean_grey = 0;     // 0..255

  bool usable = false;
  std::vector<std::string> verdict;  // sentences: what is well, what is not, what to do
};

// photo: 8-bit BGR or grey, of any size. pattern_features: FindFeatures(pattern).
PatternPhotoCheck CheckPatternPhoto(const cv::Mat& photo, const cv::Mat1b& pattern,
                                    const PatternFeatures& pattern_features, int num_threads);

}  // namespace roomtex
