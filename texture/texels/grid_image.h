#pragma once
// A grid of colours as a picture.

#include <opencv2/core/mat.hpp>

#include "texture/sampling/grid_colors.h"

namespace roomtex {

// 8-bit BGR image of a colour grid, one pixel per cell; cells without a sample are black.
cv::Mat ImageOfGrid(const ColorGrid& grid);

}  // namespace roomtex
