#pragma once
// Coloured scans cut into parts with one texture image each, as files of meshes want them.

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/scan.h"
#include "texture/texels/colored_scan.h"

namespace roomtex {

struct TexturedPart {
  std::vector<int> vertices;        // indices into scan.points
  std::vector<Eigen::Vector2f> uv;  // per vertex, glTF's: 0, 0 = upper-left corner of the image
  std::vector<uint32_t> corners;    // three per triangle, into vertices
  // The image: a page of the atlas, or a rectangle of the grid of texels, in texels. It may begin
  // before the grid and end behind it.
  int page = -1;
  int first_column = 0, first_row = 0, width = 0, height = 0;
  int texels_per_sample = 1;  // of a grid
};

// Parts in grid order, or page by page; none for a scan that has neither a grid nor an atlas. A
// grid wider or higher than max_texture_size texels is cut between samples: every triangle lies in
// one part, and the images overlap by 16 samples, in steps of 16 texels, so that neighbouring parts
// look alike on both sides of the cut also in the first four mipmaps.
std::vector<TexturedPart> MakeTexturedParts(const Scan& scan, const ColoredScan& colored,
                                            int max_texture_size);

// 8-bit BGR. Texels without a sample are painted like the nearest one with, so that filtering and
// mipmaps do not draw black into the edges.
cv::Mat PartImage(const Scan& scan, const ColoredScan& colored, const TexturedPart& part);

}  // namespace roomtex
