#include "texture/sampling/mesh_front.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <string>
#include <utility>

#include "core/parallel.h"
#include "core/ray_caster.h"

namespace roomtex {
namespace {

constexpr size_t kMostPhotos = 60;        // that are asked, evenly chosen
constexpr int kColumns = 96, kRows = 64;  // rays of each
constexpr int kMostTimes = 2;             // as many from behind as from the front
constexpr double kNearest = 0.01;         // metres: what touches the lens is not looked at

// Triangles that belong together, each wound as the first of them or the other way round
// (disjoint sets with parity).
class Pieces {
 public:
  explicit Pieces(size_t count) : parent_(count), is_opposite_(count, false), size_(count, 1) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  // The piece's number, and whether the triangle is wound against it.
  std::pair<int, bool> Find(int triangle) {
    int root = triangle;
    bool opposite = false;
    while (parent_[root] != root) {
      opposite = opposite != is_opposite_[root];
      root = parent_[root];
    }
    for (bool rest = opposite; parent_[triangle] != root && triangle != root;) {
      const int next = parent_[triangle];
      const bool step = is_opposite_[triangle];
      parent_[triangle] = root;
      is_opposite_[triangle] = rest;
      rest = rest != step;
      triangle = next;
    }
    return {root, opposite};
  }

  void Join(int a, int b, bool are_opposite) {
    auto [root_a, opposite_a] = Find(a);
    auto [root_b, opposite_b] = Find(b);
    if (root_a == root_b) return;
    if (size_[root_a] < size_[root_b]) std::swap(root_a, root_b);
    parent_[root_b] = root_a;
    is_opposite_[root_b] = (opposite_a != opposite_b) != are_opposite;
    size_[root_a] += size_[root_b];
  }

 private:
  std::vector<int> parent_;
  std::vector<bool> is_opposite_;  // against the parent
  std::vector<int> size_;
};

// Corners at one place have one number: many programs write each triangle with corners of its own.
std::vector<int> NumberPlaces(const Scan& mesh) {
  std::vector<int> order(mesh.points.size()), number(mesh.points.size());
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](int i) {
    const Eigen::Vector3d& x = mesh.points[i];
    return std::array<double, 3>{x[0], x[1], x[2]};
  };
  order.erase(std::remove_if(order.begin(), order.end(), [&](int i) { return mesh.IsMissing(i); }),
              order.end());
  std::sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
  int next = 0;
  for (size_t k = 0; k < order.size(); ++k) {
    if (k > 0 && key(order[k]) != key(order[k - 1])) ++next;
    number[order[k]] = next;
  }
  return number;
}

Pieces FindPieces(const Scan& mesh) {
  const std::vector<int> number = NumberPlaces(mesh);
  struct Edge {
    int low, high, triangle;
    bool goes_up;
    bool operator<(const Edge& other) const {
      return std::pair(low, high) < std::pair(other.low, other.high);
    }
  };
  std::vector<Edge> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int from = number[mesh.triangles[t][k]], to = number[mesh.triangles[t][(k + 1) % 3]];
      if (from == to) continue;
      edges.push_back({std::min(from, to), std::max(from, to), static_cast<int>(t), from < to});
    }
  }
  std::stable_sort(edges.begin(), edges.end());
  Pieces pieces(mesh.triangles.size());
  for (size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    while (end < edges.size() && !(edges[begin] < edges[end])) ++end;
    if (end - begin != 2) continue;  // a border, or where several surfaces meet
    pieces.Join(edges[begin].triangle, edges[begin + 1].triangle,
                edges[begin].goes_up == edges[begin + 1].goes_up);
  }
  return pieces;
}

Eigen::Vector3d NormalOf(const Scan& mesh, const Triangle& t) {
  const Eigen::Vector3d& a = mesh.points[t[0]];
  return (mesh.points[t[1]] - a).cross(mesh.points[t[2]] - a);
}

// The triangles that a photo sees first, each with the side it sees.
struct Sighting {
  int triangle;
  bool from_front;
};
std::vector<Sighting> Look(const PhotoView& photo, const Scan& mesh, const RayCaster& caster) {
  std::vector<Sighting> sightings;
  const CameraProjection projection(photo.camera);
  const Rigid scan_from_cam = photo.cam_from_scan.Inverse();
  for (int k = 0; k < kColumns * kRows; ++k) {
    const auto ray = projection.RayFromImg({(k % kColumns + 0.5) / kColumns * photo.camera.width,
                                            (k / kColumns + 0.5) / kRows * photo.camera.height});
    if (!ray) continue;
    const Eigen::Vector3d direction = (scan_from_cam.rotation * *ray).normalized();
    const auto hit = caster.Cast(scan_from_cam.translation, direction, kNearest);
    if (!hit) continue;
    sightings.push_back(
        {hit->triangle, NormalOf(mesh, mesh.triangles[hit->triangle]).dot(direction) < 0});
  }
  return sightings;
}

}  // namespace

size_t TurnMeshToPhotos(const std::vector<PhotoView>& photos, int num_threads, Scan* mesh) {
  if (mesh->kind() != Scan::Kind::kMesh || !mesh->station_is_assumed) return 0;
  const size_t count = std::min(kMostPhotos, photos.size());
  std::vector<std::vector<Sighting>> sightings(count);
  {
    const RayCaster caster(mesh->points, mesh->triangles);
    ParallelFor(num_threads, 0, static_cast<int>(count), [&](int i) {
      sightings[i] = Look(photos[i * photos.size() / count], *mesh, caster);
    });
  }
  Pieces pieces = FindPieces(*mesh);
  struct Votes {
    int64_t front = 0, back = 0;  // of the piece as its first triangle is wound
  };
  std::vector<Votes> votes(mesh->triangles.size());
  for (const std::vector<Sighting>& of_photo : sightings) {
    for (const Sighting& sighting : of_photo) {
      const auto [piece, is_opposite] = pieces.Find(sighting.triangle);
      ++(sighting.from_front != is_opposite ? votes[piece].front : votes[piece].back);
    }
  }
  size_t num_turned = 0;
  for (size_t t = 0; t < mesh->triangles.size(); ++t) {
    const auto [piece, is_opposite] = pieces.Find(static_cast<int>(t));
    const Votes& seen = votes[piece];
    if (std::max(seen.front, seen.back) <= kMostTimes * std::min(seen.front, seen.back)) continue;
    if ((seen.back > seen.front) == is_opposite) continue;
    std::swap(mesh->triangles[t][1], mesh->triangles[t][2]);
    ++num_turned;
  }
  return num_turned;
}

void TurnMeshesToPhotos(const std::vector<PhotoView>& photos, const Command::Context& context,
                        std::vector<Scan>* scans) {
  for (Scan& scan : *scans) {
    const size_t num_turned = TurnMeshToPhotos(photos, context.options.num_threads, &scan);
    if (num_turned == 0) continue;
    context.Warn(scan.path + ": " + std::to_string(num_turned) + " of " +
                 std::to_string(scan.triangles.size()) +
                 " triangles turn their back to the photos that see them, and are turned round");
  }
}

}  // namespace roomtex
