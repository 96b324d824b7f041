#pragma once
// Gutters: the painted rim around what a texture image shows.

#include <opencv2/core/mat.hpp>

namespace roomtex {

// Paints pixels that are not `known` (0) with their nearest known neighbour's colour, at most
// `reach` pixels away, so that filtering and mipmaps do not draw black into the edges.
void PaintGutters(const cv::Mat1b& known, int reach, cv::Mat* image);

}  // namespace roomtex
