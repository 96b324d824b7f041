#include "texture/texels/texture_grid.h"

#include <algorithm>
#include <cmath>

namespace roomtex {

// The sample nearest to a texel, and the next one on the texel's side (-1 or +1), with the share of
// it.
struct ScanTexels::Place {
  int nearest, side;
  float share;  // 0 .. 0.5
};

ScanTexels::Place ScanTexels::PlaceOf(int texel) const {
  const int nearest = texel / scale_;
  const float offset =
      (static_cast<float>(texel % scale_) + 0.5f) / static_cast<float>(scale_) - 0.5f;
  return {nearest, offset < 0 ? -1 : 1, std::abs(offset)};
}

// The sample beside, if it is connected; -1 otherwise. A full turn is closed.
int ScanTexels::Neighbour(int index, int step_columns, int step_rows) const {
  const int columns = scan_.num_columns;
  const int column = index % columns, row = index / columns;
  const auto linked = [this](int i, uint8_t link) { return (surface_.links.bits[i] & link) != 0; };
  if (step_columns != 0) {
    const int other = scan_.Index((column + step_columns + columns) % columns, row);
    return linked(step_columns > 0 ? index : other, GridLinks::kRight) ? other : -1;
  }
  const int other_row = row + step_rows;
  if (other_row < 0 || other_row >= scan_.num_rows) return -1;
  const int other = scan_.Index(column, other_row);
  return linked(step_rows > 0 ? index : other, GridLinks::kDown) ? other : -1;
}

void ScanTexels::SetTexel(size_t texel, const Place& x, const Place& y, TexelBlock* block) const {
  const int index = scan_.Index(x.nearest, y.nearest);
  const Eigen::Vector3d& here = surface_.points[index];
  Eigen::Vector3d point = here;
  Eigen::Vector3f normal = surface_.normals[index];
  const int beside = x.share > 0 ? Neighbour(index, x.side, 0) : -1;
  const int below = y.share > 0 ? Neighbour(index, 0, y.side) : -1;
  const int across = beside >= 0 && below >= 0 ? Neighbour(beside, 0, y.side) : -1;
  if (across >= 0 && Neighbour(below, x.side, 0) == across) {
    const double sx = x.share, sy = y.share;
    point = (1 - sy) * ((1 - sx) * here + sx * surface_.points[beside]) +
            sy * ((1 - sx) * surface_.points[below] + sx * surface_.points[across]);
    const std::vector<Eigen::Vector3f>& normals = surface_.normals;
    normal = (1 - y.share) * ((1 - x.share) * normals[index] + x.share * normals[beside]) +
             y.share * ((1 - x.share) * normals[below] + x.share * normals[across]);
  } else {
    const auto step = [&](int next, int opposite, float share) {
      if (next >= 0) {
        point += share * (surface_.points[next] - here);
        normal += share * (surface_.normals[next] - surface_.normals[index]);
      } else if (opposite >= 0) {
        point += share * (here - surface_.points[opposite]);
      }
    };
    if (x.share > 0) step(beside, Neighbour(index, -x.side, 0), x.share);
    if (y.share > 0) step(below, Neighbour(index, 0, -y.side), y.share);
  }
  block->points[texel] = point;
  block->normals[texel] = normal.isZero() ? normal : normal.normalized();
}

TexelBlock ScanTexels::Rows(int first, int end) const {
  TexelBlock block;
  const size_t count = static_cast<size_t>(num_columns()) * (end - first);
  block.points.assign(count, Scan::MissingPoint());
  block.normals.assign(count, Eigen::Vector3f::Zero());
  block.links.bits.assign(count, 0);
  block.unseen.assign(count, Rgb{0, 0, 0});
  size_t texel = 0;
  for (int r = first; r < end; ++r) {
    const Place y = PlaceOf(r);
    for (int c = 0; c < num_columns(); ++c, ++texel) {
      const Place x = PlaceOf(c);
      const int index = scan_.Index(x.nearest, y.nearest);
      if (!surface_.points[index].allFinite()) continue;
      SetTexel(texel, x, y, &block);
      // Where a missing sample was given a place, its neighbour's colour.
      block.unseen[texel] = colors_.rgb[scan_.IsMissing(index) ? index - scan_.num_columns : index];
      // Runs do not close full turns (grid_runs.h).
      const uint8_t links = surface_.links.bits[index];
      const bool right = (c + 1) % scale_ != 0 || (links & GridLinks::kRight) != 0;
      const bool down = (r + 1) % scale_ != 0 || (links & GridLinks::kDown) != 0;
      block.links.bits[texel] =
          static_cast<uint8_t>((right ? GridLinks::kRight : 0) | (down ? GridLinks::kDown : 0));
    }
  }
  return block;
}

}  // namespace roomtex
