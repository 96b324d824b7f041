#include "align/pick/reduced_photo.h"

#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/photo.h"

namespace roomtex {

cv::Mat ReadReducedPhoto(const std::string& path, const PhotoFit& fit, int min_width) {
  if (fit.pixels != PhotoPixels::kAsStored) return ReadPhoto(path, fit.pixels);
  const int width = fit.width;
  int flags = cv::IMREAD_COLOR;
  if (width / 8 >= min_width) {
    flags = cv::IMREAD_REDUCED_COLOR_8;
  } else if (width / 4 >= min_width) {
    flags = cv::IMREAD_REDUCED_COLOR_4;
  } else if (width / 2 >= min_width) {
    flags = cv::IMREAD_REDUCED_COLOR_2;
  }
  cv::Mat photo;
  try {
    photo = cv::imread(path, flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    // Said below.
  }
  if (photo.empty()) photo = ReadPhoto(path);  // says what is wrong
  return photo;
}

}  // namespace roomtex
