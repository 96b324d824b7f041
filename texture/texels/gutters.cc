#include "texture/texels/gutters.h"

#include <vector>

#include <opencv2/imgproc.hpp>

namespace roomtex {

void PaintGutters(const cv::Mat1b& known, int reach, cv::Mat* image) {
  if (cv::countNonZero(known) == 0) return;
  cv::Mat1f distance;
  cv::Mat1i label;  // of the nearest known pixel, 1-based
  cv::distanceTransform(known == 0, distance, label, cv::DIST_L2, cv::DIST_MASK_5,
                        cv::DIST_LABEL_PIXEL);
  cv::Mat3b colors = *image;
  std::vector<cv::Vec3b> color_of_label(known.total() + 1);
  for (int row = 0; row < known.rows; ++row) {
    for (int column = 0; column < known.cols; ++column) {
      if (known(row, column)) color_of_label[label(row, column)] = colors(row, column);
    }
  }
  for (int row = 0; row < known.rows; ++row) {
    for (int column = 0; column < known.cols; ++column) {
      if (known(row, column) || distance(row, column) > static_cast<float>(reach)) continue;
      colors(row, column) = color_of_label[label(row, column)];
    }
  }
}

}  // namespace roomtex
