#include "texture/texels/rectangle_packing.h"

#include <algorithm>
#include <numeric>

namespace roomtex {
namespace {

// The upper outline of what is packed: pieces of constant height from left to right.
class Skyline {
 public:
  explicit Skyline(int size) : size_(size), pieces_{{0, size, 0}} {}

  // Places a rectangle; false if it does not fit.
  bool Place(int width, int height, int* x, int* y) {
    int best = -1, best_y = 0;
    for (size_t i = 0; i < pieces_.size(); ++i) {
      const int at = HeightOver(i, width);
      if (at < 0 || at + height > size_) continue;
      if (best < 0 || at < best_y) {
        best = static_cast<int>(i);
        best_y = at;
      }
    }
    if (best < 0) return false;
    *x = pieces_[best].x;
    *y = best_y;
    Raise(best, width, best_y + height);
    return true;
  }

 private:
  struct Piece {
    int x, width, y;
  };

  // Height on which a rectangle rests that begins with piece i; -1 = it reaches over the page.
  int HeightOver(size_t i, int width) const {
    if (pieces_[i].x + width > size_) return -1;
    int height = 0;
    for (int left = width; left > 0; ++i) {
      height = std::max(height, pieces_[i].y);
      left -= pieces_[i].width;
    }
    return height;
  }

  void Raise(size_t i, int width, int y) {
    const Piece raised{pieces_[i].x, width, y};
    int left = width;
    size_t end = i;
    while (end < pieces_.size() && left >= pieces_[end].width) left -= pieces_[end++].width;
    if (left > 0) {
      pieces_[end].x += left;
      pieces_[end].width -= left;
    }
    pieces_.erase(pieces_.begin() + static_cast<long>(i), pieces_.begin() + static_cast<long>(end));
    pieces_.insert(pieces_.begin() + static_cast<long>(i), raised);
  }

  int size_;
  std::vector<Piece> pieces_;
};

}  // namespace

Packing PackRectangles(const std::vector<std::array<int, 2>>& sizes, int page_size) {
  Packing packing;
  packing.places.resize(sizes.size());
  std::vector<int> order(sizes.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return sizes[a][1] != sizes[b][1] ? sizes[a][1] > sizes[b][1] : sizes[a][0] > sizes[b][0];
  });
  constexpr size_t kOpenPages = 4;  // earlier ones are as good as full
  std::vector<Skyline> pages;
  for (const int i : order) {
    PackedRectangle& place = packing.places[i];
    bool placed = false;
    const size_t first = pages.size() > kOpenPages ? pages.size() - kOpenPages : 0;
    for (size_t page = first; page < pages.size() && !placed; ++page) {
      placed = pages[page].Place(sizes[i][0], sizes[i][1], &place.x, &place.y);
      place.page = static_cast<int>(page);
    }
    if (placed) continue;
    pages.emplace_back(page_size);
    place.page = static_cast<int>(pages.size()) - 1;
    pages.back().Place(sizes[i][0], sizes[i][1], &place.x, &place.y);
  }
  packing.num_pages = static_cast<int>(pages.size());
  return packing;
}

}  // namespace roomtex
