#include "capture/simulation/room_light.h"

#include <algorithm>
#include <cmath>

#include "core/frames.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr double kSpacing = 0.05;  // metres between the nodes of a grid
constexpr int kLightSide = 4;      // shadow rays per light: its square
// Metres above a surface: what hangs flat on a wall throws no shadow.
constexpr double kLift = 0.01;
constexpr double kAmbientReach = 1.0;  // metres: what is farther away takes no ambient light

// Directions over the half-sphere around `normal`, equally weighted under the cosine law.
std::vector<Eigen::Vector3d> SkyDirections(const Eigen::Vector3d& normal, int rings, int sectors) {
  const Eigen::Vector3d x = normal.unitOrthogonal(), y = normal.cross(x);
  std::vector<Eigen::Vector3d> directions;
  for (int ring = 0; ring < rings; ++ring) {
    const double sin2 = (ring + 0.5) / rings;
    for (int sector = 0; sector < sectors; ++sector) {
      const double angle = 2 * kPi * (sector + 0.5 * (ring & 1)) / sectors;
      directions.push_back(std::sqrt(sin2) * (std::cos(angle) * x + std::sin(angle) * y) +
                           std::sqrt(1 - sin2) * normal);
    }
  }
  return directions;
}

LinearRgb LightFrom(const AreaLight& light, const Eigen::Vector3d& point,
                    const Eigen::Vector3d& normal, const LightMap::IsFree& is_free) {
  const Eigen::Vector3d outward = light.edge_t.cross(light.edge_s).normalized();
  double sum = 0;
  for (int i = 0; i < kLightSide * kLightSide; ++i) {
    // Stratified and sheared, so that no row of samples crosses an edge at once.
    const double s = (i % kLightSide + 0.5 + 0.2 * (i / kLightSide - 1.5)) / kLightSide;
    const double t = (i / kLightSide + 0.5 + 0.2 * (1.5 - i % kLightSide)) / kLightSide;
    const Eigen::Vector3d source = light.corner + s * light.edge_s + t * light.edge_t;
    const Eigen::Vector3d offset = source - point;
    const double distance = offset.norm();
    const double cos_here = normal.dot(offset) / distance;
    const double cos_there = -outward.dot(offset) / distance;
    if (cos_here <= 0 || cos_there <= 0) continue;
    if (!is_free(point, source)) continue;
    // Near the light the inverse square would burn out.
    sum += cos_here * cos_there / std::max(distance * distance, 0.3);
  }
  return light.power * static_cast<float>(sum / (kLightSide * kLightSide));
}

LinearRgb LightAt(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                  const std::vector<AreaLight>& lights, const LightMap::IsFree& is_free,
                  const LightMap::Sight& sight) {
  LinearRgb light = LinearRgb::Zero();
  for (const AreaLight& area : lights) light += LightFrom(area, point, normal, is_free);
  const LinearRgb ambient(0.50f, 0.48f, 0.45f);
  if (sight) {
    double open = 0;
    const auto directions = SkyDirections(normal, 8, 16);
    for (const Eigen::Vector3d& direction : directions) {
      open += std::min(sight(point, direction) / kAmbientReach, 1.0);
    }
    return light + ambient * static_cast<float>(0.25 + 0.75 * open / directions.size());
  }
  int free = 0, count = 0;
  for (const Eigen::Vector3d& direction : SkyDirections(normal, 4, 8)) {
    free += is_free(point, point + kAmbientReach * direction) ? 1 : 0;
    ++count;
  }
  return light + ambient * (0.25f + 0.75f * static_cast<float>(free) / static_cast<float>(count));
}

}  // namespace

LightMap::LightMap(const std::vector<Patch>& patches, const std::vector<AreaLight>& lights,
                   const IsFree& is_free, const Sight& sight, int num_threads)
    : grids_(patches.size()) {
  ParallelFor(num_threads, 0, static_cast<int>(patches.size()), [&](int index) {
    const Patch& patch = patches[index];
    Grid& grid = grids_[index];
    if (patch.shines) {
      grid = {2, 2, std::vector<LinearRgb>(4, LinearRgb::Ones())};
      return;
    }
    const double length_s = patch.edge_s.norm(), length_t = patch.edge_t.norm();
    grid.columns = 2 + static_cast<int>(length_s / kSpacing);
    grid.rows = 2 + static_cast<int>(length_t / kSpacing);
    const Eigen::Vector3d normal = patch.Normal();
    // Nodes on an edge are asked a little inside, or the neighbouring face would hide the light.
    const double inset_s = std::min(0.004 / length_s, 0.2),
                 inset_t = std::min(0.004 / length_t, 0.2);
    for (int row = 0; row < grid.rows; ++row) {
      for (int column = 0; column < grid.columns; ++column) {
        const double s =
            std::clamp(static_cast<double>(column) / (grid.columns - 1), inset_s, 1 - inset_s);
        const double t =
            std::clamp(static_cast<double>(row) / (grid.rows - 1), inset_t, 1 - inset_t);
        const Eigen::Vector3d point = patch.At(s, t);
        LinearRgb light = LightAt(point + kLift * normal, normal, lights, is_free, sight);
        if (patch.two_sided) {
          light = 0.5f * (light + LightAt(point - kLift * normal, -normal, lights, is_free, sight));
        }
        grid.nodes.push_back(light);
      }
    }
  });
}

LinearRgb LightMap::At(int patch, double s, double t) const {
  const Grid& grid = grids_[patch];
  const double x = std::clamp(s, 0.0, 1.0) * (grid.columns - 1);
  const double y = std::clamp(t, 0.0, 1.0) * (grid.rows - 1);
  const int column = std::min(static_cast<int>(x), grid.columns - 2);
  const int row = std::min(static_cast<int>(y), grid.rows - 2);
  const auto a = static_cast<float>(x - column), b = static_cast<float>(y - row);
  const LinearRgb* node = &grid.nodes[row * grid.columns + column];
  const LinearRgb top = (1 - a) * node[0] + a * node[1];
  const LinearRgb bottom = (1 - a) * node[grid.columns] + a * node[grid.columns + 1];
  return (1 - b) * top + b * bottom;
}

}  // namespace roomtex
