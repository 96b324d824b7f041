#pragma once
// Points all over a triangle, for scans that are meshes without a grid.

#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace roomtex {

// Calls visit(point, area) with points at most `spacing` metres apart and the area that each stands
// for; never for a triangle that is not finite.
template <typename Visit>
void VisitTriangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                   double spacing, const Visit& visit) {
  // Along an edge: the floor of a hall of 90 m has points of 1.5 cm; one absurd triangle takes a
  // second and not hours.
  constexpr int kMaxSteps = 6000;
  const Eigen::Vector3d ab = b - a, ac = c - a;
  const double longest = std::max({ab.norm(), ac.norm(), (ab - ac).norm()});
  if (!std::isfinite(longest)) return;
  const int steps = std::clamp(static_cast<int>(std::ceil(longest / spacing)), 1, kMaxSteps);
  const double area = ab.cross(ac).norm() / 2 / (steps * (steps + 1) / 2);
  for (int i = 0; i < steps; ++i) {
    for (int k = 0; i + k < steps; ++k) {
      // Centre of a small triangle: no point lies on an edge and is met twice.
      visit(Eigen::Vector3d(a + (i + 1.0 / 3) / steps * ab + (k + 1.0 / 3) / steps * ac), area);
    }
  }
}

}  // namespace roomtex
