#pragma once
// Photos: decoding (OpenCV), shooting data (Exiv2), linear light.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace roomtex {

// What EXIF says about the exposure; empty where it does not.
struct ExposureData {
  std::optional<double> exposure_time;  // seconds
  std::optional<double> f_number;
  std::optional<double> iso;
  std::string camera;     // make and model, for grouping photos
  std::string date_time;  // "2008:05:01 12:00:00" or ""

  // Light collected per scene radiance, relative: t * ISO / N^2; f_number and ISO count as 1 when
  // absent. None without an exposure time.
  std::optional<double> RelativeExposure() const;
};

// Which way up. COLMAP's keypoints are those of the pixels as stored.
enum class PhotoPixels { kAsStored, kTurnedByExif };

// 8-bit BGR, by default as stored: an EXIF orientation is NOT applied, because COLMAP's keypoints
// are not turned either. Throws InputError if the file is missing, not an image or broken.
cv::Mat ReadPhoto(const std::string& path, PhotoPixels pixels = PhotoPixels::kAsStored);

// Where the picture of ReadPhoto() is not opaque, as masks and programs that cut things out write
// it: other than 0. Empty where the file has no alpha, or all of it is opaque. Throws likewise.
cv::Mat1b ReadTransparency(const std::string& path, PhotoPixels pixels);

// The file's EXIF orientation exchanges width and height.
bool ExifExchangesSides(const std::string& path);

// The same in grey, made smaller while it is decoded: shrink is 1, 2, 4 or 8. For a JPEG this takes
// a part of the time and memory.
cv::Mat1b ReadGreyPhoto(const std::string& path, int shrink);
// 8-bit BGR, likewise.
cv::Mat ReadShrunkPhoto(const std::string& path, int shrink);

// Width and height without decoding the pixels, from the file's header; {0, 0} if that cannot be
// told.
std::array<int, 2> ReadPhotoSize(const std::string& path);

// Missing or broken EXIF is no error: fields stay empty.
ExposureData ReadExposureData(const std::string& path);
// Writes the fields that are set into an existing JPEG.
void WriteExposureData(const std::string& path, const ExposureData& exposure);

// The EXIF of a picture, given as the bytes of its file, into another file; nothing where it has
// none that can be read. Throws InputError if the file cannot be written.
void CopyExif(const std::vector<char>& picture, const std::string& path);

// Focal length in pixels of the photo as stored, by EXIF: the equivalent on 35 mm film, which CIPA
// DCG-001 takes by the diagonal, else the focal length with the resolution of the focal plane. Both
// are rounded, and the first is meant for uncropped photos: good to some percent. None without.
std::optional<double> ReadFocalLength(const std::string& path);
// What EXIF says of the lens; empty where it does not.
struct LensData {
  std::string camera;  // as ExposureData::camera
  // Millimetres; of a digital zoom, times its ratio.
  std::optional<double> focal_length_mm;
  std::optional<double> focal_length_on_film_mm;  // equivalent on 35 mm film, rounded
};
// Missing or broken EXIF is no error: fields stay empty.
LensData ReadLensData(const std::string& path);
// What 35 mm film would need for the same view, by the diagonal as CIPA DCG-001 has it, to whole
// millimetres. focal_length and size in pixels. Throws InputError, as WriteExposureData().
void WriteFocalLength(const std::string& path, double focal_length, std::array<int, 2> size);

// Where the camera's satellite receiver believed to be (EXIF GPS).
struct GpsData {
  double latitude_deg = 0;                 // -90..90, north positive
  double longitude_deg = 0;                // -180..180, east positive
  std::optional<double> horizontal_error;  // metres, as the camera states it
  std::string datum;                       // "WGS-84", "TOKYO" ... or ""
};
// None without a position: not written, broken, marked as void, or the 0, 0 that cameras write
// that have found none yet.
std::optional<GpsData> ReadGpsData(const std::string& path);

// sRGB transfer function (IEC 61966-2-1): value in [0, 1], linear light in [0, 1].
double LinearFromSrgb(double value);
double SrgbFromLinear(double linear);
// The same for bytes: a table of 256 linear values.
const std::array<float, 256>& LinearFromSrgbByte();
// Nearest byte; clamps.
uint8_t SrgbByteFromLinear(float linear);

}  // namespace roomtex
