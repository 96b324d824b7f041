#include "texture/scan_surface.h"

#include <algorithm>
#include <cmath>

#include "texture/grid_runs.h"

namespace roomtex {
namespace {

// The middle of a line fitted to the values around each position of a run: the mean inside, a
// line's value at the ends.
void SmoothRun(const std::vector<int>& run, int radius, const std::vector<float>& in,
               std::vector<float>* out) {
  const int n = static_cast<int>(run.size());
  for (int i = 0; i < n; ++i) {
    const int first = std::max(0, i - radius), last = std::min(n - 1, i + radius);
    float s0 = 0, s1 = 0, s2 = 0, t0 = 0, t1 = 0;
    for (int j = first; j <= last; ++j) {
      const float x = static_cast<float>(j - i), y = in[run[j]];
      s0 += 1;
      s1 += x;
      s2 += x * x;
      t0 += y;
      t1 += x * y;
    }
    const float determinant = s0 * s2 - s1 * s1;
    (*out)[run[i]] = determinant > 0 ? (t0 * s2 - t1 * s1) / determinant : in[run[i]];
  }
}

double Median(std::vector<float>* values) {
  if (values->empty()) return 0;
  const auto middle = values->begin() + values->size() / 2;
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

// Standard deviation of one sample's range: the second difference of inverse range vanishes on a
// plane, its noise is sqrt(6) times that of one sample. The median shrugs off edges and corners.
double EstimateRangeNoise(const Scan& scan, const GridLinks& links,
                          const std::vector<float>& inverse_range) {
  std::vector<float> deviations;
  const size_t stride = std::max<size_t>(1, inverse_range.size() / 200000);
  for (size_t i = 1; i + 1 < inverse_range.size(); i += stride) {
    if (i % scan.num_columns == 0 || (i + 1) % scan.num_columns == 0) continue;
    if (!(links.bits[i - 1] & GridLinks::kRight) || !(links.bits[i] & GridLinks::kRight)) continue;
    const float w = inverse_range[i];
    const float second = inverse_range[i - 1] - 2 * w + inverse_range[i + 1];
    deviations.push_back(std::abs(second) / (w * w));  // dr = dw / w^2
  }
  return 1.4826 * Median(&deviations) / std::sqrt(6.0);
}

double MedianAngularSpacing(const Scan& scan, const GridLinks& links) {
  std::vector<float> angles;
  const size_t stride = std::max<size_t>(1, links.bits.size() / 100000);
  for (size_t i = 0; i < links.bits.size(); i += stride) {
    if (!(links.bits[i] & GridLinks::kDown)) continue;
    const Eigen::Vector3d a = scan.points[i] - scan.Station();
    const Eigen::Vector3d b = scan.points[i + scan.num_columns] - scan.Station();
    angles.push_back(static_cast<float>(std::atan2(a.cross(b).norm(), a.dot(b))));
  }
  return Median(&angles);
}

void ReduceRangeNoise(const Scan& scan, const GridLinks& links, int radius, int num_threads,
                      ScanSurface* surface) {
  // Planes are linear in inverse range from ray to ray, so that fitting lines keeps them.
  const size_t count = scan.points.size();
  std::vector<float> inverse_range(count, 0.0f);
  for (size_t i = 0; i < count; ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    const double range = (scan.points[i] - scan.Station()).norm();
    if (range > 0) inverse_range[i] = static_cast<float>(1 / range);
  }
  surface->range_noise = EstimateRangeNoise(scan, links, inverse_range);
  const double limit = 3 * surface->range_noise;
  if (!(limit > 0) || radius < 1) return;
  std::vector<float> along_rows = inverse_range;
  ForEachRun(scan, links, false, num_threads, [&](const std::vector<int>& run, int) {
    SmoothRun(run, radius, inverse_range, &along_rows);
  });
  std::vector<float> smooth = along_rows;
  ForEachRun(scan, links, true, num_threads, [&](const std::vector<int>& run, int) {
    SmoothRun(run, radius, along_rows, &smooth);
  });
  for (size_t i = 0; i < count; ++i) {
    if (!(inverse_range[i] > 0) || !(smooth[i] > 0)) continue;
    const double range = 1.0 / inverse_range[i], better = 1.0 / smooth[i];
    // A larger move is no noise but shape: edges and corners keep their measured place.
    if (std::abs(better - range) > limit) continue;
    surface->points[i] = scan.Station() + (better / range) * (scan.points[i] - scan.Station());
  }
}

}  // namespace

std::vector<std::string> ScanSurfaceOptions::Problems() const {
  if (smoothing_radius < 1 || smoothing_radius > 50) {
    return {"--Surface.smoothing_radius must be 1 to 50 samples"};
  }
  return {};
}

GridLinks FindGridLinks(const Scan& scan, const std::vector<Triangle>& triangles) {
  GridLinks links;
  links.bits.assign(scan.points.size(), 0);
  if (!scan.organised) return links;
  const int columns = scan.num_columns;
  for (const Triangle& t : triangles) {
    for (int k = 0; k < 3; ++k) {
      const int a = std::min(t[k], t[(k + 1) % 3]), b = std::max(t[k], t[(k + 1) % 3]);
      if (b - a == columns) {
        links.bits[a] |= GridLinks::kDown;
      } else if (a / columns == b / columns) {
        if (b - a == 1) links.bits[a] |= GridLinks::kRight;
        if (b - a == columns - 1 && columns > 2) links.bits[b] |= GridLinks::kRight;  // closed turn
      }
    }
  }
  return links;
}

ScanSurface MakeScanSurface(const Scan& scan, const ScanMeshOptions& mesh_options,
                            const ScanSurfaceOptions& options, int num_threads) {
  ScanSurface surface;
  surface.triangles = BuildScanMesh(scan, mesh_options);
  surface.links = FindGridLinks(scan, surface.triangles);
  surface.points = scan.points;
  if (!scan.organised) {
    surface.normals = VertexNormals(scan, surface.triangles);
    return surface;
  }
  surface.angular_spacing = MedianAngularSpacing(scan, surface.links);
  if (options.reduce_range_noise) {
    ReduceRangeNoise(scan, surface.links, options.smoothing_radius, num_threads, &surface);
  }
  Scan smooth;
  smooth.num_columns = scan.num_columns;
  smooth.num_rows = scan.num_rows;
  smooth.points.swap(surface.points);
  surface.normals = VertexNormals(smooth, surface.triangles);
  surface.points.swap(smooth.points);
  return surface;
}

}  // namespace roomtex
