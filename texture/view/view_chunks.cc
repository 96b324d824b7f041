#include "texture/view/view_chunks.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <unordered_map>

#include <meshoptimizer.h>

#include "core/statistics.h"

namespace roomtex {
namespace {

// Thrice the middle of every triangle.
std::vector<Eigen::Vector3f> TriangleSums(const ViewModel& model) {
  std::vector<Eigen::Vector3f> sums;
  sums.reserve(model.triangles.size());
  for (const Triangle& t : model.triangles) {
    sums.push_back(model.points[t[0]] + model.points[t[1]] + model.points[t[2]]);
  }
  return sums;
}

// Halves a range of triangles again and again, across its longer side, until `is_small` says so;
// the pieces come in order.
class Splitter {
 public:
  Splitter(const std::vector<Eigen::Vector3f>& sums, uint32_t* order)
      : sums_(sums), order_(order) {}

  void Split(size_t first, size_t end, const std::function<bool(size_t, size_t)>& is_small,
             const std::function<void(size_t, size_t)>& piece) const {
    if (first == end) return;
    if (is_small(first, end) || end - first < 2) return piece(first, end);
    Eigen::Vector3f low = sums_[order_[first]], high = low;
    for (size_t i = first; i < end; ++i) {
      low = low.cwiseMin(sums_[order_[i]]);
      high = high.cwiseMax(sums_[order_[i]]);
    }
    int axis = 0;
    (high - low).maxCoeff(&axis);
    const size_t middle = first + (end - first) / 2;
    std::nth_element(order_ + first, order_ + middle, order_ + end,
                     [this, axis](uint32_t a, uint32_t b) {
                       const float x = sums_[a][axis], y = sums_[b][axis];
                       return x != y ? x < y : a < b;
                     });
    Split(first, middle, is_small, piece);
    Split(middle, end, is_small, piece);
  }

 private:
  const std::vector<Eigen::Vector3f>& sums_;
  uint32_t* order_;
};

// Numbers points in the order in which they are first met.
class PointNumbers {
 public:
  explicit PointNumbers(size_t expected) { number_.reserve(expected); }
  uint32_t operator()(uint32_t point) {
    const auto [found, is_new] = number_.emplace(point, static_cast<uint32_t>(points.size()));
    if (is_new) points.push_back(point);
    return found->second;
  }
  std::vector<uint32_t> points;

 private:
  std::unordered_map<uint32_t, uint32_t> number_;
};

size_t CountPoints(const ViewModel& model, const uint32_t* triangles, size_t count) {
  std::vector<int> points;
  points.reserve(3 * count);
  for (size_t i = 0; i < count; ++i) {
    const Triangle& t = model.triangles[triangles[i]];
    points.insert(points.end(), t.begin(), t.end());
  }
  std::sort(points.begin(), points.end());
  return static_cast<size_t>(std::unique(points.begin(), points.end()) - points.begin());
}

void Measure(const ViewModel& model, const uint32_t* triangles, ViewChunk* chunk) {
  chunk->low.setConstant(std::numeric_limits<float>::max());
  chunk->high = -chunk->low;
  std::vector<float> edges;
  for (size_t i = 0; i < chunk->num_triangles(); ++i) {
    const Triangle& t = model.triangles[triangles[i]];
    for (const int corner : t) {
      chunk->low = chunk->low.cwiseMin(model.points[corner]);
      chunk->high = chunk->high.cwiseMax(model.points[corner]);
    }
    if (i % 16 == 0) edges.push_back((model.points[t[0]] - model.points[t[1]]).norm());
  }
  chunk->spacing = Median(&edges);
}

// Triangles in an order in which a graphics card computes each point once or twice, points in the
// order in which they are met.
ViewChunks::Geometry Arrange(const std::vector<uint32_t>& points,
                             const std::vector<unsigned int>& corners) {
  ViewChunks::Geometry geometry;
  std::vector<unsigned int> order(corners.size());
  meshopt_optimizeVertexCache(order.data(), corners.data(), corners.size(), points.size());
  std::vector<int> number(points.size(), -1);
  geometry.points.reserve(points.size());
  geometry.corners.reserve(order.size());
  for (const unsigned int corner : order) {
    if (number[corner] < 0) {
      number[corner] = static_cast<int>(geometry.points.size());
      geometry.points.push_back(points[corner]);
    }
    geometry.corners.push_back(static_cast<uint16_t>(number[corner]));
  }
  return geometry;
}

template <typename T>
void Append(const T* values, size_t count, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

uint16_t Fraction(float value) {
  return static_cast<uint16_t>(std::clamp(value, 0.0f, 1.0f) * 65535.0f + 0.5f);
}

}  // namespace

ViewChunks::ViewChunks(const ViewModel& model, const ViewChunkOptions& options)
    : model_(model), options_(options) {
  // Page by page, then by place.
  const std::vector<Eigen::Vector3f> sums = TriangleSums(model);
  std::vector<std::vector<uint32_t>> by_page(2 * (model.images.size() + 1));
  for (size_t t = 0; t < model.triangles.size(); ++t) {
    const int page = model.page_of_triangle[t] + 1;
    by_page[2 * page + (model.IsSupplement(t) ? 1 : 0)].push_back(static_cast<uint32_t>(t));
  }
  order_.reserve(model.triangles.size());
  for (std::vector<uint32_t>& triangles : by_page) {
    order_.insert(order_.end(), triangles.begin(), triangles.end());
    triangles = {};
  }
  const Splitter splitter(sums, order_.data());
  std::vector<size_t> counts(1, 0);
  const auto is_small = [&](size_t first, size_t end) {
    if (end - first > static_cast<size_t>(options.max_triangles)) return false;
    counts.back() = CountPoints(model, &order_[first], end - first);
    return counts.back() <= static_cast<size_t>(options.max_vertices);
  };
  size_t first = 0;
  while (first < order_.size()) {
    const int page = model.page_of_triangle[order_[first]];
    const bool is_supplement = model.IsSupplement(order_[first]);
    size_t end = first;
    while (end < order_.size() && model.page_of_triangle[order_[end]] == page &&
           model.IsSupplement(order_[end]) == is_supplement) {
      ++end;
    }
    splitter.Split(first, end, is_small, [&](size_t from, size_t to) {
      ViewChunk chunk;
      chunk.page = page;
      chunk.is_supplement = is_supplement;
      chunk.first = from;
      chunk.end = to;
      chunk.num_vertices = static_cast<int>(counts.back());
      chunks_.push_back(chunk);
    });
    first = end;
  }
  // Within a chunk by patch: what is simplified together, and what a graphics card likes.
  for (ViewChunk& chunk : chunks_) {
    splitter.Split(
        chunk.first, chunk.end,
        [&](size_t from, size_t to) {
          return to - from <= static_cast<size_t>(options_.patch_triangles);
        },
        [](size_t, size_t) {});
    Measure(model, &order_[chunk.first], &chunk);
  }
  for (auto& level : made_) level.resize(chunks_.size());
}

ViewChunks::Geometry ViewChunks::MakeFull(const ViewChunk& chunk) const {
  PointNumbers numbers(static_cast<size_t>(chunk.num_vertices));
  std::vector<unsigned int> corners;
  corners.reserve(3 * chunk.num_triangles());
  for (size_t i = chunk.first; i < chunk.end; ++i) {
    for (const int corner : model_.triangles[order_[i]]) {
      corners.push_back(numbers(static_cast<uint32_t>(corner)));
    }
  }
  return Arrange(numbers.points, corners);
}

ViewChunks::Geometry ViewChunks::Thin(const ViewChunk& chunk, double share) const {
  const auto every = static_cast<size_t>(std::lround(1 / share));
  Geometry geometry;
  for (size_t i = chunk.first; i < chunk.end; i += every) {
    for (const int corner : model_.triangles[order_[i]]) {
      geometry.corners.push_back(static_cast<uint16_t>(geometry.points.size()));
      geometry.points.push_back(static_cast<uint32_t>(corner));
    }
  }
  geometry.disc_size = static_cast<float>(std::sqrt(1 / share));
  return geometry;
}

ViewChunks::Geometry ViewChunks::Simplify(const ViewChunk& chunk, double share,
                                          double tolerance) const {
  double largest_error = 0;
  std::vector<unsigned int> all_corners;
  PointNumbers numbers(static_cast<size_t>(chunk.num_vertices) / 8);
  const auto simplify = [&](size_t first, size_t end) {
    PointNumbers local(end - first);
    std::vector<unsigned int> corners;
    for (size_t i = first; i < end; ++i) {
      for (const int corner : model_.triangles[order_[i]]) {
        corners.push_back(local(static_cast<uint32_t>(corner)));
      }
    }
    std::vector<float> positions;
    for (const uint32_t point : local.points) {
      const Eigen::Vector3f& p = model_.points[point];
      positions.insert(positions.end(), {p.x(), p.y(), p.z()});
    }
    constexpr size_t kStride = 3 * sizeof(float);
    const float scale = meshopt_simplifyScale(positions.data(), local.points.size(), kStride);
    const auto wanted = static_cast<size_t>(share * static_cast<double>(end - first));
    const auto allowed = static_cast<float>(tolerance / std::max(scale, 1e-9f));
    std::vector<unsigned int> result(corners.size());
    float error = 0;
    result.resize(meshopt_simplify(result.data(), corners.data(), corners.size(), positions.data(),
                                   local.points.size(), kStride, 3 * std::max<size_t>(wanted, 1),
                                   allowed, meshopt_SimplifyLockBorder, &error));
    for (const unsigned int corner : result) {
      all_corners.push_back(numbers(local.points[corner]));
    }
    largest_error = std::max(largest_error, static_cast<double>(error * scale));
  };
  // The ranges that the constructor's split ended with.
  const std::function<void(size_t, size_t)> visit = [&](size_t first, size_t end) {
    if (end - first <= static_cast<size_t>(options_.patch_triangles)) return simplify(first, end);
    const size_t middle = first + (end - first) / 2;
    visit(first, middle);
    visit(middle, end);
  };
  visit(chunk.first, chunk.end);
  Geometry geometry = Arrange(numbers.points, all_corners);
  geometry.error = largest_error;
  return geometry;
}

std::shared_ptr<const ViewChunks::Geometry> ViewChunks::Make(int chunk, Level level) const {
  if (level == kFull) return std::make_shared<const Geometry>(MakeFull(chunks_.at(chunk)));
  if (model_.is_cloud) {
    return std::make_shared<const Geometry>(
        Thin(chunks_.at(chunk), level == kCoarse ? options_.coarse_share : options_.middle_share));
  }
  std::shared_ptr<const Geometry>& made = made_[level].at(chunk);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (made) return made;
  }
  auto geometry = std::make_shared<const Geometry>(
      level == kCoarse ? Simplify(chunks_[chunk], options_.coarse_share, options_.coarse_error)
                       : Simplify(chunks_[chunk], options_.middle_share, options_.middle_error));
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!made) made = geometry;
  return made;
}

std::string ViewChunks::Encode(int chunk, Level level) const {
  const std::shared_ptr<const Geometry> geometry = Make(chunk, level);
  const bool textured = chunks_[chunk].page >= 0;
  const uint32_t header[4] = {0x31435452, static_cast<uint32_t>(geometry->points.size()),
                              static_cast<uint32_t>(geometry->corners.size()), textured ? 1u : 2u};
  std::string bytes;
  bytes.reserve(sizeof header + 20 * geometry->points.size() + 2 * geometry->corners.size());
  Append(header, 4, &bytes);
  for (const uint32_t point : geometry->points) {
    Eigen::Vector3f place = model_.points[point];
    if (geometry->disc_size > 1) {
      const Eigen::Vector3f middle = model_.Shown(point);
      place = middle + geometry->disc_size * (place - middle);
    }
    Append(place.data(), 3, &bytes);
  }
  for (const uint32_t point : geometry->points) {
    if (textured) {
      const uint16_t uv[2] = {Fraction(model_.uv[point].x()), Fraction(model_.uv[point].y())};
      Append(uv, 2, &bytes);
    } else {
      const auto& [r, g, b] = model_.colors[point];
      const uint8_t rgba[4] = {r, g, b, 255};
      Append(rgba, 4, &bytes);
    }
  }
  for (const uint32_t point : geometry->points) {
    const Eigen::Vector3f normal = 127 * model_.normals[point];
    const int8_t xyz0[4] = {static_cast<int8_t>(std::lround(normal.x())),
                            static_cast<int8_t>(std::lround(normal.y())),
                            static_cast<int8_t>(std::lround(normal.z())), 0};
    Append(xyz0, 4, &bytes);
  }
  Append(geometry->corners.data(), geometry->corners.size(), &bytes);
  return bytes;
}

}  // namespace roomtex
