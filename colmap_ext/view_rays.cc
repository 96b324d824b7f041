#include "colmap_ext/view_rays.h"

#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace roomtex {
namespace {

Ray RayFromKeypoint(const CameraProjection& projection, const Eigen::Vector2d& keypoint) {
  Ray ray;
  const auto x = projection.CamFromImg(keypoint);
  if (!x) return ray;
  ray.x = *x;
  const double step = 1e-5 * (1 + x->norm());
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector2d offset = step * Eigen::Vector2d::Unit(i);
    const auto ahead = projection.ImgFromCam((*x + offset).homogeneous());
    const auto behind = projection.ImgFromCam((*x - offset).homogeneous());
    if (!ahead || !behind) return ray;  // at the very edge of the lens' field
    ray.img_from_ray.col(i) = (*ahead - *behind) / (2 * step);
  }
  if (!(ray.img_from_ray.determinant() > 1e-6)) return ray;
  ray.ray_from_img = ray.img_from_ray.inverse();
  ray.valid = true;
  return ray;
}

}  // namespace

std::vector<Ray> RaysFromKeypoints(const CameraProjection& projection,
                                   const std::vector<Eigen::Vector2d>& keypoints) {
  std::vector<Ray> rays;
  rays.reserve(keypoints.size());
  for (const Eigen::Vector2d& keypoint : keypoints) {
    rays.push_back(RayFromKeypoint(projection, keypoint));
  }
  return rays;
}

}  // namespace roomtex
