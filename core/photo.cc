#include "core/photo.h"

#include <algorithm>
#include <cmath>
#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

std::optional<double> PositiveNumber(const Exiv2::ExifData& exif, const char* key) {
  const auto found = exif.findKey(Exiv2::ExifKey(key));
  if (found == exif.end() || found->count() == 0) return std::nullopt;
  const double value = found->toFloat();
  if (!std::isfinite(value) || !(value > 0)) return std::nullopt;
  return value;
}

std::string Text(const Exiv2::ExifData& exif, const char* key) {
  const auto found = exif.findKey(Exiv2::ExifKey(key));
  return found == exif.end() ? "" : found->toString();
}

// Nearest fraction of the kind cameras write: 1/x below a second, thousandths above.
Exiv2::Rational RationalOf(double value) {
  if (value < 1) return {1000000, static_cast<int32_t>(std::lround(1000000 / value))};
  return {static_cast<int32_t>(std::lround(value * 1000)), 1000};
}

// Exiv2 prints warnings about files to stderr by default; a library does not print.
void SilenceExiv2() { Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute); }

}  // namespace

std::optional<double> ExposureData::RelativeExposure() const {
  if (!exposure_time) return std::nullopt;
  const double n = f_number.value_or(1.0);
  return *exposure_time * iso.value_or(1.0) / (n * n);
}

cv::Mat ReadPhoto(const std::string& path) {
  RequireFile(path, "Check --image_path: it is the folder that COLMAP was given");
  cv::Mat image;
  try {
    image = cv::imread(path, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty()) {
    throw InputError(path, "", "is not an image that can be decoded",
                     "Expected a JPEG, PNG or TIFF file; re-export or remove it");
  }
  return image;
}

std::array<int, 2> ReadPhotoSize(const std::string& path) {
  SilenceExiv2();
  try {
    auto image = Exiv2::ImageFactory::open(path);
    image->readMetadata();
    return {image->pixelWidth(), image->pixelHeight()};
  } catch (const std::exception&) {
    return {0, 0};
  }
}

ExposureData ReadExposureData(const std::string& path) {
  SilenceExiv2();
  ExposureData data;
  try {
    auto image = Exiv2::ImageFactory::open(path);
    image->readMetadata();
    const Exiv2::ExifData& exif = image->exifData();
    data.exposure_time = PositiveNumber(exif, "Exif.Photo.ExposureTime");
    if (!data.exposure_time) {
      // APEX: shutter speed value Tv = -log2(t).
      const auto found = exif.findKey(Exiv2::ExifKey("Exif.Photo.ShutterSpeedValue"));
      if (found != exif.end() && found->count() > 0) {
        const double time = std::exp2(-static_cast<double>(found->toFloat()));
        if (std::isfinite(time) && time > 0) data.exposure_time = time;
      }
    }
    data.f_number = PositiveNumber(exif, "Exif.Photo.FNumber");
    data.iso = PositiveNumber(exif, "Exif.Photo.ISOSpeedRatings");
    const std::string make = Text(exif, "Exif.Image.Make"), model = Text(exif, "Exif.Image.Model");
    data.camera = make.empty() || model.empty() ? make + model : make + " " + model;
    data.date_time = Text(exif, "Exif.Photo.DateTimeOriginal");
  } catch (const std::exception&) {
  }
  return data;
}

void WriteExposureData(const std::string& path, const ExposureData& exposure) {
  SilenceExiv2();
  try {
    auto image = Exiv2::ImageFactory::open(path);
    image->readMetadata();
    Exiv2::ExifData& exif = image->exifData();
    if (exposure.exposure_time) {
      exif["Exif.Photo.ExposureTime"] = RationalOf(*exposure.exposure_time);
    }
    if (exposure.f_number) exif["Exif.Photo.FNumber"] = RationalOf(*exposure.f_number);
    if (exposure.iso) {
      exif["Exif.Photo.ISOSpeedRatings"] = static_cast<uint16_t>(std::lround(*exposure.iso));
    }
    if (!exposure.camera.empty()) exif["Exif.Image.Model"] = exposure.camera;
    if (!exposure.date_time.empty()) exif["Exif.Photo.DateTimeOriginal"] = exposure.date_time;
    image->writeMetadata();
  } catch (const std::exception& error) {
    throw InputError(path, "", std::string("EXIF cannot be written (") + error.what() + ")",
                     "Check that the file is a JPEG that may be written");
  }
}

double LinearFromSrgb(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

double SrgbFromLinear(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

const std::array<float, 256>& LinearFromSrgbByte() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (int i = 0; i < 256; ++i) values[i] = static_cast<float>(LinearFromSrgb(i / 255.0));
    return values;
  }();
  return table;
}

uint8_t SrgbByteFromLinear(float linear) {
  // Byte i starts where the value i - 0.5 lies: a search in 256 bounds is exact and cheap.
  static const std::array<float, 256> lower_bounds = [] {
    std::array<float, 256> bounds{};
    bounds[0] = 0;
    for (int i = 1; i < 256; ++i) bounds[i] = static_cast<float>(LinearFromSrgb((i - 0.5) / 255));
    return bounds;
  }();
  if (!(linear > 0)) return 0;
  return static_cast<uint8_t>(
      std::upper_bound(lower_bounds.begin(), lower_bounds.end(), linear) - lower_bounds.begin() - 1);
}

}  // namespace roomtex
