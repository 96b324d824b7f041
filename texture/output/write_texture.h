#pragma once
// Texture images as files.

#include <string>

#include <opencv2/core/mat.hpp>

namespace roomtex {

// PNG, written aside and renamed.
void WritePng(const cv::Mat& image, const std::string& path);
// The same as JPEG of quality 95.
void WriteJpeg(const cv::Mat& image, const std::string& path);

}  // namespace roomtex
