#include "texture/sampling/single_holes.h"

#include <array>

#include <Eigen/Geometry>

namespace roomtex {
namespace {

// Grid indices of the neighbours of a cell that is not in the first or last row; columns wrap.
struct Neighbours {
  int left, right, up, down, up_left, up_right, down_left, down_right;

  Neighbours(const Scan& scan, int cell) {
    const int columns = scan.num_columns, row = cell / columns, column = cell % columns;
    const int before = (column + columns - 1) % columns, after = (column + 1) % columns;
    left = scan.Index(before, row);
    right = scan.Index(after, row);
    up = scan.Index(column, row - 1);
    down = scan.Index(column, row + 1);
    up_left = scan.Index(before, row - 1);
    up_right = scan.Index(after, row - 1);
    down_left = scan.Index(before, row + 1);
    down_right = scan.Index(after, row + 1);
  }
};

}  // namespace

std::vector<int> FindSingleHoles(const Scan& scan, const GridLinks& links) {
  std::vector<int> holes;
  if (!scan.organised || scan.num_columns < 3) return holes;
  const auto linked = [&links](int cell, uint8_t link) { return (links.bits[cell] & link) != 0; };
  for (int cell = scan.num_columns; cell < scan.num_columns * (scan.num_rows - 1); ++cell) {
    if (!scan.IsMissing(cell)) continue;
    const Neighbours n(scan, cell);
    const bool ring = linked(n.up_left, GridLinks::kRight) && linked(n.up, GridLinks::kRight) &&
                      linked(n.down_left, GridLinks::kRight) && linked(n.down, GridLinks::kRight) &&
                      linked(n.up_left, GridLinks::kDown) && linked(n.left, GridLinks::kDown) &&
                      linked(n.up_right, GridLinks::kDown) && linked(n.right, GridLinks::kDown);
    if (ring) holes.push_back(cell);
  }
  return holes;
}

void AppendTrianglesOverHoles(const Scan& scan, const std::vector<int>& holes,
                              std::vector<Triangle>* triangles) {
  for (const int hole : holes) {
    const Neighbours n(scan, hole);
    for (Triangle t : {Triangle{n.up, n.left, n.down}, Triangle{n.up, n.down, n.right}}) {
      const Eigen::Vector3d &a = scan.points[t[0]], &b = scan.points[t[1]], &c = scan.points[t[2]];
      if ((b - a).cross(c - a).dot(scan.Station() - a) < 0) std::swap(t[1], t[2]);
      triangles->push_back(t);
    }
  }
}

void FillHoles(const Scan& scan, const std::vector<int>& holes, SmoothedScan* surface) {
  for (const int hole : holes) {
    const Neighbours n(scan, hole);
    const std::array<int, 4> beside{n.left, n.right, n.up, n.down};
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    for (const int i : beside) {
      point += 0.25 * surface->points[i];
      normal += surface->normals[i];
    }
    surface->points[hole] = point;
    surface->normals[hole] = normal.isZero() ? normal : Eigen::Vector3f(normal.normalized());
    surface->links.bits[hole] = GridLinks::kRight | GridLinks::kDown;
    surface->links.bits[n.left] |= GridLinks::kRight;
    surface->links.bits[n.up] |= GridLinks::kDown;
  }
}

}  // namespace roomtex
