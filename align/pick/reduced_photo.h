#pragma once
// Photos decoded smaller than they are: a JPEG gives an eighth of its size in a fraction of the
// time, each pixel the mean of those it stands for.

#include <string>

#include <opencv2/core/mat.hpp>

namespace roomtex {

// 8-bit BGR as stored (no EXIF orientation), by a factor of 1, 2, 4 or 8, the largest that leaves
// at least min_width pixels; width: of the photo as taken. Throws InputError as ReadPhoto() does.
cv::Mat ReadReducedPhoto(const std::string& path, int width, int min_width);

}  // namespace roomtex
