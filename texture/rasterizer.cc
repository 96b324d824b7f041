#include "texture/rasterizer.h"

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

}  // namespace

void DrawTriangle(RasterVertex a, RasterVertex b, RasterVertex c, cv::Mat1f* inverse_depth) {
  const float low = std::min({a.y, b.y, c.y}), high = std::max({a.y, b.y, c.y});
  // Rows whose centre line y = row + 0.5 meets the triangle.
  const int first_row = static_cast<int>(std::ceil(std::max(low - kSlack, 0.0f) - 0.5f));
  const int last_row = static_cast<int>(
      std::floor(std::min(high + kSlack, static_cast<float>(inverse_depth->rows)) - 0.5f));
  if (first_row > last_row) return;

  const float area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
  float dw_dx = 0, dw_dy = 0;
  if (std::abs(area) > 1e-12f) {
    dw_dx = ((b.w - a.w) * (c.y - a.y) - (c.w - a.w) * (b.y - a.y)) / area;
    dw_dy = ((b.x - a.x) * (c.w - a.w) - (c.x - a.x) * (b.w - a.w)) / area;
  }
  const float w_low = std::min({a.w, b.w, c.w}), w_high = std::max({a.w, b.w, c.w});
  for (int row = std::max(first_row, 0); row <= std::min(last_row, inverse_depth->rows - 1);
       ++row) {
    const float y = std::clamp(row + 0.5f, low, high);
    float left = std::numeric_limits<float>::infinity(), right = -left;
    CrossEdge(a, b, y, &left, &right);
    CrossEdge(b, c, y, &left, &right);
    CrossEdge(c, a, y, &left, &right);
    const float limit = static_cast<float>(inverse_depth->cols);
    const int first = static_cast<int>(std::ceil(std::max(left - kSlack, 0.0f) - 0.5f));
    const int last = static_cast<int>(std::floor(std::min(right + kSlack, limit) - 0.5f));
    float* line = inverse_depth->ptr<float>(row);
    for (int column = std::max(first, 0); column <= std::min(last, inverse_depth->cols - 1);
         ++column) {
      const float w = a.w + dw_dx * (column + 0.5f - a.x) + dw_dy * (row + 0.5f - a.y);
      line[column] = std::max(line[column], std::clamp(w, w_low, w_high));
    }
  }
}

}  // namespace roomtex
