#include "texture/sampling/photo_warp.h"

#include <algorithm>
#include <cmath>

namespace roomtex {

PhotoWarp::PhotoWarp(int width, int height, double spacing)
    : columns_(static_cast<int>(std::ceil(width / spacing)) + 1),
      rows_(static_cast<int>(std::ceil(height / spacing)) + 1),
      spacing_(spacing),
      shifts_(static_cast<size_t>(columns_) * rows_, Eigen::Vector2f::Zero()) {}

void PhotoWarp::NodesAt(float x, float y, std::array<int, 4>* nodes,
                        std::array<float, 4>* shares) const {
  const auto spacing = static_cast<float>(spacing_);
  const float u = std::clamp(x / spacing, 0.0f, static_cast<float>(columns_ - 1));
  const float v = std::clamp(y / spacing, 0.0f, static_cast<float>(rows_ - 1));
  const int column = std::min(static_cast<int>(u), columns_ - 2);
  const int row = std::min(static_cast<int>(v), rows_ - 2);
  const float s = u - static_cast<float>(column), t = v - static_cast<float>(row);
  const int first = row * columns_ + column;
  *nodes = {first, first + 1, first + columns_, first + columns_ + 1};
  *shares = {(1 - t) * (1 - s), (1 - t) * s, t * (1 - s), t * s};
}

Eigen::Vector2f PhotoWarp::At(float x, float y) const {
  std::array<int, 4> nodes;
  std::array<float, 4> shares;
  NodesAt(x, y, &nodes, &shares);
  Eigen::Vector2f sum = Eigen::Vector2f::Zero();
  for (int k = 0; k < 4; ++k) sum += shares[k] * shifts_[nodes[k]];
  return sum;
}

}  // namespace roomtex
