#include "texture/texture_grid.h"

#include <algorithm>
#include <cmath>

namespace roomtex {
namespace {

// The sample nearest to a texel, and the next one on the texel's side (-1 or +1), with the share of
// it.
struct Place {
  int nearest, side;
  float share;  // 0 .. 0.5
};

Place PlaceOf(int texel, int scale) {
  const int nearest = texel / scale;
  const float offset =
      (static_cast<float>(texel % scale) + 0.5f) / static_cast<float>(scale) - 0.5f;
  return {nearest, offset < 0 ? -1 : 1, std::abs(offset)};
}

bool IsLinkedRight(const Scan& scan, const GridLinks& links, int column, int row) {
  return column >= 0 && column + 1 < scan.num_columns &&
         (links.bits[scan.Index(column, row)] & GridLinks::kRight) != 0;
}
bool IsLinkedDown(const Scan& scan, const GridLinks& links, int column, int row) {
  return row >= 0 && row + 1 < scan.num_rows &&
         (links.bits[scan.Index(column, row)] & GridLinks::kDown) != 0;
}

}  // namespace

TextureGrid MakeTextureGrid(const Scan& scan, const ScanSurface& surface, int scale) {
  TextureGrid grid;
  grid.num_columns = scan.num_columns * scale;
  grid.num_rows = scan.num_rows * scale;
  grid.points.assign(static_cast<size_t>(grid.num_columns) * grid.num_rows, Scan::MissingPoint());
  grid.normals.assign(grid.points.size(), Eigen::Vector3f::Zero());
  size_t texel = 0;
  for (int r = 0; r < grid.num_rows; ++r) {
    const Place y = PlaceOf(r, scale);
    for (int c = 0; c < grid.num_columns; ++c, ++texel) {
      const Place x = PlaceOf(c, scale);
      const int index = scan.Index(x.nearest, y.nearest);
      if (scan.IsMissing(index)) continue;
      const bool beside =
          IsLinkedRight(scan, surface.links, std::min(x.nearest, x.nearest + x.side), y.nearest);
      const bool below =
          IsLinkedDown(scan, surface.links, x.nearest, std::min(y.nearest, y.nearest + y.side));
      const float sx = beside ? x.share : 0, sy = below ? y.share : 0;
      Eigen::Vector3d point = (1 - sx - sy) * surface.points[index];
      Eigen::Vector3f normal = (1 - sx - sy) * surface.normals[index];
      const auto add = [&](int column, int row, float share) {
        point += share * surface.points[scan.Index(column, row)];
        normal += share * surface.normals[scan.Index(column, row)];
      };
      if (sx > 0) add(x.nearest + x.side, y.nearest, sx);
      if (sy > 0) add(x.nearest, y.nearest + y.side, sy);
      grid.points[texel] = point;
      grid.normals[texel] = normal.isZero() ? normal : normal.normalized();
    }
  }
  return grid;
}

GridLinks TextureLinks(const Scan& scan, const ScanSurface& surface, int scale) {
  GridLinks links;
  const int columns = scan.num_columns * scale, rows = scan.num_rows * scale;
  links.bits.assign(static_cast<size_t>(columns) * rows, 0);
  size_t texel = 0;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c, ++texel) {
      const int column = c / scale, row = r / scale;
      if (scan.IsMissing(scan.Index(column, row))) continue;
      const bool right = (c + 1) % scale != 0 || IsLinkedRight(scan, surface.links, column, row);
      const bool down = (r + 1) % scale != 0 || IsLinkedDown(scan, surface.links, column, row);
      links.bits[texel] = (right ? GridLinks::kRight : 0) | (down ? GridLinks::kDown : 0);
    }
  }
  return links;
}

std::vector<uint8_t> EnlargeGrey(const Scan& scan, const std::vector<uint8_t>& grey, int scale) {
  std::vector<uint8_t> large;
  large.reserve(grey.size() * scale * scale);
  for (int r = 0; r < scan.num_rows * scale; ++r) {
    for (int c = 0; c < scan.num_columns * scale; ++c) {
      large.push_back(grey[scan.Index(c / scale, r / scale)]);
    }
  }
  return large;
}

}  // namespace roomtex
