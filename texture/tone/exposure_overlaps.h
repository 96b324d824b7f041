#pragma once
// How the brightness of photos compares where they see the same samples.

#include <vector>

#include <Eigen/Core>

#include "texture/tone/exposure_samples.h"

namespace roomtex {

// The same samples seen by two photos, well exposed in both.
struct Overlap {
  int photo_a = 0, photo_b = 0;
  double num_samples = 0;  // counted by trust
  // Weighted median over the samples of log(light in a / light in b), per channel r, g, b, and of
  // their sum.
  Eigen::Vector4f log_ratio = Eigen::Vector4f::Zero();
  float spread = 0;  // of the sum's: median absolute deviation * 1.4826
};

// Pairs of photos that share at least min_samples samples, ordered by photo numbers.
std::vector<Overlap> FindOverlaps(const ExposureSamples& samples, double min_samples = 30);

}  // namespace roomtex
