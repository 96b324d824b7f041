#include "align/trust/disagreement.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "align/surface/surface_cells.h"
#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr int kMinPointsOfCell = 5;
// Metres; farther from the surface a point belongs to none. No less than this ...
constexpr double kLeastReach = 0.015, kMostReach = 0.3;
// ... and this many times the typical distance.
constexpr double kReach = 5;

struct OnSurface {
  size_t point = 0;
  int patch = 0;
  double distance = 0, variance = 0;  // metres, metres^2
};

std::vector<OnSurface> PointsNear(const std::vector<SurfacePoint>& points,
                                  const ScanPatches& surface, const Similarity& scan_from_sparse,
                                  const ScanBend& bend, double reach) {
  const Eigen::Matrix3d linear =
      scan_from_sparse.scale * scan_from_sparse.rotation.toRotationMatrix();
  std::vector<OnSurface> near;
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d x = bend.Bend(scan_from_sparse * points[i].x_in_sparse);
    const auto nearest = surface.FindNearest(x, std::hypot(reach, surface.cell_size()));
    if (!nearest || !(std::abs(nearest->distance) < reach)) continue;
    const ScanPatch& patch = surface.patches()[nearest->patch];
    const Eigen::Vector3d normal = linear.transpose() * patch.normal;
    if (!(normal.dot(points[i].to_cameras) > 0)) continue;
    near.push_back({i, nearest->patch, nearest->distance,
                    normal.dot(points[i].covariance * normal) +
                        patch.thickness * patch.thickness / patch.num_samples});
  }
  return near;
}

}  // namespace

ShapeDisagreement FindDisagreement(const SparseModel& model,
                                   const std::vector<SurfacePoint>& points,
                                   const ScanPatches& surface, const Similarity& scan_from_sparse,
                                   const ScanBend& bend) {
  std::vector<OnSurface> near = PointsNear(points, surface, scan_from_sparse, bend, kMostReach);
  std::vector<double> distances;
  for (const OnSurface& one : near) distances.push_back(std::abs(one.distance));
  const double reach = std::max(kLeastReach, kReach * kSigmaPerMad * Median(distances));
  near.erase(std::remove_if(near.begin(), near.end(),
                            [&](const OnSurface& one) { return std::abs(one.distance) > reach; }),
             near.end());

  std::vector<Eigen::Vector3d> places, normals;
  for (const OnSurface& one : near) {
    places.push_back(surface.patches()[one.patch].point);
    normals.push_back(surface.patches()[one.patch].normal);
  }
  const SurfaceCells cells(places, normals);
  std::vector<std::vector<double>> of_cell(cells.NumCells()), variances(cells.NumCells());
  for (size_t i = 0; i < near.size(); ++i) {
    of_cell[cells.Cell(i)].push_back(near[i].distance);
    variances[cells.Cell(i)].push_back(near[i].variance);
  }
  std::vector<double> excess(cells.NumCells(), 0);  // metres^2
  ShapeDisagreement result;
  double sum = 0;
  for (int cell = 0; cell < cells.NumCells(); ++cell) {
    const auto n = static_cast<double>(of_cell[cell].size());
    if (n < kMinPointsOfCell) continue;
    // The variance of a median is pi / 2 times that of a mean. Below 0 counts, too: cut off cell by
    // cell, half of mere noise would stay.
    excess[cell] = 3 * (std::pow(Median(of_cell[cell]), 2) - kPi / 2 * Median(variances[cell]) / n);
    sum += excess[cell];
    ++result.num_cells;
  }
  result.rms = result.num_cells > 0 ? std::sqrt(std::max(0.0, sum) / result.num_cells) : 0;

  struct Sum {
    double shift2 = 0, turn2 = 0;
    int count = 0;
  };
  std::map<uint32_t, Sum> sums;
  for (size_t i = 0; i < near.size(); ++i) {
    const int cell = cells.Cell(i);
    if (of_cell[cell].size() < kMinPointsOfCell) continue;
    const SparsePoint& point = model.points.at(points[near[i].point].point3d_id);
    for (const TrackElement& element : point.track) {
      const Eigen::Vector3d x_in_cam =
          model.images.at(element.image_id).cam_from_model * point.x_in_model;
      const double range = scan_from_sparse.scale * x_in_cam.norm();
      if (!(range > 0)) continue;
      Sum& photo = sums[element.image_id];
      photo.shift2 += excess[cell];
      photo.turn2 += excess[cell] / (range * range);
      ++photo.count;
    }
  }
  for (const auto& [id, photo] : sums) {
    result.photos[id] = {std::sqrt(std::max(0.0, photo.shift2) / photo.count),
                         std::sqrt(std::max(0.0, photo.turn2) / photo.count)};
  }
  return result;
}

}  // namespace roomtex
