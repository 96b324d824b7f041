#include "capture/association/associated_views_light.h"

#include <array>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "core/photo.h"

namespace roomtex {

cv::Mat1f LogLight(const cv::Mat1b& grey) {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (int i = 0; i < 256; ++i) values[i] = std::log(LinearFromSrgbByte()[i] + 0.01f);
    return values;
  }();
  cv::Mat1f light(grey.size());
  for (int row = 0; row < grey.rows; ++row) {
    const uchar* in = grey.ptr(row);
    float* out = light.ptr<float>(row);
    for (int column = 0; column < grey.cols; ++column) out[column] = table[in[column]];
  }
  return light;
}

cv::Mat1f BandOf(const cv::Mat1f& light, double fine, double coarse) {
  cv::Mat1f sharp, smooth;
  cv::GaussianBlur(light, sharp, {}, fine, fine, cv::BORDER_REPLICATE);
  cv::GaussianBlur(light, smooth, {}, coarse, coarse, cv::BORDER_REPLICATE);
  return sharp - smooth;
}

}  // namespace roomtex
