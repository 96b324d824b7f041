#pragma once
// A calibration as files: COLMAP's cameras.txt, the report. As options of `colmap
// feature_extractor`: core/camera_text.h.

#include <string>

#include "capture/calibration/calibration.h"
#include "core/report.h"

namespace roomtex {

// Of numbers in files and options: 1e-6 of a pixel of a focal length, 1e-9 of a distortion.
inline constexpr int kLensDigits = 10;
// With numbers as they stand there, the same in all of them.
Camera RoundedCamera(const Camera& camera);

// COLMAP's cameras.txt with this one camera. Written aside and renamed.
void WriteCamerasText(const std::string& path, const Camera& camera);

// For people: "focal length 2412.3 +- 0.8 px (0.03 %), reprojection 0.07 px rms over 24 photos".
std::string FocalLengthLine(const Calibration& calibration);

// The command's own keys of docs/commands.md.
void FillReport(const Calibration& calibration, const Board& board, Report* report);

}  // namespace roomtex
