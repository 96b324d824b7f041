#pragma once
// Keypoints as viewing rays: distortion is undone once, here, and everything two-view works on
// rays. Errors are still measured in pixels, by the derivative of the projection at every keypoint.

#include <vector>

#include <Eigen/Core>

#include "core/camera_model.h"

namespace roomtex {

// One keypoint as a viewing ray in `cam`.
struct Ray {
  Eigen::Vector2d x = Eigen::Vector2d::Zero();                 // (x/z, y/z) in cam
  Eigen::Matrix2d img_from_ray = Eigen::Matrix2d::Identity();  // d(pixel) / d(x)
  Eigen::Matrix2d ray_from_img = Eigen::Matrix2d::Identity();  // its inverse
  bool valid = false;  // false: no ray of the lens reaches this position

  Eigen::Vector3d Direction() const { return {x.x(), x.y(), 1.0}; }  // not of unit length
  // Pixels between this keypoint and the ray (y.x, y.y, 1); to first order.
  Eigen::Vector2d PixelError(const Eigen::Vector2d& y) const { return img_from_ray * (y - x); }
};

// One ray per keypoint (positions in `img`).
std::vector<Ray> RaysFromKeypoints(const CameraProjection& projection,
                                   const std::vector<Eigen::Vector2d>& keypoints);

// A verified match of two views, with the keypoint rows it comes from.
struct RayMatch {
  Ray left, right;
  int left_row = -1, right_row = -1;
};

}  // namespace roomtex
