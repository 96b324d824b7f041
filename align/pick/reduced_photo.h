#pragma once
// Photos decoded smaller than they are: a JPEG gives an eighth of its size in a fraction of the
// time, each pixel the mean of those it stands for.

#include <string>

#include <opencv2/core/mat.hpp>

#include "core/photo_fit.h"

namespace roomtex {

// 8-bit BGR by a factor of 1, 2, 4 or 8, the largest that leaves at least min_width pixels; one
// that is turned by EXIF as large as it is. Throws InputError as ReadPhoto() does.
cv::Mat ReadReducedPhoto(const std::string& path, const PhotoFit& fit, int min_width);

}  // namespace roomtex
