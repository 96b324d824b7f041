#pragma once
// The picture of a calibration: where the corners lie, what is left of their residuals, which
// photos were left out.

#include <string>

#include <opencv2/core/mat.hpp>

#include "capture/calibration/calibration.h"

namespace roomtex {

// 8-bit BGR, about 1300 pixels wide. Above, the photos' frame: cells are the bluer the more corners
// lie in them, white ones have none; dots are corners of the photos used (red: left out); the arrow
// of a cell is the mean of its residuals, enlarged as noted. Below, the numbers, and the photos
// left out with the reason.
cv::Mat DrawCalibration(const Calibration& calibration);

}  // namespace roomtex
