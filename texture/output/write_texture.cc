#include "texture/output/write_texture.h"

#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {
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
