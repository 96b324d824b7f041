// ScanSurface without a grid: points all over the triangles, cells are cubes of space.

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "align/surface/scan_surface.h"
#include "align/surface/visit_triangle.h"
#include "core/frames.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr double kMostCubes = 1500;         // along the longest side of the scan's box
constexpr double kLeastMeshNoise = 0.0005;  // metres; flat triangles show none of theirs
constexpr int kNumNeighbours = 26;

using Cube = Eigen::Vector3i;

// Cubes themselves are the keys: unlike with CellKey() (core/cell_key.h) no two are taken for one.
struct HashOfCube {
  size_t operator()(const Cube& c) const {
    uint64_t key = 0;
    for (int k = 0; k < 3; ++k) key = key * 0x9e3779b97f4a7c15ULL + static_cast<uint32_t>(c[k]);
    return static_cast<size_t>(key ^ (key >> 31));
  }
};

Cube CubeOf(const Eigen::Vector3d& x, double size) {
  return (x / size).array().floor().cast<int>().matrix();
}

// Offset number i of the 26 around a cube.
Cube Beside(const Cube& cube, int i) {
  const int k = i < kNumNeighbours / 2 ? i : i + 1;
  return cube + Cube(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
}

struct Fit {
  PlaneFit plane;
  double rms = 0, normal_sigma = 1, weight = 0;
};

Fit FitWindow(const Moments& moments, double least_noise) {
  Fit fit;
  fit.weight = moments.weight();
  if (fit.weight < kFewestSamples) return fit;
  fit.plane = FitPlane(moments);
  fit.rms =
      std::max(least_noise, std::sqrt(fit.plane.variances[0] * fit.weight / (fit.weight - 3)));
  fit.normal_sigma = fit.rms / std::sqrt(std::max(fit.plane.variances[1], 1e-12) * fit.weight);
  return fit;
}

}  // namespace

void ScanSurface::BuildMesh(const ScanPlaneOptions& options, int num_threads) {
  const Bounds bounds = FindBounds(scan_);
  if (!(bounds.min.x() <= bounds.max.x())) {
    neighbour_begin_ = {0};
    return;
  }
  const double size =
      std::max(1.25 * options.min_window, (bounds.max - bounds.min).maxCoeff() / kMostCubes);
  spacing_ = size / 4;
  std::unordered_map<Cube, int, HashOfCube> index_of;
  std::vector<Cube> cubes;
  std::vector<Moments> moments;
  std::vector<float> cube_areas;
  const auto add = [&](const Eigen::Vector3d& x, double area) {
    const Cube cube = CubeOf(x, size);
    const auto [at, is_new] = index_of.try_emplace(cube, static_cast<int>(cubes.size()));
    if (is_new) {
      cubes.push_back(cube);
      moments.emplace_back();
      cube_areas.push_back(0);
    }
    moments[at->second].Add(x);
    cube_areas[at->second] += static_cast<float>(area);
    points_.push_back(x);
    areas_.push_back(static_cast<float>(area));
    cell_of_.push_back(at->second);
  };
  for (const Triangle& t : scan_.triangles) {
    VisitTriangle(scan_.points[t[0]] - origin_, scan_.points[t[1]] - origin_,
                  scan_.points[t[2]] - origin_, spacing_, add);
  }
  if (scan_.triangles.empty()) {
    for (const Eigen::Vector3d& point : scan_.points) {
      if (point.x() == point.x()) add(point - origin_, 0);
    }
  }

  const int num_cells = static_cast<int>(cubes.size());
  neighbour_begin_.push_back(0);
  for (const Cube& cube : cubes) {
    for (int i = 0; i < kNumNeighbours; ++i) {
      const auto at = index_of.find(Beside(cube, i));
      if (at != index_of.end()) neighbours_.push_back(at->second);
    }
    neighbour_begin_.push_back(static_cast<int>(neighbours_.size()));
  }
  std::vector<std::pair<float, float>> observations;
  for (int i = 0; i < num_cells; ++i) {
    const Fit fit = FitWindow(moments[i], kLeastMeshNoise);
    if (fit.weight < 8 || fit.normal_sigma > kWorstNormalSigma) continue;
    observations.emplace_back((fit.plane.mean - station()).norm(), static_cast<float>(fit.rms));
  }
  noise_ = RangeNoise(std::move(observations));
  cells_.resize(num_cells);
  ParallelFor(num_threads, 0, num_cells, [&](int i) {
    // The cube and those around it; alone where that is no plane: beside an edge.
    Moments around = moments[i];
    ForNeighbours(i, [&](int other) { around.sums += moments[other].sums; });
    const auto roughness = [&](const Fit& f) {
      return f.rms / noise_.At((f.plane.mean - station()).norm());
    };
    Fit fit = FitWindow(around, kLeastMeshNoise);
    if (fit.weight < kFewestSamples) return;
    if (roughness(fit) > 1.3) {
      const Fit alone = FitWindow(moments[i], kLeastMeshNoise);
      if (alone.normal_sigma < kWorstNormalSigma && roughness(alone) < roughness(fit)) fit = alone;
    }
    SurfaceCell& cell = cells_[i];
    const Eigen::Vector3d mean = moments[i].sums.segment<3>(1).matrix() / moments[i].weight();
    Eigen::Vector3d normal = fit.plane.normal;
    if (normal.dot(station() - mean) < 0) normal *= -1;
    cell.point = mean - normal.dot(mean - fit.plane.mean) * normal;
    cell.normal = normal.cast<float>();
    cell.noise = static_cast<float>(fit.rms);
    cell.point_sigma = static_cast<float>(fit.rms / std::sqrt(fit.weight));
    cell.normal_sigma = static_cast<float>(fit.normal_sigma);
    cell.roughness = static_cast<float>(roughness(fit));
    cell.area = cube_areas[i] > 0 ? cube_areas[i] : static_cast<float>(size * size);
    cell.count = static_cast<int>(moments[i].weight());
    cell.flat = cell.roughness < kNotFlat && fit.normal_sigma < kWorstNormalSigma;
  });
}

}  // namespace roomtex
