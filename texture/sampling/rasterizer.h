#pragma once
// Draws triangles into a raster of inverse depths (z-buffer, Catmull 1974; small triangles by edge
// functions, Pineda 1988, "A Parallel Algorithm for Polygon Rasterization").

#include <opencv2/core/mat.hpp>

namespace roomtex {

struct RasterVertex {
  float x, y;  // raster position, the upper-left pixel's centre at (0.5, 0.5)
  float w;     // inverse depth, > 0
};

// Every pixel whose centre lies in the triangle or on its border keeps the larger inverse depth of
// its own and the triangle's, which is linear in the raster (perspective-correct). Parts outside
// are cut off.
void DrawTriangle(const RasterVertex& a, const RasterVertex& b, const RasterVertex& c,
                  cv::Mat1f* inverse_depth);

}  // namespace roomtex
