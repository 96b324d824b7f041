#include "texture/sampling/grid_links.h"

#include <algorithm>

namespace roomtex {

GridLinks FindGridLinks(const Scan& scan, const std::vector<Triangle>& triangles) {
  GridLinks links;
  links.bits.assign(scan.points.size(), 0);
  if (!scan.organised) return links;
  const int columns = scan.num_columns;
  for (const Triangle& t : triangles) {
    for (int k = 0; k < 3; ++k) {
      const int a = std::min(t[k], t[(k + 1) % 3]), b = std::max(t[k], t[(k + 1) % 3]);
      if (b - a == columns) {
        links.bits[a] |= GridLinks::kDown;
      } else if (a / columns == b / columns) {
        if (b - a == 1) links.bits[a] |= GridLinks::kRight;
        if (b - a == columns - 1 && columns > 2) links.bits[b] |= GridLinks::kRight;  // closed turn
      }
    }
  }
  return links;
}

}  // namespace roomtex
