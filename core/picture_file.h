#pragma once
// Pictures as files, whole or not at all.

#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace roomtex {

// In the format of the extension (.png, .jpg ...); parameters: cv::IMWRITE_*. Throws InputError,
// also where OpenCV's own writer says nothing: when the disk is full.
void WritePictureFile(const std::string& path, const cv::Mat& picture,
                      const std::vector<int>& parameters = {});

}  // namespace roomtex
