#include "texture/output/decimate_parts.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <meshoptimizer.h>

#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr size_t kTrianglesPerSquare = 16;
constexpr int kLeastSquare = 4;              // samples
constexpr size_t kBlockTriangles = 1 << 18;  // simplified at once, before all together
constexpr size_t kFirstRound = 4;            // times as many triangles as wanted are left by it

TexturedPart PartOfColors(const ColoredScan& colored, size_t num_points) {
  TexturedPart part;
  std::vector<int> number(num_points, -1);
  part.corners.reserve(3 * colored.triangles.size());
  for (const Triangle& t : colored.triangles) {
    for (const int corner : t) {
      if (number[corner] < 0) {
        number[corner] = static_cast<int>(part.vertices.size());
        part.vertices.push_back(corner);
      }
      part.corners.push_back(static_cast<uint32_t>(number[corner]));
    }
  }
  return part;
}

// All parts of a scan as one mesh. A vertex stands once for every part and square that it belongs
// to: for meshoptimizer these are seams, along which it removes vertices only on both sides at
// once and over which no triangle grows.
struct SeamedMesh {
  std::vector<float> positions;                       // x y z, about the scan's middle
  std::vector<std::pair<uint32_t, uint32_t>> origin;  // part, its vertex
  std::vector<uint32_t> corners;                      // square by square

  size_t num_triangles() const { return corners.size() / 3; }
};

// The square of each triangle of a part: that of its first column and row, so that squares meet
// along lines of samples. (meshoptimizer 0.18 folds triangles at seams that run zigzag.)
std::vector<uint32_t> SquaresOf(const TexturedPart& part, int square_samples) {
  std::vector<uint32_t> squares(part.corners.size() / 3, 0);
  if (part.width == 0 || square_samples == 0) return squares;
  const auto samples = [&part](float uv, int texels) {
    const float centre =
        uv * static_cast<float>(texels) / static_cast<float>(part.texels_per_sample);
    return static_cast<uint32_t>(std::lround(centre - 0.5f));
  };
  const uint32_t across = part.width / part.texels_per_sample / square_samples + 1;
  for (size_t i = 0; i < squares.size(); ++i) {
    Eigen::Vector2f first = part.uv[part.corners[3 * i]];
    for (int k = 1; k < 3; ++k) first = first.cwiseMin(part.uv[part.corners[3 * i + k]]);
    squares[i] = samples(first.y(), part.height) / square_samples * across +
                 samples(first.x(), part.width) / square_samples;
  }
  return squares;
}

SeamedMesh Seam(const Scan& scan, const std::vector<TexturedPart>& parts, int square_samples) {
  const Bounds bounds = FindBounds(scan);
  const Eigen::Vector3d middle = 0.5 * (bounds.min + bounds.max);
  SeamedMesh mesh;
  for (uint32_t p = 0; p < parts.size(); ++p) {
    const TexturedPart& part = parts[p];
    const std::vector<uint32_t> squares = SquaresOf(part, square_samples);
    std::vector<uint32_t> order(squares.size());
    for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(),
                     [&](uint32_t a, uint32_t b) { return squares[a] < squares[b]; });
    std::vector<uint32_t> number(part.vertices.size());
    std::vector<int64_t> numbered_in(part.vertices.size(), -1);
    for (const uint32_t i : order) {
      for (int k = 0; k < 3; ++k) {
        const uint32_t v = part.corners[3 * i + k];
        if (numbered_in[v] != squares[i]) {
          numbered_in[v] = squares[i];
          number[v] = static_cast<uint32_t>(mesh.origin.size());
          mesh.origin.emplace_back(p, v);
          const Eigen::Vector3f x = (scan.points[part.vertices[v]] - middle).cast<float>();
          mesh.positions.insert(mesh.positions.end(), {x.x(), x.y(), x.z()});
        }
        mesh.corners.push_back(number[v]);
      }
    }
  }
  return mesh;
}

std::vector<uint32_t> Simplify(const std::vector<uint32_t>& corners,
                               const std::vector<float>& positions, size_t max_corners,
                               unsigned int options) {
  constexpr float kAnyError = 1;  // share of the extent: the number of triangles decides
  std::vector<uint32_t> left(corners.size());
  left.resize(meshopt_simplify(left.data(), corners.data(), corners.size(), positions.data(),
                               positions.size() / 3, 3 * sizeof(float), max_corners, kAnyError,
                               options, nullptr));
  return left;
}

// One block of neighbouring triangles, its border kept.
std::vector<uint32_t> SimplifyBlock(const SeamedMesh& mesh, size_t first, size_t end,
                                    double share) {
  std::vector<uint32_t> used(mesh.corners.begin() + 3 * static_cast<std::ptrdiff_t>(first),
                             mesh.corners.begin() + 3 * static_cast<std::ptrdiff_t>(end));
  std::vector<uint32_t> corners = used;
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  std::vector<float> positions;
  positions.reserve(3 * used.size());
  for (const uint32_t v : used) {
    const float* x = &mesh.positions[3 * static_cast<size_t>(v)];
    positions.insert(positions.end(), x, x + 3);
  }
  for (uint32_t& corner : corners) {
    corner =
        static_cast<uint32_t>(std::lower_bound(used.begin(), used.end(), corner) - used.begin());
  }
  const auto wanted = static_cast<size_t>(share * static_cast<double>(end - first));
  corners = Simplify(corners, positions, 3 * wanted, meshopt_SimplifyLockBorder);
  for (uint32_t& corner : corners) corner = used[corner];
  return corners;
}

// Large meshes first block by block: less memory, and on several threads.
void SimplifyBlocks(size_t max_triangles, int num_threads, SeamedMesh* mesh) {
  const size_t total = mesh->num_triangles();
  if (total <= std::max(2 * kBlockTriangles, kFirstRound * max_triangles)) return;
  const double share =
      static_cast<double>(kFirstRound * max_triangles) / static_cast<double>(total);
  const size_t num_blocks = (total + kBlockTriangles - 1) / kBlockTriangles;
  std::vector<std::vector<uint32_t>> left(num_blocks);
  ParallelFor(num_threads, 0, static_cast<int>(num_blocks), [&](int b) {
    left[b] = SimplifyBlock(*mesh, b * kBlockTriangles, std::min(total, (b + 1) * kBlockTriangles),
                            share);
  });
  mesh->corners.clear();
  for (const std::vector<uint32_t>& corners : left) {
    mesh->corners.insert(mesh->corners.end(), corners.begin(), corners.end());
  }
}

// Leaves each part the triangles that the mesh has of it.
void TakeOver(const SeamedMesh& mesh, std::vector<TexturedPart>* parts) {
  std::vector<TexturedPart> left(*parts);
  std::vector<std::vector<int64_t>> number(parts->size());
  for (size_t p = 0; p < parts->size(); ++p) {
    left[p].vertices.clear();
    left[p].uv.clear();
    left[p].corners.clear();
    number[p].assign((*parts)[p].vertices.size(), -1);
  }
  for (const uint32_t corner : mesh.corners) {
    const auto& [p, v] = mesh.origin[corner];
    const TexturedPart& from = (*parts)[p];
    if (number[p][v] < 0) {
      number[p][v] = static_cast<int64_t>(left[p].vertices.size());
      left[p].vertices.push_back(from.vertices[v]);
      if (!from.uv.empty()) left[p].uv.push_back(from.uv[v]);
    }
    left[p].corners.push_back(static_cast<uint32_t>(number[p][v]));
  }
  left.erase(std::remove_if(left.begin(), left.end(),
                            [](const TexturedPart& part) { return part.corners.empty(); }),
             left.end());
  *parts = std::move(left);
}

size_t TrianglesOf(const std::vector<TexturedPart>& parts) {
  size_t count = 0;
  for (const TexturedPart& part : parts) count += part.corners.size() / 3;
  return count;
}

// Squares double where their corners and the scan's many borders leave too many triangles.
void DecimateScan(const Scan& scan, size_t wanted, int square_samples, int num_threads,
                  std::vector<TexturedPart>* parts) {
  constexpr int kMostDoublings = 4;
  for (int i = 0; i <= kMostDoublings && TrianglesOf(*parts) > wanted; ++i) {
    SeamedMesh mesh = Seam(scan, *parts, square_samples);
    SimplifyBlocks(wanted, num_threads, &mesh);
    mesh.corners = Simplify(mesh.corners, mesh.positions, 3 * wanted, 0);
    TakeOver(mesh, parts);
    if (square_samples == 0) return;
    square_samples *= 2;
  }
}

}  // namespace

std::vector<std::vector<TexturedPart>> MakeMeshParts(const std::vector<Scan>& scans,
                                                     const std::vector<ColoredScan>& colored,
                                                     int max_texture_size) {
  std::vector<std::vector<TexturedPart>> parts;
  for (size_t s = 0; s < scans.size(); ++s) {
    parts.push_back(MakeTexturedParts(scans[s], colored[s], max_texture_size));
    const bool textured = scans[s].organised || !colored[s].atlas.empty();
    if (!textured && !colored[s].triangles.empty()) {
      parts.back().push_back(PartOfColors(colored[s], scans[s].points.size()));
    }
  }
  return parts;
}

void DecimateParts(const std::vector<Scan>& scans, size_t max_triangles, int num_threads,
                   std::vector<std::vector<TexturedPart>>* parts) {
  const size_t total = CountTriangles(*parts);
  if (max_triangles == 0 || total <= max_triangles) return;
  // The few large triangles of a small mesh hold more than as many small ones of a scan.
  const size_t kept = max_triangles / (2 * scans.size());
  size_t all_kept = 0;
  for (const std::vector<TexturedPart>& of_scan : *parts) {
    all_kept += std::min(kept, TrianglesOf(of_scan));
  }
  const double share_of_rest =
      static_cast<double>(max_triangles - all_kept) / static_cast<double>(total - all_kept);
  for (size_t s = 0; s < scans.size(); ++s) {
    std::vector<TexturedPart>& of_scan = (*parts)[s];
    const size_t num_triangles = TrianglesOf(of_scan);
    if (num_triangles <= kept) continue;
    const size_t wanted =
        kept + static_cast<size_t>(share_of_rest * static_cast<double>(num_triangles - kept));
    const double share = static_cast<double>(wanted) / static_cast<double>(num_triangles);
    int square_samples = 0;  // of an atlas: its texture runs straight in each chart
    if (scans[s].organised) {
      const double samples = std::sqrt(kTrianglesPerSquare / (2 * share));  // two triangles each
      square_samples = std::max(kLeastSquare, static_cast<int>(samples));
    }
    DecimateScan(scans[s], wanted, square_samples, num_threads, &of_scan);
  }
}

size_t CountTriangles(const std::vector<std::vector<TexturedPart>>& parts) {
  size_t count = 0;
  for (const std::vector<TexturedPart>& of_scan : parts) count += TrianglesOf(of_scan);
  return count;
}

}  // namespace roomtex
