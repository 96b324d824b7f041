#pragma once
// What of a photo is not what the other photos saw there: people, moved chairs, reflections.

#include <vector>

#include <opencv2/core/mat.hpp>

#include "texture/sampling/grid_colors.h"

namespace roomtex {

// What a photo shows of one sample, and what the photos agreed on.
struct ColorPair {
  float x, y;  // in `img`
  Rgb photo, agreed;
};

// 255 = to be used, 0 = something that moved: where the mean colour in a cell of cell_px pixels
// contradicts what was agreed, after one gain per channel for the whole photo, and its neighbours'
// do as well. Where the scan has nothing, nothing is known: 255.
cv::Mat1b MaskOfMovingThings(const std::vector<ColorPair>& pairs, int width, int height,
                             int cell_px);

}  // namespace roomtex
