#pragma once
// Pictures out of a video for COLMAP: sharp and evenly spaced.

#include <functional>
#include <string>

#include <opencv2/core/mat.hpp>

namespace roomtex {

// How much fine detail a picture shows; larger = sharper. Of use to compare neighbours.
double Sharpness(const cv::Mat& bgr);

// Cuts the video into at most `wanted` stretches of one length and writes the sharpest picture out
// of the middle of each as folder/frame_NNNNNN.jpg (the number in the video, from 0). The folder
// appears when it is whole. share: told how much is done. Throws InputError.
void WriteSharpFrames(const std::string& video, const std::string& folder, int wanted,
                      const std::function<void(double)>& share);

}  // namespace roomtex
