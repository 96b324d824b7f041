#pragma once
// What a fitted camera is worth. Used by calibration.cc only.

#include <vector>

#include "capture/calibration/calibration.h"

namespace roomtex {

// How much more the camera changes from photo to photo than the noise of the corners lets expect:
// jackknife over the photos against the covariance, at the corners seen. About 1 when corners err
// independently.
double PhotoScatter(const CameraFit& fit, const std::vector<BoardView>& views);

// Standard deviations of the parameters and what they do to the picture.
void DescribeUncertainty(const CameraFit& fit, const std::vector<BoardView>& views,
                         Calibration* result);
// From the photos used.
void DescribeCoverage(Calibration* result);
// Warnings and reasons not to trust it, from all of the above.
void JudgeCalibration(const CalibrationOptions& options, Calibration* result);

}  // namespace roomtex
