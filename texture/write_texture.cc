#include "texture/write_texture.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {

cv::Mat ImageOfGrid(const ColorGrid& grid) {
  cv::Mat3b image(grid.num_rows, grid.num_columns);
  auto pixel = image.begin();
  for (const auto& [r, g, b] : grid.rgb) *pixel++ = {b, g, r};
  return image;
}

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

namespace {

void WriteImage(const cv::Mat& image, const std::string& path, const std::string& format,
                const std::vector<int>& parameters) {
  OutputFile file(path);
  if (!cv::imwrite(file.partial_path(), image, parameters)) {
    throw InputError(path, "", "cannot be written as " + format, "Check the space on the disk");
  }
  file.Commit();
}

}  // namespace

void WritePng(const cv::Mat& image, const std::string& path) {
  WriteImage(image, path, "PNG", {cv::IMWRITE_PNG_COMPRESSION, 2});
}

void WriteJpeg(const cv::Mat& image, const std::string& path) {
  WriteImage(image, path, "JPEG", {cv::IMWRITE_JPEG_QUALITY, 95});
}

}  // namespace roomtex
