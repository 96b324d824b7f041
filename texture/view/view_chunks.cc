#include "texture/view/view_chunks.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <unordered_map>

#include <meshoptimizer.h>

#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// A triangle and thrice its middle along the axis that is being divided.
struct Entry {
  float sum;
  uint32_t triangle;
};

// Halves a range of triangles again and again, across its longer side, until `is_small` says so;
// the pieces come in order.
class Splitter {
 public:
  Splitter(const ViewModel& model, std::vector<Entry>* entries)
      : model_(model), entries_(entries->data()) {}

  void Split(size_t first, size_t end, const std::function<bool(size_t, size_t)>& is_small,
             const std::function<void(size_t, size_t)>& piece) const {
    if (first == end) return;
    if (is_small(first, end) || end - first < 2) return piece(first, end);
    Eigen::Vector3f low = Sum(entries_[first].triangle), high = low;
    for (size_t i = first; i < end; ++i) {
      const Eigen::Vector3f sum = Sum(entries_[i].triangle);
      low = low.cwiseMin(sum);
      high = high.cwiseMax(sum);
    }
    int axis = 0;
    (high - low).maxCoeff(&axis);
    for (size_t i = first; i < end; ++i) entries_[i].sum = Sum(entries_[i].triangle)[axis];
    const size_t middle = first + (end - first) / 2;
    std::nth_element(entries_ + first, entries_ + middle, entries_ + end,
                     [](const Entry& a, const Entry& b) {
                       return a.sum != b.sum ? a.sum < b.sum : a.triangle < b.triangle;
                     });
    Split(first, middle, is_small, piece);
    Split(middle, end, is_small, piece);
  }

 private:
  Eigen::Vector3f Sum(uint32_t triangle) const {
    const Triangle& t = model_.triangles[triangle];
    return model_.points[t[0]] + model_.points[t[1]] + model_.points[t[2]];
  }

  const ViewModel& model_;
  Entry* const entries_;
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

size_t CountPoints(const ViewModel& model, const Entry* entries, size_t count) {
  std::vector<int> points;
  points.reserve(3 * count);
  for (size_t i = 0; i < count; ++i) {
    const Triangle& t = model.triangles[entries[i].triangle];
    points.insert(points.end(), t.begin(), t.end());
  }
  std::sort(points.begin(), points.end());
  return static_cast<size_t>(std::unique(points.begin(), points.end()) - points.begin());
}

// The ranges of triangles that are simplified together; the Splitter's, by their numbers alone.
void VisitPatches(size_t first, size_t end, size_t most,
                  const std::function<void(size_t, size_t)>& visit) {
  if (end - first <= most) return visit(first, end);
  const size_t middle = first + (end - first) / 2;
  VisitPatches(first, middle, most, visit);
  VisitPatches(middle, end, most, visit);
}

// Triangles in an order in which a graphics card computes each point once or twice.
std::vector<unsigned int> InCacheOrder(const std::vector<unsigned int>& corners,
                                       size_t num_points) {
  std::vector<unsigned int> order(corners.size());
  meshopt_optimizeVertexCache(order.data(), corners.data(), corners.size(), num_points);
  return order;
}

template <typename T>
void Append(const T* values, size_t count, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

uint16_t Fraction(float value) {
  return static_cast<uint16_t>(std::clamp(value, 0.0f, 1.0f) * 65535.0f + 0.5f);
}

constexpr size_t kHeader = 4 * sizeof(uint32_t), kPerPoint = 12 + 4 + 4;

// A chunk whole: triangles in patches, points in the order in which they are met.
std::string EncodeWhole(const ViewModel& model, const Entry* entries, size_t patch_triangles,
                        ViewChunk* chunk) {
  PointNumbers numbers(chunk->num_triangles);
  std::vector<uint16_t> corners;
  corners.reserve(3 * chunk->num_triangles);
  VisitPatches(0, chunk->num_triangles, patch_triangles, [&](size_t first, size_t end) {
    PointNumbers local(end - first);
    std::vector<unsigned int> of_patch;
    for (size_t i = first; i < end; ++i) {
      for (const int corner : model.triangles[entries[i].triangle]) {
        of_patch.push_back(local(static_cast<uint32_t>(corner)));
      }
    }
    for (const unsigned int corner : InCacheOrder(of_patch, local.points.size())) {
      corners.push_back(static_cast<uint16_t>(numbers(local.points[corner])));
    }
  });
  chunk->num_vertices = static_cast<int>(numbers.points.size());
  chunk->low.setConstant(std::numeric_limits<float>::max());
  chunk->high = -chunk->low;
  const bool textured = chunk->page >= 0;
  const uint32_t header[4] = {0x31435452, static_cast<uint32_t>(numbers.points.size()),
                              static_cast<uint32_t>(corners.size()), textured ? 1u : 2u};
  std::string bytes;
  bytes.reserve(kHeader + kPerPoint * numbers.points.size() + 2 * corners.size());
  Append(header, 4, &bytes);
  for (const uint32_t point : numbers.points) {
    chunk->low = chunk->low.cwiseMin(model.points[point]);
    chunk->high = chunk->high.cwiseMax(model.points[point]);
    Append(model.points[point].data(), 3, &bytes);
  }
  for (const uint32_t point : numbers.points) {
    if (textured) {
      const Eigen::Array2f place =
          (model.uv[point] - model.uv_low).array() / (model.uv_high - model.uv_low).array();
      const uint16_t uv[2] = {Fraction(place.x()), Fraction(place.y())};
      Append(uv, 2, &bytes);
    } else {
      const auto& [r, g, b] = model.colors[point];
      const uint8_t rgba[4] = {r, g, b, 255};
      Append(rgba, 4, &bytes);
    }
  }
  for (const uint32_t point : numbers.points) {
    const Eigen::Vector3f normal = 127 * model.normals[point];
    const int8_t xyz0[4] = {static_cast<int8_t>(std::lround(normal.x())),
                            static_cast<int8_t>(std::lround(normal.y())),
                            static_cast<int8_t>(std::lround(normal.z())), 0};
    Append(xyz0, 4, &bytes);
  }
  Append(corners.data(), corners.size(), &bytes);
  std::vector<float> edges;
  for (size_t i = 0; i < chunk->num_triangles; i += 16) {
    const Triangle& t = model.triangles[entries[i].triangle];
    edges.push_back((model.points[t[0]] - model.points[t[1]]).norm());
  }
  chunk->spacing = Median(&edges);
  return bytes;
}

ViewChunks::Mesh DecodeWhole(const ViewChunk& chunk, const std::string& bytes) {
  ViewChunks::Mesh mesh;
  const auto num_points = static_cast<size_t>(chunk.num_vertices);
  mesh.points.resize(num_points);
  mesh.corners.resize(3 * chunk.num_triangles);
  std::memcpy(mesh.points.data()->data(), &bytes[kHeader], 12 * num_points);
  std::memcpy(mesh.corners.data(), &bytes[kHeader + kPerPoint * num_points],
              2 * mesh.corners.size());
  return mesh;
}

// Of a disc, in the order of its points.
Eigen::Vector3f MiddleOf(const ViewChunks::Mesh& mesh, size_t disc) {
  const uint16_t* corner = &mesh.corners[3 * disc];
  return (mesh.points[corner[0]] + mesh.points[corner[1]] + mesh.points[corner[2]]) / 3;
}

}  // namespace

ViewChunks::ViewChunks(ViewModel model, const ViewChunkOptions& options, int num_threads,
                       const std::function<bool()>& stop)
    : options_(options), is_cloud_(model.is_cloud) {
  // Page by page, then by place.
  const auto group_of = [&model](size_t t) {
    return 2 * static_cast<size_t>(model.page_of_triangle[t] + 1) + (model.IsSupplement(t) ? 1 : 0);
  };
  std::vector<size_t> begin(2 * (model.images.size() + 1) + 1, 0);
  for (size_t t = 0; t < model.triangles.size(); ++t) ++begin[group_of(t) + 1];
  for (size_t group = 1; group < begin.size(); ++group) begin[group] += begin[group - 1];
  std::vector<Entry> entries(model.triangles.size());
  std::vector<size_t> next = begin;
  for (size_t t = 0; t < model.triangles.size(); ++t) {
    entries[next[group_of(t)]++] = {0, static_cast<uint32_t>(t)};
  }
  const Splitter splitter(model, &entries);
  const auto is_small = [&](size_t first, size_t end) {
    if (stop()) return true;
    return end - first <= static_cast<size_t>(options.max_triangles) &&
           CountPoints(model, &entries[first], end - first) <=
               static_cast<size_t>(options.max_vertices);
  };
  std::vector<size_t> firsts;
  for (size_t group = 0; group + 1 < begin.size(); ++group) {
    splitter.Split(begin[group], begin[group + 1], is_small, [&](size_t from, size_t to) {
      ViewChunk chunk;
      chunk.page = static_cast<int>(group / 2) - 1;
      chunk.is_supplement = group % 2 == 1;
      chunk.num_triangles = to - from;
      chunks_.push_back(chunk);
      firsts.push_back(from);
    });
  }
  // Within a chunk by patch: what is simplified together, and what a graphics card likes.
  const auto patch = static_cast<size_t>(options.patch_triangles);
  ParallelFor(num_threads, 0, static_cast<int>(chunks_.size()), [&](int c) {
    if (stop()) return;
    ViewChunk& chunk = chunks_[c];
    const size_t first = firsts[c];
    splitter.Split(
        first, first + chunk.num_triangles,
        [patch](size_t from, size_t to) { return to - from <= patch; }, [](size_t, size_t) {});
    chunk.full = spool_.Add(EncodeWhole(model, &entries[first], patch, &chunk));
  });
  for (auto& level : made_) level.resize(chunks_.size());
}

ViewChunks::Mesh ViewChunks::Read(int chunk) const {
  return DecodeWhole(chunks_.at(chunk), spool_.Read(chunks_.at(chunk).full));
}

std::vector<Eigen::Vector3f> ViewChunks::Shown(int chunk) const {
  const Mesh mesh = Read(chunk);
  if (!is_cloud_) return mesh.points;
  std::vector<Eigen::Vector3f> shown(mesh.points.size());
  for (size_t i = 0; i < mesh.corners.size(); ++i) shown[mesh.corners[i]] = MiddleOf(mesh, i / 3);
  return shown;
}

ViewChunks::Geometry ViewChunks::Thin(const Mesh& mesh, double share) {
  const auto every = static_cast<size_t>(std::lround(1 / share));
  Geometry geometry;
  for (size_t disc = 0; disc < mesh.corners.size() / 3; disc += every) {
    for (size_t i = 3 * disc; i < 3 * disc + 3; ++i) {
      geometry.corners.push_back(static_cast<uint16_t>(geometry.points.size()));
      geometry.points.push_back(mesh.corners[i]);
    }
  }
  geometry.disc_size = static_cast<float>(std::sqrt(1 / share));
  return geometry;
}

ViewChunks::Geometry ViewChunks::Simplify(const Mesh& mesh, double share, double tolerance) const {
  double largest_error = 0;
  std::vector<unsigned int> all_corners;
  PointNumbers numbers(mesh.points.size() / 8);
  const auto simplify = [&](size_t first, size_t end) {
    PointNumbers local(end - first);
    std::vector<unsigned int> corners;
    for (size_t i = 3 * first; i < 3 * end; ++i) corners.push_back(local(mesh.corners[i]));
    std::vector<float> positions;
    for (const uint32_t point : local.points) {
      const Eigen::Vector3f& p = mesh.points[point];
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
  VisitPatches(0, mesh.corners.size() / 3, static_cast<size_t>(options_.patch_triangles), simplify);
  Geometry geometry;
  std::vector<int> number(numbers.points.size(), -1);
  for (const unsigned int corner : InCacheOrder(all_corners, numbers.points.size())) {
    if (number[corner] < 0) {
      number[corner] = static_cast<int>(geometry.points.size());
      geometry.points.push_back(static_cast<uint16_t>(numbers.points[corner]));
    }
    geometry.corners.push_back(static_cast<uint16_t>(number[corner]));
  }
  geometry.error = largest_error;
  return geometry;
}

std::shared_ptr<const ViewChunks::Geometry> ViewChunks::Make(int chunk, Level level) const {
  if (level == kFull) {
    Geometry whole;
    whole.points.resize(static_cast<size_t>(chunks_.at(chunk).num_vertices));
    for (size_t i = 0; i < whole.points.size(); ++i) whole.points[i] = static_cast<uint16_t>(i);
    whole.corners = Read(chunk).corners;
    return std::make_shared<const Geometry>(std::move(whole));
  }
  std::shared_ptr<const Geometry>& made = made_[level].at(chunk);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (made) return made;
  }
  const double share = level == kCoarse ? options_.coarse_share : options_.middle_share;
  const double error = level == kCoarse ? options_.coarse_error : options_.middle_error;
  const Mesh mesh = Read(chunk);
  auto geometry = std::make_shared<const Geometry>(is_cloud_ ? Thin(mesh, share)
                                                             : Simplify(mesh, share, error));
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!made) made = geometry;
  return made;
}

std::string ViewChunks::Encode(int chunk, Level level) const {
  const std::string whole = spool_.Read(chunks_.at(chunk).full);
  if (level == kFull) return whole;
  const std::shared_ptr<const Geometry> geometry = Make(chunk, level);
  const auto num_points = static_cast<size_t>(chunks_[chunk].num_vertices);
  const uint32_t header[2] = {static_cast<uint32_t>(geometry->points.size()),
                              static_cast<uint32_t>(geometry->corners.size())};
  std::string bytes = whole.substr(0, kHeader);
  std::memcpy(&bytes[4], header, sizeof header);
  bytes.reserve(kHeader + kPerPoint * geometry->points.size() + 2 * geometry->corners.size());
  // Positions, looks and normals of the points that are left.
  size_t at = kHeader;
  for (const size_t size : {12, 4, 4}) {
    for (const uint16_t point : geometry->points) bytes.append(whole, at + size * point, size);
    at += size * num_points;
  }
  if (geometry->disc_size > 1) {
    const auto points = reinterpret_cast<float*>(&bytes[kHeader]);
    for (size_t disc = 0; disc < geometry->points.size() / 3; ++disc) {
      Eigen::Map<Eigen::Matrix3f> corners(points + 9 * disc);  // one per column
      const Eigen::Vector3f middle = corners.rowwise().mean();
      corners = ((geometry->disc_size * (corners.colwise() - middle)).colwise() + middle).eval();
    }
  }
  Append(geometry->corners.data(), geometry->corners.size(), &bytes);
  return bytes;
}

}  // namespace roomtex
