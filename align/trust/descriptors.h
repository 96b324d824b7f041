#pragma once
// Descriptors of features, and which of many are nearest to each. In whole numbers: every machine
// finds the same distances, and SSE2 multiplies eight at once (a sixth of the time of
// cv::BFMatcher's, which takes floats one pair after the other).

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace roomtex {

// A row of 128 (RootSift) or 64 (FoldGradients) each, of this length or zero.
using Descriptors = cv::Mat1s;
constexpr int kDescriptorLength = 1 << 14;

// RootSIFT (Arandjelovic and Zisserman 2012, "Three things everyone should know to improve object
// retrieval") of SIFT as OpenCV has it: roots of the shares of their sum.
Descriptors RootSift(const cv::Mat1f& sift);
// Opposite gradients as one: half of the eight directions of each cell.
Descriptors FoldGradients(const Descriptors& root_sift);

struct NearDescriptor {
  int row = 0;         // of those that are searched
  float distance = 0;  // 1 = the length of a descriptor
};
// Distance of rows a and b, of as many columns.
float DescriptorDistance(const Descriptors& of, int a, const Descriptors& among, int b);
// Of each row of `of` the `count` nearest of `among` (all, if these are fewer), the nearest first;
// of several at the same distance the first ones.
std::vector<std::vector<NearDescriptor>> FindNearestDescriptors(const Descriptors& of,
                                                                const Descriptors& among,
                                                                int count);

}  // namespace roomtex
