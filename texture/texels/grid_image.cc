#include "texture/texels/grid_image.h"

namespace roomtex {

cv::Mat ImageOfGrid(const ColorGrid& grid) {
  cv::Mat3b image(grid.num_rows, grid.num_columns);
  auto pixel = image.begin();
  for (const auto& [r, g, b] : grid.rgb) *pixel++ = {b, g, r};
  return image;
}

}  // namespace roomtex
