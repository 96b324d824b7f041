#pragma once
#include <string>

#include <opencv2/core/mat.hpp>

#include "texture/colorize.h"

namespace roomtex {

// 8-bit BGR image of a colour grid, one pixel per cell; cells without a sample are black.
cv::Mat ImageOfGrid(const ColorGrid& grid);

// Paints pixels that are not `known` (0) with their nearest known neighbour's colour, at most
// `reach` pixels away, so that filtering and mipmaps do not draw black into the edges.
void PaintGutters(const cv::Mat1b& known, int reach, cv::Mat* image);

// PNG, written aside and renamed.
void WritePng(const cv::Mat& image, const std::string& path);
// The same as JPEG of quality 95.
void WriteJpeg(const cv::Mat& image, const std::string& path);

}  // namespace roomtex
