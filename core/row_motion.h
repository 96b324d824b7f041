#pragma once
// Photos whose rows are read one after the other while a hand moves the camera (rolling shutter).

#include <cstdint>
#include <map>
#include <optional>

#include <Eigen/Core>

#include "core/camera_model.h"

namespace roomtex {

// How a camera moves from the reading of a photo's first row to that of the last one, about its
// pose at the middle row (Hedborg et al. 2012, "Rolling Shutter Bundle Adjustment"): the row read
// at s, from -1/2 to 1/2, sees x + s (turn x x + move) in place of the point x; `cam`.
struct RowMotion {
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();  // radians
  Eigen::Vector3d move = Eigen::Vector3d::Zero();  // metres, of the points

  Eigen::Vector3d operator()(double row_share, const Eigen::Vector3d& x_in_cam) const {
    return x_in_cam + row_share * (turn.cross(x_in_cam) + move);
  }
};

// By image_id; photos that are not named were read at once.
using RowMotions = std::map<uint32_t, RowMotion>;

// Rows of a sensor lie along its longer side, also of pictures that were turned upright.
inline bool RowsAreUpright(const Camera& camera) { return camera.height > camera.width; }
// s of the row at a position in `img`, from the upper or left border.
inline double RowShare(const Camera& camera, const Eigen::Vector2d& x_in_img) {
  return RowsAreUpright(camera) ? x_in_img.x() / camera.width - 0.5
                                : x_in_img.y() / camera.height - 0.5;
}
// What it changes by with the position; 1 / pixels.
inline Eigen::Vector2d RowShareByImg(const Camera& camera) {
  return RowsAreUpright(camera) ? Eigen::Vector2d(1.0 / camera.width, 0)
                                : Eigen::Vector2d(0, 1.0 / camera.height);
}

// How often a row is found from the position that the row before it gives. Each time is nearer by
// the share of the photo that the motion shifts what it shows, a few hundredths.
inline constexpr int kRowIterations = 3;

// Where a point (in the camera of the middle row) is shown by the row that sees it; rows beyond the
// photo move no farther than its first and last one. None as CameraProjection::ImgFromCam.
std::optional<Eigen::Vector2d> ImgFromMovingCam(const CameraProjection& projection,
                                                const RowMotion& motion,
                                                const Eigen::Vector3d& x_in_cam);

// Where a keypoint at x_in_img of a point (x_in_cam, in the camera of the middle row) would be had
// its row been read with the middle one; where it is if that cannot be told.
Eigen::Vector2d KeypointOfStillRows(const CameraProjection& projection, const RowMotion& motion,
                                    const Eigen::Vector3d& x_in_cam,
                                    const Eigen::Vector2d& x_in_img);

}  // namespace roomtex
