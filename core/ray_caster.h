#pragma once
// Nearest surface along a ray, by Embree (Wald et al. 2014, "Embree: A Kernel Framework for
// Efficient CPU Ray Tracing").

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

struct RayHit {
  double distance = 0;  // metres along the unit direction
  int triangle = -1;    // index into the triangles given to the caster
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
};

// A triangle mesh to shoot rays at; safe to use from several threads. Coordinates are recentred on
// the mesh, so that georeferenced scans keep their millimetres in Embree's floats.
class RayCaster {
 public:
  // points may hold NaN (missing samples) where no triangle refers to them.
  RayCaster(const std::vector<Eigen::Vector3d>& points, const std::vector<Triangle>& triangles);
  ~RayCaster();
  RayCaster(RayCaster&&) noexcept;
  RayCaster& operator=(RayCaster&&) noexcept;

  // The nearest hit farther than min_distance and nearer than max_distance; both sides of a
  // triangle count. direction must have unit length.
  std::optional<RayHit> Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                             double min_distance = 0,
                             double max_distance = std::numeric_limits<double>::infinity()) const;

  // Metres from the point to the nearest place on the mesh, if that is nearer than max_distance.
  std::optional<double> DistanceTo(const Eigen::Vector3d& point, double max_distance) const;

  // Something lies strictly between the two points, `margin` metres away from both ends.
  bool IsOccluded(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double margin) const;

 private:
  struct Scene;
  std::unique_ptr<Scene> scene_;
};

}  // namespace roomtex
