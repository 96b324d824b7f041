#include "colmap_ext/triangulation.h"

#include <cmath>

#include "core/decompositions.h"

namespace roomtex {

std::optional<Eigen::Vector2d> ProjectPoint(const Rigid& view_from_left,
                                            const InverseDepthPoint& point) {
  if (!(point.z() > 0)) return std::nullopt;
  const Eigen::Vector3d x_in_view =
      view_from_left.rotation * Eigen::Vector3d(point.x(), point.y(), 1.0) +
      point.z() * view_from_left.translation;
  if (!(x_in_view.z() > 1e-9)) return std::nullopt;
  return Eigen::Vector2d(x_in_view.hnormalized());
}

std::optional<InverseDepthPoint> Triangulate(const std::vector<Rigid>& views_from_left,
                                             const std::vector<Eigen::Vector2d>& x_in_views) {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  for (size_t i = 0; i < views_from_left.size(); ++i) {
    const Eigen::Matrix<double, 3, 4> view = views_from_left[i].Matrix();
    for (int k = 0; k < 2; ++k) {
      // Thesis (6.3): x M_3 - M_1 = 0 and y M_3 - M_2 = 0. Scaled to the length of the ray.
      const Eigen::Vector4d row = (x_in_views[i][k] * view.row(2) - view.row(k)).transpose() /
                                  std::sqrt(1 + x_in_views[i].squaredNorm());
      normal += row * row.transpose();
    }
  }
  const Eigen::Vector4d x = SymmetricEigen(normal).vectors.col(0);
  if (!x.allFinite() || !(std::abs(x.z()) > 1e-12)) return std::nullopt;
  return InverseDepthPoint(x.x() / x.z(), x.y() / x.z(), x.w() / x.z());
}

std::optional<InverseDepthPoint> TriangulatePair(const Rigid& right_from_left,
                                                 const Eigen::Vector2d& x_in_left,
                                                 const Eigen::Vector2d& x_in_right) {
  return Triangulate({Rigid(), right_from_left}, {x_in_left, x_in_right});
}

double TriangulationAngle(const Rigid& right_from_left, const InverseDepthPoint& point) {
  const Eigen::Vector3d to_left(point.x(), point.y(), 1.0);
  // From the right camera's centre, times w: the same formula for near and far points.
  const Eigen::Vector3d to_right = to_left - point.z() * right_from_left.TargetOriginInSource();
  return AngleBetween(to_left, to_right);
}

}  // namespace roomtex
