#pragma once
// The steps of pattern.h, for its tests.

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace roomtex {

// The built-in detailed image: shapes of random grey lying over each other, coarse to fine, of
// `finest` pixels up to a fifth of the height: the "dead leaves" of image statistics (Lee, Mumford
// and Huang 2001). The same bytes for the same arguments.
cv::Mat1b DrawDetail(int width, int height, double finest, uint64_t seed);

// Grey values by rank: the darkest pixel becomes 0, the brightest 255, and between them each grey
// value is as frequent as it takes for the mean `brightness` (0..1). Pixels of equal value are
// ordered by a smoothed copy of the image.
cv::Mat1b SpreadGrey(const cv::Mat1w& image, double brightness);

// Two blocks beside or above each other are alike when the lines of pixels that meet, or the blocks
// as a whole, differ by less than kLeastStep grey values on average, or follow each other with a
// correlation above kMostCorrelation. Blocks are exchanged until no neighbours are alike, or too
// few of them differ.
inline constexpr double kLeastStep = 16;
inline constexpr double kMostCorrelation = 0.6;
// A shuffle of blocks x blocks tiles: the block at place i (row by row) of the result is block
// order[i] of the image. Width and height of the image are multiples of `blocks`; visible: what
// will be seen of it, from the upper left corner.
std::vector<int> ShuffleBlocks(const cv::Mat1b& image, int blocks, cv::Size visible, uint64_t seed);
cv::Mat1b ApplyShuffle(const cv::Mat1b& image, int blocks, const std::vector<int>& order);
// Neighbours in a pattern that are alike. Its blocks have width / blocks pixels, rounded up, and so
// on; the last column and row may be cut off.
int CountSimilarNeighbours(const cv::Mat1b& pattern, int blocks);

}  // namespace roomtex
