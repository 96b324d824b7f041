#pragma once
// Rectangles side by side on as few pages as a simple rule finds (Jylanki 2010, "A Thousand Ways to
// Pack the Bin").

#include <array>
#include <vector>

namespace roomtex {

struct PackedRectangle {
  int page = 0, x = 0, y = 0;
};
struct Packing {
  int num_pages = 0;
  std::vector<PackedRectangle> places;  // per rectangle
};

// Skyline packing: each rectangle, the highest first, goes where its lower edge comes to lie
// lowest. sizes: width and height, each at most page_size. Deterministic.
Packing PackRectangles(const std::vector<std::array<int, 2>>& sizes, int page_size);

}  // namespace roomtex
