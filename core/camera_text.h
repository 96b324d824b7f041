#pragma once
// A camera as COLMAP's programs take it: a line of cameras.txt, options of `colmap
// feature_extractor`.

#include <string>

#include "core/camera_model.h"

namespace roomtex {

// Significant digits of parameters that read back to the same numbers, to the last bit.
inline constexpr int kExactCameraDigits = 17;

// "1 OPENCV 4000 3000 2412.3 2412.1 ...", with its line feed.
std::string CamerasTextLine(const Camera& camera, int digits = kExactCameraDigits);

// For photos that all have this camera:
// "--ImageReader.single_camera 1 --ImageReader.camera_model OPENCV --ImageReader.camera_params ..."
std::string FeatureExtractorOptions(const Camera& camera, int digits = kExactCameraDigits);

}  // namespace roomtex
