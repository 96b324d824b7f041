#pragma once
// Photos with an EXIF GPS position, as cameras write it.

#include <cmath>
#include <string>

#include <exiv2/exiv2.hpp>

#include "importers/geo_frame.h"

namespace roomtex {

// Degrees, minutes and seconds as three fractions; to 1e-5 seconds of arc, 0.3 mm.
inline std::string ExifAngle(double degrees) {
  const double magnitude = std::abs(degrees);
  const double whole = std::floor(magnitude), minutes = std::floor((magnitude - whole) * 60);
  const double seconds = ((magnitude - whole) * 60 - minutes) * 60;
  return std::to_string(std::lround(whole)) + "/1 " + std::to_string(std::lround(minutes)) + "/1 " +
         std::to_string(std::lround(seconds * 1e5)) + "/100000";
}

// Into an existing picture. stated_error: GPSHPositioningError as a fraction, "" = not stated.
inline void WriteGpsPosition(const std::string& path, const GeoPosition& position,
                             const std::string& stated_error) {
  auto image = Exiv2::ImageFactory::open(path);
  image->readMetadata();
  Exiv2::ExifData& exif = image->exifData();
  const double longitude = std::remainder(position.longitude_deg, 360);
  exif["Exif.GPSInfo.GPSLatitudeRef"] = position.latitude_deg < 0 ? "S" : "N";
  exif["Exif.GPSInfo.GPSLatitude"] = ExifAngle(position.latitude_deg);
  exif["Exif.GPSInfo.GPSLongitudeRef"] = longitude < 0 ? "W" : "E";
  exif["Exif.GPSInfo.GPSLongitude"] = ExifAngle(longitude);
  if (!stated_error.empty()) exif["Exif.GPSInfo.GPSHPositioningError"] = stated_error;
  image->writeMetadata();
}

}  // namespace roomtex
