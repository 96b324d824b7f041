#pragma once
// What an error of the intrinsics does to the picture. A turn of the camera is taken out first: a
// principal point that is off by a pixel, turned back by a pixel, sees nearly the same, and COLMAP
// finds the turn of every photo anyway. What remains bends the room.

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/camera_model.h"

namespace roomtex {

// Positions in `img` spread evenly over the picture: 15 along its longer side, borders included.
Eigen::Matrix2Xd PictureGrid(int width, int height);
// The four corners of the picture, clockwise from the upper left.
Eigen::Matrix2Xd PictureCorners(int width, int height);

// Standard deviation in pixels (length of both coordinates) at the given positions. covariance: of
// all parameters of the camera. Infinite where the covariance or the camera's mapping is.
std::vector<double> MappingSigma(const Camera& camera, const Eigen::MatrixXd& covariance,
                                 const Eigen::Matrix2Xd& x_in_img);

// Where `other` sees what `camera` sees at the given positions, less these positions, pixels; after
// the turn of `other` that brings the grid of `over` (default: the whole picture) closest. NaN
// where one of the two has no ray or no projection.
Eigen::Matrix2Xd MappingDifference(const Camera& camera, const Camera& other,
                                   const Eigen::Matrix2Xd& x_in_img,
                                   const Eigen::Matrix2Xd& over = {});

}  // namespace roomtex
