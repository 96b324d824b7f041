#include "texture/output/write_texture.h"

#include <opencv2/imgcodecs.hpp>

#include "core/picture_file.h"

namespace roomtex {

void WritePng(const cv::Mat& image, const std::string& path) {
  WritePictureFile(path, image, {cv::IMWRITE_PNG_COMPRESSION, 2});
}

void WriteJpeg(const cv::Mat& image, const std::string& path) {
  WritePictureFile(path, image, {cv::IMWRITE_JPEG_QUALITY, 95});
}

}  // namespace roomtex
