#include "texture/export/export_scene.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_map>

#include <opencv2/core.hpp>

#include "core/cell_key.h"
#include "core/error.h"
#include "importers/ply.h"
#include "texture/sampling/looked_past.h"

namespace roomtex {
namespace {

constexpr int kMinViews = 2;  // of a point: fewer say nothing about depth

struct Candidate {
  Eigen::Vector3d x_in_scan;
  int slot;
};

// The candidate nearest to the middle of each cell, in the order of the candidates.
std::vector<int> OnePerCell(const std::vector<Candidate>& candidates, double cell) {
  struct Nearest {
    int index;
    double distance2;
  };
  std::unordered_map<uint64_t, Nearest> nearest;
  for (size_t i = 0; i < candidates.size(); ++i) {
    const Eigen::Vector3d position = candidates[i].x_in_scan / cell;
    const Eigen::Vector3d low = position.array().floor();
    const uint64_t key = CellKey(low.array());
    const double distance2 = (position - low - Eigen::Vector3d::Constant(0.5)).squaredNorm();
    const auto [found, is_new] = nearest.try_emplace(key, Nearest{static_cast<int>(i), distance2});
    if (!is_new && distance2 < found->second.distance2) {
      found->second = {static_cast<int>(i), distance2};
    }
  }
  std::vector<int> chosen;
  for (const auto& [key, entry] : nearest) chosen.push_back(entry.index);
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

// The finest lattice whose cells hold at most max_points: edges of cells grow by 5 %.
std::vector<int> SpreadEvenly(const std::vector<Candidate>& candidates, int max_points) {
  if (static_cast<int>(candidates.size()) <= max_points) {
    std::vector<int> all(candidates.size());
    for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
    return all;
  }
  Eigen::Vector3d low = candidates[0].x_in_scan, high = low;
  for (const Candidate& candidate : candidates) {
    low = low.cwiseMin(candidate.x_in_scan);
    high = high.cwiseMax(candidate.x_in_scan);
  }
  const Eigen::Vector3d size = high - low;
  // Of a surface about half as large as that of its box.
  const double area = size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
  double cell = std::max(std::sqrt(area / max_points), size.maxCoeff() / 1e6);
  std::vector<int> chosen = OnePerCell(candidates, cell);
  constexpr double kStep = 1.05;
  while (static_cast<int>(chosen.size()) > max_points) {
    cell *= std::max(kStep, std::sqrt(static_cast<double>(chosen.size()) / max_points));
    chosen = OnePerCell(candidates, cell);
  }
  while (static_cast<int>(chosen.size()) < 0.85 * max_points) {
    cell *= std::max(0.5, std::sqrt(static_cast<double>(chosen.size()) / (0.95 * max_points)));
    std::vector<int> finer = OnePerCell(candidates, cell);
    if (static_cast<int>(finer.size()) > max_points) break;
    chosen = std::move(finer);
  }
  return chosen;
}

// Points in the cells of a lattice, to find the nearest one.
class PointLattice {
 public:
  // edge: of a cell; a few points each are best.
  PointLattice(const std::vector<Eigen::Vector3d>& points, double edge)
      : points_(points), edge_(edge) {
    for (size_t i = 0; i < points.size(); ++i) {
      if (points[i].allFinite()) of_cell_[CellKey(points[i], edge_)].push_back(static_cast<int>(i));
    }
  }

  // -1 = none within `reach` cells.
  int Nearest(const Eigen::Vector3d& place, int reach) const {
    const Eigen::Vector3d middle = CellOf(place);
    int nearest = -1;
    double least = std::numeric_limits<double>::infinity();
    for (int ring = 0; ring <= reach; ++ring) {
      // Nothing of this ring or a later one is nearer than that.
      if (nearest >= 0 && least <= (ring - 1) * edge_) break;
      for (int x = -ring; x <= ring; ++x) {
        for (int y = -ring; y <= ring; ++y) {
          const bool is_side = std::max(std::abs(x), std::abs(y)) == ring;
          for (int z = -ring; z <= ring; z += is_side || ring == 0 ? 1 : 2 * ring) {
            const auto found = of_cell_.find(CellKey(middle.array() + Eigen::Array3d(x, y, z)));
            if (found == of_cell_.end()) continue;
            for (const int i : found->second) {
              const double distance = (points_[i] - place).norm();
              if (distance < least) {
                least = distance;
                nearest = i;
              }
            }
          }
        }
      }
    }
    return nearest;
  }

 private:
  Eigen::Vector3d CellOf(const Eigen::Vector3d& place) const {
    return (place / edge_).array().floor();
  }
  const std::vector<Eigen::Vector3d>& points_;
  double edge_;
  std::unordered_map<uint64_t, std::vector<int>> of_cell_;
};

double AreaOf(const Scan& mesh) {
  double area = 0;
  for (const Triangle& t : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.points[t[0]];
    area += (mesh.points[t[1]] - a).cross(mesh.points[t[2]] - a).norm() / 2;
  }
  return area;
}

}  // namespace

ColorGrid ColorsOfSurface(const Scan& cloud, const ColorGrid& colors, const Scan& surface) {
  ColorGrid found;
  found.num_columns = surface.num_columns;
  found.num_rows = surface.num_rows;
  found.rgb.assign(surface.points.size(), {0, 0, 0});
  found.views.assign(surface.points.size(), 0);
  const double spacing = std::sqrt(AreaOf(surface) / static_cast<double>(cloud.points.size()));
  if (!(spacing > 0)) return found;
  const PointLattice lattice(cloud.points, 2 * spacing);
  constexpr int kReach = 8;  // a corner lies half way to the next points at most
  for (size_t i = 0; i < surface.points.size(); ++i) {
    if (surface.IsMissing(static_cast<int>(i))) continue;
    const int nearest = lattice.Nearest(surface.points[i], kReach);
    if (nearest < 0) continue;
    found.rgb[i] = colors.rgb[nearest];
    found.views[i] = colors.views[nearest];
  }
  return found;
}

ScanColors ReadScanColors(const std::vector<Scan>& scans, const std::string& model_ply) {
  PlyOptions options;
  options.clouds = true;
  PlyVertexValues values{{"red", "green", "blue", "views"}, {}};
  const Scan model = ReadPly(model_ply, options, nullptr, &values);
  const char* const remedy = "Give the model.ply that roomtex-texture wrote for these scans";
  for (size_t k = 0; k < values.names.size(); ++k) {
    if (values.values[k].size() != model.points.size()) {
      throw InputError(model_ply, "", "has no vertex property " + values.names[k], remedy);
    }
  }
  ScanColors colors;
  size_t next = 0;
  for (const Scan& scan : scans) {
    ColorGrid grid;
    grid.num_columns = scan.num_columns;
    grid.num_rows = scan.num_rows;
    grid.rgb.assign(scan.points.size(), {0, 0, 0});
    grid.views.assign(scan.points.size(), 0);
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      constexpr double kSame = 1e-3;  // metres; more than a float's rounding in a large frame
      if (next >= model.points.size() || !((model.points[next] - scan.points[i]).norm() < kSame)) {
        throw InputError(model_ply, "vertex " + std::to_string(next),
                         "is not the sample of the scan that should stand there", remedy);
      }
      for (int k = 0; k < 3; ++k) {
        grid.rgb[i][k] = cv::saturate_cast<uint8_t>(values.values[k][next]);
      }
      grid.views[i] = cv::saturate_cast<uint8_t>(values.values[3][next]);
      ++next;
    }
    colors.push_back(std::move(grid));
  }
  return colors;
}

ExportScene MakeExportScene(const std::vector<Scan>& scans, const ScanColors& colors,
                            int max_points, int num_threads) {
  ExportScene scene;
  PhotoPassInput input;
  std::vector<Candidate> candidates;
  ShadowsOfStations shadows;
  for (size_t s = 0; s < scans.size(); ++s) {
    const Scan& scan = scans[s];
    const SmoothedScan surface = MakeSmoothedScan(scan, {}, {}, num_threads);
    scene.occluders.push_back(MakeOccluderTiles(scan, surface));
    if (scan.organised) {
      shadows.Take(scan, surface.angular_spacing, surface.range_noise, &scene.occluders.back());
    }
    if (surface.angular_spacing > 0 &&
        (!(scene.angular_spacing > 0) || surface.angular_spacing < scene.angular_spacing)) {
      scene.angular_spacing = surface.angular_spacing;
    }
    const Eigen::Vector3d station =
        scan.organised ? scan.Station() : Eigen::Vector3d(Scan::MissingPoint());
    const GridOfSamples grid =
        AddGrid(scan.num_columns, scan.num_rows, surface.points, surface.normals, station, &input);
    scene.colors.resize(NumSlots(input));
    scene.views.resize(NumSlots(input));
    for (size_t t = grid.first_tile; t < grid.end_tile; ++t) {
      const SampleTile& tile = input.samples[t];
      for (int i = 0; i < tile.points.size(); ++i) {
        const int slot = tile.first_slot + i;
        scene.colors[slot] = colors[s].rgb[tile.index[i]];
        scene.views[slot] = colors[s].views[tile.index[i]];
        // Samples without a triangle are strays at depth jumps.
        if (scene.views[slot] < kMinViews || tile.normals[i].isZero()) continue;
        candidates.push_back({surface.points[tile.index[i]], slot});
      }
    }
  }
  if (!scans.empty()) shadows.Give(&scene.occluders.back(), num_threads);
  scene.samples = std::move(input.samples);
  scene.point_of_sample.assign(scene.colors.size(), -1);
  for (const int i : SpreadEvenly(candidates, max_points)) {
    scene.point_of_sample[candidates[i].slot] = static_cast<int>(scene.points.size());
    scene.points.push_back({candidates[i].x_in_scan, scene.colors[candidates[i].slot]});
  }
  return scene;
}

}  // namespace roomtex
