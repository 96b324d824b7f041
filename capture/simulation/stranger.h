#pragma once
// Somebody who walks through a photo.

#include <cstdint>

#include <opencv2/core/mat.hpp>

namespace roomtex {

// Paints a standing person over a part of the photo (8-bit BGR): about a fifth of its width, from
// the lower border up. The place and the clothes follow from the seed.
void DrawStranger(uint64_t seed, cv::Mat* photo);

}  // namespace roomtex
