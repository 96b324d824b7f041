#pragma once
// The light that arrives at the surfaces of the simulated room, computed once on a grid per patch:
// area lights with soft shadows and an even ambient light that corners receive less of.

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "capture/room_scene.h"

namespace roomtex {

class LightMap {
 public:
  // Nothing is nearer than `distance` in this direction from a point.
  using IsFree = std::function<bool(const Eigen::Vector3d& from, const Eigen::Vector3d& to)>;
  // Deterministic; patches side by side.
  LightMap(const std::vector<Patch>& patches, const std::vector<AreaLight>& lights,
           const IsFree& is_free, int num_threads);

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
