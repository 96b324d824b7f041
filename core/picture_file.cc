#include "core/picture_file.h"

#include <filesystem>

#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {

void WritePictureFile(const std::string& path, const cv::Mat& picture,
                      const std::vector<int>& parameters) {
  std::vector<unsigned char> bytes;
  const std::string extension = std::filesystem::path(path).extension().string();
  bool encoded = false;
  try {
    encoded = cv::imencode(extension, picture, bytes, parameters);
  } catch (const cv::Exception&) {
    encoded = false;  // no format of this name
  }
  if (!encoded) {
    throw InputError(path, "", "cannot be written as a picture of this size and format",
                     "Give a name that ends with .png or .jpg");
  }
  OutputFile file(path);
  file.stream().write(reinterpret_cast<const char*>(bytes.data()),
                      static_cast<std::streamsize>(bytes.size()));
  file.Commit();
}

}  // namespace roomtex
