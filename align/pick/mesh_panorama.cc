#include "align/pick/mesh_panorama.h"

#include <algorithm>
#include <cmath>

#include "core/frames.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

// The scanner's place is the best of a lattice in the middle of the bounding box.
constexpr int kPlaces = 5;              // along each axis
constexpr double kMiddleShare = 0.6;    // of the box, from its middle
constexpr int kProbes = 96;             // rays that tell how free a place is
constexpr double kMinSeenShare = 0.35;  // of them that must meet something: else it is outside

// Directions evenly over the sphere (Fibonacci lattice).
Eigen::Vector3d Probe(int index) {
  const double z = 1 - (2 * index + 1.0) / kProbes;
  const double angle = index * kPi * (3 - std::sqrt(5.0));
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

// Metres to the nearest surface; negative outside the mesh.
double Freedom(const RayCaster& caster, const Eigen::Vector3d& place) {
  double nearest = std::numeric_limits<double>::infinity();
  int seen = 0;
  for (int i = 0; i < kProbes; ++i) {
    const auto hit = caster.Cast(place, Probe(i));
    if (!hit) continue;
    ++seen;
    nearest = std::min(nearest, hit->distance);
  }
  return seen < kMinSeenShare * kProbes ? -1.0 / (1 + seen) : nearest;
}

Eigen::Vector3d FindPlace(const Scan& mesh, const RayCaster& caster) {
  const Bounds bounds = FindBounds(mesh);
  const Eigen::Vector3d middle = 0.5 * (bounds.min + bounds.max);
  const Eigen::Vector3d half = 0.5 * kMiddleShare * (bounds.max - bounds.min);
  Eigen::Vector3d best = middle;
  double best_freedom = -2;
  for (int k = 0; k < kPlaces * kPlaces * kPlaces; ++k) {
    const Eigen::Vector3d at(k % kPlaces, k / kPlaces % kPlaces, k / (kPlaces * kPlaces));
    const Eigen::Vector3d share = 2 * at / (kPlaces - 1) - Eigen::Vector3d::Ones();
    const Eigen::Vector3d place = middle + half.cwiseProduct(share);
    // Of two places as free, the one nearer to the middle.
    const double freedom = Freedom(caster, place) * (1 - 0.1 * share.norm());
    if (freedom <= best_freedom) continue;
    best_freedom = freedom;
    best = place;
  }
  return best;
}

float IntensityAt(const Scan& mesh, const RayHit& hit) {
  const Triangle& t = mesh.triangles[hit.triangle];
  const Eigen::Vector3d& a = mesh.points[t[0]];
  const Eigen::Vector3d ab = mesh.points[t[1]] - a, ac = mesh.points[t[2]] - a, ap = hit.point - a;
  const Eigen::Vector3d normal = ab.cross(ac);
  const double area2 = normal.squaredNorm();
  if (!(area2 > 0)) return mesh.intensity[t[0]];
  const double v = std::clamp(ap.cross(ac).dot(normal) / area2, 0.0, 1.0);
  const double w = std::clamp(ab.cross(ap).dot(normal) / area2, 0.0, 1 - v);
  return static_cast<float>((1 - v - w) * mesh.intensity[t[0]] + v * mesh.intensity[t[1]] +
                            w * mesh.intensity[t[2]]);
}

}  // namespace

int PanoramaColumns(const Scan& mesh) {
  constexpr int kStep = 512;  // of the tiles
  const double columns = 1.5 * std::sqrt(2.0 * static_cast<double>(mesh.points.size()));
  return kStep * std::clamp(static_cast<int>(std::ceil(columns / kStep)), 4, 8);
}

Scan PanoramaOfMesh(const Scan& mesh, const RayCaster& caster, int num_columns, int num_threads) {
  Scan panorama;
  panorama.path = mesh.path;
  panorama.num_columns = num_columns;
  panorama.num_rows = num_columns / 2;
  panorama.up = mesh.up;
  panorama.scan_from_station.translation = FindPlace(mesh, caster);
  // Station: y up, z backward, as RTPI.
  const Eigen::Vector3d forward = mesh.up.unitOrthogonal(), right = forward.cross(mesh.up);
  Eigen::Matrix3d axes;
  axes << right, mesh.up, -forward;
  panorama.scan_from_station.rotation = Eigen::Quaterniond(axes);
  const size_t size = static_cast<size_t>(panorama.num_columns) * panorama.num_rows;
  panorama.points.assign(size, Scan::MissingPoint());
  panorama.intensity.assign(size, 0.0f);
  const double step = 2 * kPi / num_columns;
  ParallelFor(num_threads, 0, panorama.num_rows, [&](int row) {
    const double elevation = 0.5 * kPi - (row + 0.5) * step;
    for (int column = 0; column < panorama.num_columns; ++column) {
      const double azimuth = (column + 0.5) * step - kPi;
      const Eigen::Vector3d direction =
          axes * Eigen::Vector3d(std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                                 -std::cos(azimuth) * std::cos(elevation));
      const auto hit = caster.Cast(panorama.Station(), direction);
      if (!hit) continue;
      panorama.points[panorama.Index(column, row)] = hit->point;
      panorama.intensity[panorama.Index(column, row)] = IntensityAt(mesh, *hit);
    }
  });
  return panorama;
}

}  // namespace roomtex
