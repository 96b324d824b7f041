#include "core/row_motion.h"

#include <algorithm>

namespace roomtex {

std::optional<Eigen::Vector2d> ImgFromMovingCam(const CameraProjection& projection,
                                                const RowMotion& motion,
                                                const Eigen::Vector3d& x_in_cam) {
  auto shown = projection.ImgFromCam(x_in_cam);
  for (int k = 0; shown && k < kRowIterations; ++k) {
    const double share = std::clamp(RowShare(projection.camera(), *shown), -0.5, 0.5);
    shown = projection.ImgFromCam(motion(share, x_in_cam));
  }
  return shown;
}

Eigen::Vector2d KeypointOfStillRows(const CameraProjection& projection, const RowMotion& motion,
                                    const Eigen::Vector3d& x_in_cam,
                                    const Eigen::Vector2d& x_in_img) {
  const double share = RowShare(projection.camera(), x_in_img);
  const auto still = projection.ImgFromCam(x_in_cam);
  const auto seen = projection.ImgFromCam(motion(share, x_in_cam));
  if (!still || !seen) return x_in_img;
  return x_in_img + *still - *seen;
}

}  // namespace roomtex
