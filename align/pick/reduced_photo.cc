#include "align/pick/reduced_photo.h"

#include "core/photo.h"

namespace roomtex {

cv::Mat ReadReducedPhoto(const std::string& path, const PhotoFit& fit, int min_width) {
  if (fit.pixels != PhotoPixels::kAsStored) return ReadPhoto(path, fit.pixels);
  int shrink = 8;
  while (shrink > 1 && fit.width / shrink < min_width) shrink /= 2;
  return ReadShrunkPhoto(path, shrink);
}

}  // namespace roomtex
