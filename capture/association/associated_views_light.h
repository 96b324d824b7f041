#pragma once
// Light of photos on a logarithmic scale: paint that reflects half as much is the same step in
// every light.

#include <opencv2/core/mat.hpp>

namespace roomtex {

// Logarithm of linear light (sRGB taken), levelled off in the dark where noise would become large.
cv::Mat1f LogLight(const cv::Mat1b& grey);

// 8 bit grey values that say nothing: black or burnt out.
inline bool IsClipped(uchar grey) { return grey <= 4 || grey >= 250; }

// LogLight without what is finer than `fine` and coarser than `coarse` pixels (Gaussian sigmas).
cv::Mat1f BandOf(const cv::Mat1f& light, double fine, double coarse);

}  // namespace roomtex
