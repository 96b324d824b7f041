#include "texture/sampling/mesh_tiles.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace roomtex {
namespace {

constexpr int kTileEdge = 32;               // quads of the grid
constexpr size_t kTrianglesPerTile = 2048;  // of a mesh without a grid

// Morton code of a point in a box: 10 bits an axis.
uint32_t MortonCode(const Eigen::Vector3d& point, const Bounds& bounds) {
  const double size = std::max(1e-12, (bounds.max - bounds.min).maxCoeff());
  uint32_t code = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double place = (point[axis] - bounds.min[axis]) / size * 1023;
    const auto cell = static_cast<uint32_t>(std::clamp(place, 0.0, 1023.0));
    for (int bit = 0; bit < 10; ++bit) code |= ((cell >> bit) & 1u) << (3 * bit + axis);
  }
  return code;
}

// Orders the numbers 0 .. keys.size() - 1 by key, equal keys in order.
std::vector<int> OrderByKey(const std::vector<uint32_t>& keys) {
  std::vector<int> order(keys.size());
  const uint32_t max_key = keys.empty() ? 0 : *std::max_element(keys.begin(), keys.end());
  if (max_key < keys.size() + 4096) {  // few keys: count them
    std::vector<int> next(max_key + 2, 0);
    for (uint32_t key : keys) ++next[key + 1];
    for (uint32_t k = 0; k <= max_key; ++k) next[k + 1] += next[k];
    for (size_t i = 0; i < keys.size(); ++i) order[next[keys[i]]++] = static_cast<int>(i);
    return order;
  }
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return keys[a] < keys[b]; });
  return order;
}

// Gives the corners of one tile's triangles local numbers.
class TileBuilder {
 public:
  explicit TileBuilder(const std::vector<Eigen::Vector3d>& points)
      : points_(points), local_(points.size(), -1) {}

  MeshTile Build(const std::vector<Triangle>& triangles, const int* begin, const int* end) {
    MeshTile tile;
    vertices_.clear();
    tile.triangles.reserve(end - begin);
    for (const int* t = begin; t != end; ++t) {
      std::array<uint16_t, 3> corners{};
      for (int k = 0; k < 3; ++k) {
        int& local = local_[triangles[*t][k]];
        if (local < 0) {
          local = static_cast<int>(vertices_.size());
          vertices_.push_back(triangles[*t][k]);
        }
        corners[k] = static_cast<uint16_t>(local);
      }
      tile.triangles.push_back(corners);
    }
    Eigen::Vector3d low = points_[vertices_[0]], high = low;
    for (int v : vertices_) {
      low = low.cwiseMin(points_[v]);
      high = high.cwiseMax(points_[v]);
      local_[v] = -1;
    }
    tile.points.origin = 0.5 * (low + high);
    tile.points.x.reserve(vertices_.size());
    tile.points.y.reserve(vertices_.size());
    tile.points.z.reserve(vertices_.size());
    for (int v : vertices_) tile.points.Add(points_[v]);
    return tile;
  }

 private:
  const std::vector<Eigen::Vector3d>& points_;
  std::vector<int> local_, vertices_;
};

// The upper left sample of the quad of a grid that a triangle lies in, also where a full turn
// closes.
std::array<int, 2> QuadOf(const Triangle& t, int columns) {
  int low = columns, high = -1, row = std::numeric_limits<int>::max();
  for (int corner : t) {
    low = std::min(low, corner % columns);
    high = std::max(high, corner % columns);
    row = std::min(row, corner / columns);
  }
  return {high - low > columns / 2 && columns > 2 ? high : low, row};
}

uint32_t TileKey(int column, int row, int columns) {
  const int tiles_across = columns / kTileEdge + 1;
  return static_cast<uint32_t>(row / kTileEdge * tiles_across + column / kTileEdge);
}

// on_grid: the corners are samples of the scan's grid.
std::vector<MeshTile> TileTriangles(const Scan& scan, bool on_grid,
                                    const std::vector<Eigen::Vector3d>& points,
                                    const std::vector<Triangle>& triangles) {
  std::vector<uint32_t> keys(triangles.size());
  const Bounds bounds = on_grid ? Bounds() : FindBounds(scan);
  for (size_t i = 0; i < triangles.size(); ++i) {
    const Triangle& t = triangles[i];
    if (on_grid) {
      const auto [column, row] = QuadOf(t, scan.num_columns);
      keys[i] = TileKey(column, row, scan.num_columns);
    } else {
      keys[i] = MortonCode((points[t[0]] + points[t[1]] + points[t[2]]) / 3, bounds);
    }
  }
  const std::vector<int> order = OrderByKey(keys);
  std::vector<MeshTile> tiles;
  TileBuilder builder(points);
  for (size_t begin = 0; begin < order.size();) {
    size_t end = begin;
    while (end < order.size() &&
           (on_grid ? keys[order[end]] == keys[order[begin]] : end - begin < kTrianglesPerTile)) {
      ++end;
    }
    tiles.push_back(builder.Build(triangles, order.data() + begin, order.data() + end));
    begin = end;
  }
  return tiles;
}

// Calls body(corners, count) for every quad that the mesh leaves open although at least three of
// its corners were measured; only those are given.
template <typename Body>
void ForEachOpenQuad(const Scan& scan, const SmoothedScan& surface, const Body& body) {
  if (!scan.organised || scan.num_columns < 2) return;
  std::vector<uint8_t> filled(scan.points.size(), 0);  // triangles per quad
  bool closed = false;
  for (const Triangle& t : surface.triangles) {
    const auto [column, row] = QuadOf(t, scan.num_columns);
    ++filled[scan.Index(column, row)];
    closed = closed || column == scan.num_columns - 1;
  }
  const int quads = closed ? scan.num_columns : scan.num_columns - 1;
  for (int row = 0; row + 1 < scan.num_rows; ++row) {
    for (int column = 0; column < quads; ++column) {
      if (filled[scan.Index(column, row)] >= 2) continue;
      const int right = (column + 1) % scan.num_columns;
      const int corner[4] = {scan.Index(column, row), scan.Index(right, row),
                             scan.Index(right, row + 1), scan.Index(column, row + 1)};
      int measured[4], count = 0;
      for (int c : corner) {
        if (!scan.IsMissing(c)) measured[count++] = c;
      }
      if (count == 4 || (count == 3 && filled[scan.Index(column, row)] == 0)) body(measured, count);
    }
  }
}

// Triangles over the open quads.
std::vector<Triangle> FindShadows(const Scan& scan, const SmoothedScan& surface) {
  std::vector<Triangle> shadows;
  ForEachOpenQuad(scan, surface, [&](const int* corner, int count) {
    shadows.push_back({corner[0], corner[1], corner[2]});
    if (count == 4) shadows.push_back({corner[0], corner[2], corner[3]});
  });
  return shadows;
}

// The open quads at the range of their nearest corner; `points` gets their corners.
std::vector<Triangle> FindFringes(const Scan& scan, const SmoothedScan& surface,
                                  std::vector<Eigen::Vector3d>* points) {
  constexpr double kSameSurface = 0.01;  // of the range
  std::vector<Triangle> fringes;
  ForEachOpenQuad(scan, surface, [&](const int* corner, int count) {
    double range[4], nearest = std::numeric_limits<double>::infinity();
    for (int k = 0; k < count; ++k) {
      range[k] = (surface.points[corner[k]] - scan.Station()).norm();
      nearest = std::min(nearest, range[k]);
    }
    const int first = static_cast<int>(points->size());
    for (int k = 0; k < count; ++k) {
      const Eigen::Vector3d& point = surface.points[corner[k]];
      const double share = range[k] > (1 + kSameSurface) * nearest ? nearest / range[k] : 1;
      points->push_back(scan.Station() + share * (point - scan.Station()));
    }
    fringes.push_back({first, first + 1, first + 2});
    if (count == 4) fringes.push_back({first, first + 2, first + 3});
  });
  return fringes;
}

// Where the neighbours of a sample are missing there is no quad: what ends there may reach one
// spacing on, at the sample's range.
void AddFringesAtHoles(const Scan& scan, const SmoothedScan& surface,
                       std::vector<Eigen::Vector3d>* points, std::vector<Triangle>* fringes) {
  const auto measured = [&scan](int column, int row) {
    return column >= 0 && row >= 0 && column < scan.num_columns && row < scan.num_rows &&
           !scan.IsMissing(scan.Index(column, row));
  };
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      if (!measured(column, row)) continue;
      const Eigen::Vector3d& point = surface.points[scan.Index(column, row)];
      const Eigen::Vector3d ray = point - scan.Station();
      // The step from the neighbour to this sample, as it would be at the same range.
      const auto step = [&](int from_column, int from_row) -> Eigen::Vector3d {
        const Eigen::Vector3d from =
            surface.points[scan.Index(from_column, from_row)] - scan.Station();
        return ray - from * (ray.norm() / from.norm());
      };
      constexpr int kAround[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
      for (const auto& [dc, dr] : kAround) {
        const int c = column + dc, r = row + dr;
        if (c < 0 || r < 0 || c >= scan.num_columns || r >= scan.num_rows || measured(c, r) ||
            !measured(column - dc, row - dr)) {
          continue;
        }
        const int side = measured(column + dr, row + dc) ? 1 : -1;
        if (!measured(column + side * dr, row + side * dc)) continue;
        const Eigen::Vector3d on = step(column - dc, row - dr);
        // As wide on either side: at a corner it reaches both ways.
        const Eigen::Vector3d beside = step(column + side * dr, row + side * dc);
        const int first = static_cast<int>(points->size());
        for (const Eigen::Vector3d& corner :
             {Eigen::Vector3d(point - beside), Eigen::Vector3d(point + beside),
              Eigen::Vector3d(point + beside + on), Eigen::Vector3d(point - beside + on)}) {
          points->push_back(corner);
        }
        fringes->push_back({first, first + 1, first + 2});
        fringes->push_back({first, first + 2, first + 3});
      }
    }
  }
}

// Samples that the scanner missed here and there must not be peepholes: gaps of up to kWidestGap
// samples along a row or a column between samples at about the same range are filled for the
// occluders only. Gives the triangles that touch a filled cell; `points` gets the filled places.
std::vector<Triangle> FillGaps(const Scan& scan, std::vector<Eigen::Vector3d>* points) {
  constexpr int kWidestGap = 3;
  constexpr double kSameRange = 0.05;  // of the range
  std::vector<Triangle> triangles;
  if (!scan.organised) return triangles;
  std::vector<uint8_t> filled(points->size(), 0);
  const auto fill = [&](int cell, int steps_before, int before, int steps_after, int after) {
    const Eigen::Vector3d a = scan.points[before] - scan.Station();
    const Eigen::Vector3d b = scan.points[after] - scan.Station();
    const double range_a = a.norm(), range_b = b.norm();
    if (std::abs(range_a - range_b) > kSameRange * std::max(range_a, range_b)) return false;
    const double share = static_cast<double>(steps_before) / (steps_before + steps_after);
    const double inverse_range = (1 - share) / range_a + share / range_b;
    const Eigen::Vector3d direction = (1 - share) * a / range_a + share * b / range_b;
    (*points)[cell] = scan.Station() + direction.normalized() / inverse_range;
    filled[cell] = 1;
    return true;
  };
  // The nearest measured samples before and behind a cell along a line of `length` cells.
  const auto fill_along = [&](int cell, int place, int length, int step) {
    int before = 1, after = 1;
    while (before <= place && scan.IsMissing(cell - before * step)) ++before;
    while (place + after < length && scan.IsMissing(cell + after * step)) ++after;
    if (before > place || place + after >= length || before + after > kWidestGap + 1) return false;
    return fill(cell, before, cell - before * step, after, cell + after * step);
  };
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      const int cell = scan.Index(column, row);
      if (!scan.IsMissing(cell)) continue;
      if (!fill_along(cell, column, scan.num_columns, 1)) {
        fill_along(cell, row, scan.num_rows, scan.num_columns);
      }
    }
  }
  for (int row = 0; row + 1 < scan.num_rows; ++row) {
    for (int column = 0; column + 1 < scan.num_columns; ++column) {
      const int c[4] = {scan.Index(column, row), scan.Index(column + 1, row),
                        scan.Index(column + 1, row + 1), scan.Index(column, row + 1)};
      if (filled[c[0]] + filled[c[1]] + filled[c[2]] + filled[c[3]] == 0) continue;
      double nearest = std::numeric_limits<double>::infinity(), farthest = 0;
      for (int corner : c) {
        const double range = ((*points)[corner] - scan.Station()).norm();
        nearest = std::min(nearest, range);
        farthest = std::max(farthest, range == range ? range : 1e300);
      }
      if (farthest - nearest > kSameRange * farthest) continue;
      triangles.push_back({c[0], c[2], c[1]});
      triangles.push_back({c[0], c[3], c[2]});
    }
  }
  return triangles;
}

}  // namespace

OccluderTiles MakeOccluderTiles(const Scan& scan, const SmoothedScan& surface) {
  OccluderTiles tiles;
  tiles.range_noise = surface.range_noise;
  tiles.surface = TileTriangles(scan, scan.organised, surface.points, surface.triangles);
  if (!scan.organised) return tiles;
  tiles.shadows = TileTriangles(scan, true, surface.points, FindShadows(scan, surface));
  std::vector<Eigen::Vector3d> corners;
  std::vector<Triangle> fringes = FindFringes(scan, surface, &corners);
  AddFringesAtHoles(scan, surface, &corners, &fringes);
  tiles.fringes = TileTriangles(scan, false, corners, fringes);
  std::vector<Eigen::Vector3d> points = surface.points;
  const std::vector<Triangle> fillings = FillGaps(scan, &points);
  for (MeshTile& tile : TileTriangles(scan, true, points, fillings)) {
    tiles.surface.push_back(std::move(tile));
  }
  return tiles;
}

std::vector<SampleTile> MakeSampleTiles(int columns, int rows,
                                        const std::vector<Eigen::Vector3d>& points,
                                        const std::vector<Eigen::Vector3f>& normals,
                                        const Eigen::Vector3d& station) {
  std::vector<int> samples;
  std::vector<uint32_t> keys;
  Bounds bounds;
  for (size_t i = 0; i < points.size(); ++i) {
    if (!(points[i].x() == points[i].x())) continue;
    samples.push_back(static_cast<int>(i));
    bounds.min = bounds.min.cwiseMin(points[i]);
    bounds.max = bounds.max.cwiseMax(points[i]);
  }
  for (int i : samples) {
    keys.push_back(rows > 1 ? TileKey(i % columns, i / columns, columns)
                            : MortonCode(points[i], bounds));
  }
  const std::vector<int> order = OrderByKey(keys);
  std::vector<SampleTile> tiles;
  for (size_t begin = 0; begin < order.size();) {
    size_t end = begin;
    while (end < order.size() && (rows > 1 ? keys[order[end]] == keys[order[begin]]
                                           : end - begin < kTileEdge * kTileEdge)) {
      ++end;
    }
    SampleTile tile;
    tile.first_slot = static_cast<int>(begin);
    Eigen::Vector3d low = points[samples[order[begin]]], high = low;
    for (size_t i = begin; i < end; ++i) {
      tile.index.push_back(samples[order[i]]);
      low = low.cwiseMin(points[tile.index.back()]);
      high = high.cwiseMax(points[tile.index.back()]);
    }
    tile.points.origin = 0.5 * (low + high);
    tile.scanner = (station - tile.points.origin).cast<float>();
    for (int i : tile.index) {
      tile.points.Add(points[i]);
      tile.normals.push_back(normals[i]);
    }
    tiles.push_back(std::move(tile));
    begin = end;
  }
  return tiles;
}

}  // namespace roomtex
