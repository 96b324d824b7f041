#include "texture/texels/mesh_charts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>

#include <Eigen/Geometry>

#include "core/frames.h"

namespace roomtex {
namespace {

// For every edge of every triangle the triangle on its other side; -1 where there is none or more
// than one.
std::vector<std::array<int, 3>> FindNeighbours(const std::vector<Triangle>& triangles) {
  struct Edge {
    int a, b, triangle, side;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * triangles.size());
  for (size_t t = 0; t < triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int p = triangles[t][k], q = triangles[t][(k + 1) % 3];
      edges.push_back({std::min(p, q), std::max(p, q), static_cast<int>(t), k});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) {
    return std::tie(x.a, x.b, x.triangle, x.side) < std::tie(y.a, y.b, y.triangle, y.side);
  });
  std::vector<std::array<int, 3>> neighbours(triangles.size(), {-1, -1, -1});
  for (size_t first = 0; first < edges.size();) {
    size_t end = first + 1;
    while (end < edges.size() && edges[end].a == edges[first].a && edges[end].b == edges[first].b) {
      ++end;
    }
    if (end - first == 2) {
      neighbours[edges[first].triangle][edges[first].side] = edges[first + 1].triangle;
      neighbours[edges[first + 1].triangle][edges[first + 1].side] = edges[first].triangle;
    }
    first = end;
  }
  return neighbours;
}

// Replaces the normals of small triangles by the mean over their surroundings.
void SmoothNormals(const std::vector<std::array<int, 3>>& neighbours,
                   const std::vector<double>& areas, double smooth_below,
                   std::vector<Eigen::Vector3d>* normals) {
  constexpr int kRings = 12;
  const double small = 0.5 * smooth_below * smooth_below;  // half a square
  if (!(small > 0)) return;
  std::vector<Eigen::Vector3d> next = *normals;
  for (int ring = 0; ring < kRings; ++ring) {
    for (size_t t = 0; t < areas.size(); ++t) {
      if (!(areas[t] > 0) || areas[t] >= small) continue;
      Eigen::Vector3d sum = (*normals)[t];
      for (const int other : neighbours[t]) {
        if (other >= 0 && areas[other] < small) sum += (*normals)[other];
      }
      if (sum.norm() > 1e-6) next[t] = sum.normalized();
    }
    normals->swap(next);
  }
}

}  // namespace

MeshCharts GrowCharts(const std::vector<Eigen::Vector3d>& points,
                      const std::vector<Triangle>& triangles, const ChartOptions& options) {
  const int count = static_cast<int>(triangles.size());
  std::vector<Eigen::Vector3d> normals(count, Eigen::Vector3d::Zero());
  std::vector<double> areas(count, 0);
  for (int t = 0; t < count; ++t) {
    const auto& [a, b, c] = triangles[t];
    const Eigen::Vector3d normal = (points[b] - points[a]).cross(points[c] - points[a]);
    const double longest =
        std::max({(points[b] - points[a]).squaredNorm(), (points[c] - points[b]).squaredNorm(),
                  (points[a] - points[c]).squaredNorm()});
    const double norm = normal.norm();
    if (!(norm > 1e-9 * longest) || !std::isfinite(norm)) continue;
    areas[t] = 0.5 * norm;
    normals[t] = normal / norm;
  }
  std::vector<int> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return areas[a] > areas[b]; });
  const std::vector<std::array<int, 3>> neighbours = FindNeighbours(triangles);
  SmoothNormals(neighbours, areas, options.smooth_below, &normals);

  MeshCharts charts;
  charts.chart_of.assign(count, -1);
  const double min_cosine = std::cos(RadFromDeg(options.max_angle_deg));
  std::vector<int> front;
  for (const int seed : order) {
    if (!(areas[seed] > 0)) break;
    if (charts.chart_of[seed] >= 0) continue;
    const int chart = static_cast<int>(charts.normals.size());
    charts.normals.push_back(normals[seed]);
    Eigen::Vector3d low = points[triangles[seed][0]], high = low;
    const auto take = [&](int t) {
      Eigen::Vector3d new_low = low, new_high = high;
      for (const int corner : triangles[t]) {
        new_low = new_low.cwiseMin(points[corner]);
        new_high = new_high.cwiseMax(points[corner]);
      }
      if (t != seed && (new_high - new_low).maxCoeff() > options.max_extent) return;
      low = new_low;
      high = new_high;
      charts.chart_of[t] = chart;
      front.push_back(t);
    };
    front.clear();
    take(seed);
    for (size_t next = 0; next < front.size(); ++next) {  // breadth first: compact charts
      for (const int t : neighbours[front[next]]) {
        if (t < 0 || charts.chart_of[t] >= 0 || !(areas[t] > 0)) continue;
        if (normals[t].dot(normals[seed]) >= min_cosine) take(t);
      }
    }
  }
  return charts;
}

}  // namespace roomtex
