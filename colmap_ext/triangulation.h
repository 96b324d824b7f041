#pragma once
// Points from rays.

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/similarity.h"

namespace roomtex {

// A point of a seed: it lies at (a, b, 1) / w in `left`, the cam frame of the first view, stored as
// (a, b, w). w = 1 / depth stays well behaved for far points, and w < 0 lies behind the camera.
using InverseDepthPoint = Eigen::Vector3d;

inline Eigen::Vector3d PointInLeft(const InverseDepthPoint& point) {
  return Eigen::Vector3d(point.x(), point.y(), 1.0) / point.z();
}

// (x/z, y/z) of the point in a view; none if it is not in front of that view (or of left).
std::optional<Eigen::Vector2d> ProjectPoint(const Rigid& view_from_left,
                                            const InverseDepthPoint& point);

// Linear triangulation (DLT, thesis 6.3.1 eq. (6.3), for cameras with K = I) of a point seen at
// x_in_views[i] (x/z, y/z) by views_from_left[i]; two views or more. None if the rays do not fix a
// direction. The point may lie behind a view.
std::optional<InverseDepthPoint> Triangulate(const std::vector<Rigid>& views_from_left,
                                             const std::vector<Eigen::Vector2d>& x_in_views);
// The same for left and one more view.
std::optional<InverseDepthPoint> TriangulatePair(const Rigid& right_from_left,
                                                 const Eigen::Vector2d& x_in_left,
                                                 const Eigen::Vector2d& x_in_right);

// Angle at the point between the rays to left and to the other view, radians.
double TriangulationAngle(const Rigid& right_from_left, const InverseDepthPoint& point);

}  // namespace roomtex
