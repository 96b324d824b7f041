#pragma once
// The light that arrives at the surfaces of the simulated room, computed once on a grid per patch:
// area lights with soft shadows and an even ambient light that corners receive less of.

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "capture/simulation/room_scene.h"

namespace roomtex {

class LightMap {
 public:
  // Nothing stands between the two points.
  using IsFree = std::function<bool(const Eigen::Vector3d& from, const Eigen::Vector3d& to)>;
  // Distance to what is nearest in a (unit) direction from a point; infinity for nothing.
  using Sight =
      std::function<double(const Eigen::Vector3d& from, const Eigen::Vector3d& direction)>;
  // Deterministic; patches side by side. sight: may be null; makes the ambient light smooth, for
  // surfaces whose texture would not hide its steps.
  LightMap(const std::vector<Patch>& patches, const std::vector<AreaLight>& lights,
           const IsFree& is_free, const Sight& sight, int num_threads);

  // Factor on the albedo at (s, t) of a patch, about 0.1 .. 1.
  LinearRgb At(int patch, double s, double t) const;

 private:
  struct Grid {
    int columns = 0, rows = 0;
    std::vector<LinearRgb> nodes;
  };
  std::vector<Grid> grids_;
};

}  // namespace roomtex
