#pragma once
// A calibration as files: COLMAP's cameras.txt, the options of `colmap feature_extractor`, the
// report.

#include <string>

#include "capture/calibration/calibration.h"
#include "core/report.h"

namespace roomtex {

// Numbers as they stand in files and options: enough digits for a millionth of a pixel, and the
// same in all of them.
Camera RoundedCamera(const Camera& camera);

// COLMAP's cameras.txt with this one camera. Written aside and renamed.
void WriteCamerasText(const std::string& path, const Camera& camera);

// "--ImageReader.single_camera 1 --ImageReader.camera_model OPENCV --ImageReader.camera_params ..."
std::string FeatureExtractorOptions(const Camera& camera);

// For people: "focal length 2412.3 +- 0.8 px (0.03 %), reprojection 0.07 px rms over 24 photos".
std::string FocalLengthLine(const Calibration& calibration);

// The command's own keys of docs/commands.md.
void FillReport(const Calibration& calibration, const Board& board, Report* report);

}  // namespace roomtex
