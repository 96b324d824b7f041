#pragma once
// How far a photo is shifted, locally, against what the other photos say of the same surface.

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace roomtex {

// A sample of the surface as a photo should show it.
struct ExpectedPixel {
  Eigen::Vector2f place;  // where, in pixels of the picture searched; upper-left centre (0.5, 0.5)
  float grey;             // what the other photos say
};

struct PatchShift {
  Eigen::Vector2f shift = Eigen::Vector2f::Zero();  // pixels of the picture searched
  // Inverse covariance of the shift, 1/pixels^2; along an edge it is next to nothing. Zero where
  // nothing speaks for any shift: too few pixels, no texture, or none that looks like it.
  Eigen::Matrix2f information = Eigen::Matrix2f::Zero();
  float likeness = 0;  // normalised cross-correlation at that shift

  bool is_found() const { return likeness > 0; }
};

// The shift within +- radius (whole pixels) at which the picture is most like what is expected, by
// normalised cross-correlation, so that exposure and light do not count; between the pixels by
// Gauss-Newton steps (Lucas and Kanade 1981, "An Iterative Image Registration Technique with an
// Application to Stereo Vision"). grey: 8-bit.
PatchShift FindPatchShift(const cv::Mat1b& grey, const std::vector<ExpectedPixel>& expected,
                          int radius);

// Normalised cross-correlation between picture and what is expected, as it stands; none where too
// few of it lie in the picture, or where either is bare.
std::optional<float> PatchLikeness(const cv::Mat1b& grey,
                                   const std::vector<ExpectedPixel>& expected);

// Linear between the four pixels around; negative outside.
float GreyAt(const cv::Mat1b& grey, const Eigen::Vector2f& place);

}  // namespace roomtex
