#include "texture/sampling/rasterizer.h"

#include <algorithm>
#include <cmath>

namespace roomtex {
namespace {

// Slack in pixels that keeps neighbouring triangles from leaving a crack between them.
constexpr float kSlack = 1e-3f;

// Widens [left, right] by the edge p-q at the height y.
void CrossEdge(const RasterVertex& p, const RasterVertex& q, float y, float* left, float* right) {
  if ((p.y < y && q.y < y) || (p.y > y && q.y > y)) return;
  if (p.y == q.y) {
    *left = std::min({*left, p.x, q.x});
    *right = std::max({*right, p.x, q.x});
    return;
  }
  const float x = p.x + (q.x - p.x) * ((y - p.y) / (q.y - p.y));
  *left = std::min(*left, x);
  *right = std::max(*right, x);
}

struct Plane {
  float w, dx, dy;  // inverse depth at (0, 0) and its slopes
  float low, high;  // of the corners
};

Plane PlaneThrough(const RasterVertex& a, const RasterVertex& b, const RasterVertex& c,
                   float area) {
  Plane plane{a.w, 0, 0, std::min({a.w, b.w, c.w}), std::max({a.w, b.w, c.w})};
  if (std::abs(area) > 1e-12f) {
    plane.dx = ((b.w - a.w) * (c.y - a.y) - (c.w - a.w) * (b.y - a.y)) / area;
    plane.dy = ((b.x - a.x) * (c.w - a.w) - (c.x - a.x) * (b.w - a.w)) / area;
  }
  plane.w = a.w - plane.dx * a.x - plane.dy * a.y;
  return plane;
}

// Pixels whose centres lie in [low - slack, high + slack], cut to [0, size).
struct PixelRange {
  int first, last;
  PixelRange(float low, float high, int size) {
    // Clamped as floats: the numbers may be larger than an int, or infinite.
    const auto end = static_cast<float>(size);
    first = static_cast<int>(std::clamp(low - kSlack, 0.0f, end + 1) + 0.499999f);
    last = static_cast<int>(std::clamp(high + kSlack, 0.0f, end) + 0.5f) - 1;
  }
  bool empty() const { return first > last; }
};

// A triangle of few pixels: each of them is asked on which side of the three edges it lies.
void DrawSmall(const RasterVertex& a, const RasterVertex& b, const RasterVertex& c, float area,
               const PixelRange& rows, const PixelRange& columns, cv::Mat1f* inverse_depth) {
  const float turn = area < 0 ? -1.0f : 1.0f;
  const Plane plane = PlaneThrough(a, b, c, area);
  // Twice the area that each edge spans with a point, positive inside.
  const float abx = turn * (b.x - a.x), aby = turn * (b.y - a.y);
  const float bcx = turn * (c.x - b.x), bcy = turn * (c.y - b.y);
  const float cax = turn * (a.x - c.x), cay = turn * (a.y - c.y);
  const float slack = -kSlack * (std::abs(abx) + std::abs(aby) + std::abs(bcx) + std::abs(bcy));
  for (int row = rows.first; row <= rows.last; ++row) {
    const float y = static_cast<float>(row) + 0.5f;
    float* line = inverse_depth->ptr<float>(row);
    for (int column = columns.first; column <= columns.last; ++column) {
      const float x = static_cast<float>(column) + 0.5f;
      const float ab = abx * (y - a.y) - aby * (x - a.x);
      const float bc = bcx * (y - b.y) - bcy * (x - b.x);
      const float ca = cax * (y - c.y) - cay * (x - c.x);
      if (std::min({ab, bc, ca}) < slack) continue;
      const float w = plane.w + plane.dx * x + plane.dy * y;
      line[column] = std::max(line[column], std::clamp(w, plane.low, plane.high));
    }
  }
}

}  // namespace

void DrawTriangle(const RasterVertex& a, const RasterVertex& b, const RasterVertex& c,
                  cv::Mat1f* inverse_depth) {
  const float low = std::min({a.y, b.y, c.y}), high = std::max({a.y, b.y, c.y});
  const PixelRange rows(low, high, inverse_depth->rows);
  if (rows.empty()) return;
  const PixelRange columns(std::min({a.x, b.x, c.x}), std::max({a.x, b.x, c.x}),
                           inverse_depth->cols);
  if (columns.empty()) return;
  const float area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
  constexpr int kSmall = 6;
  if (rows.last - rows.first < kSmall && columns.last - columns.first < kSmall) {
    return DrawSmall(a, b, c, area, rows, columns, inverse_depth);
  }
  const Plane plane = PlaneThrough(a, b, c, area);
  for (int row = rows.first; row <= rows.last; ++row) {
    const float centre = static_cast<float>(row) + 0.5f;
    const float y = std::clamp(centre, low, high);
    float left = std::numeric_limits<float>::infinity(), right = -left;
    CrossEdge(a, b, y, &left, &right);
    CrossEdge(b, c, y, &left, &right);
    CrossEdge(c, a, y, &left, &right);
    const PixelRange span(left, right, inverse_depth->cols);
    float* line = inverse_depth->ptr<float>(row);
    const float w_of_row = plane.w + plane.dy * centre;
    for (int column = span.first; column <= span.last; ++column) {
      const float w = w_of_row + plane.dx * (static_cast<float>(column) + 0.5f);
      line[column] = std::max(line[column], std::clamp(w, plane.low, plane.high));
    }
  }
}

}  // namespace roomtex
