#pragma once
// Photos without their distortion, as pictures of a pinhole camera: what splatting trainers and
// COLMAP's dense stereo take.

#include <optional>

#include <opencv2/core/mat.hpp>

#include "core/camera_model.h"

namespace roomtex {

struct PinholeOptions {
  // Longest side of the undistorted picture, pixels; 0 = what the photo's resolution asks for.
  int max_image_size = 0;
  // Degrees, from one side of the picture to the other: a plane stretches what lies farther off the
  // axis without end. Below 180.
  double max_field_deg = 110;
};

// The pinhole camera that shows as much as it can without blank borders, as COLMAP's
// image_undistorter: focal lengths of the middle of the picture, cropped to the rectangle inside
// the photo's borders. Of a fisheye whose picture is a disc the corners may stay blank. None for a
// panorama, and where nothing is left in front of the camera. A pinhole camera that needs no
// scaling stays as it is.
std::optional<Camera> PinholeCamera(const Camera& camera, const PinholeOptions& options);

struct UndistortedPhoto {
  cv::Mat picture;
  cv::Mat1b shown;  // 255 where the photo shows it, else 0; the picture is black there
};
// The photo (of `camera`'s size, 8-bit, any number of channels) as `pinhole` sees it: by cubic
// interpolation, averaged before where pinhole is much coarser.
UndistortedPhoto UndistortPhoto(const cv::Mat& photo, const Camera& camera, const Camera& pinhole);

}  // namespace roomtex
