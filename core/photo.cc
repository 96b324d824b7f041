#include "core/photo.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string_view>

#include <exiv2/exiv2.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/input_guard.h"
#include "core/jpeg_facts.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

constexpr std::streamoff kMaxPhotoBytes = std::streamoff{1} << 31;

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

// Nearest fraction whose parts fit into EXIF's 32 bits; to at least six digits.
Exiv2::URational RationalOf(double value) {
  constexpr double kLargest = 4e9;
  if (value < 1) {
    const double numerator = std::floor(std::clamp(kLargest * value, 1.0, 1e6));
    return {static_cast<uint32_t>(numerator),
            static_cast<uint32_t>(std::min(kLargest, std::round(numerator / value)))};
  }
  const double denominator = std::floor(std::clamp(kLargest / value, 1.0, 1e6));
  return {static_cast<uint32_t>(std::min(kLargest, std::round(value * denominator))),
          static_cast<uint32_t>(denominator)};
}

std::vector<unsigned char> ReadBytes(const std::string& path) {
  std::ifstream stream(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = stream ? static_cast<std::streamoff>(stream.tellg()) : -1;
  if (size > kMaxPhotoBytes) {
    throw InputError(path, "", "has " + std::to_string(size) + " bytes, more than any photo",
                     "Take it out of the photos");
  }
  std::vector<unsigned char> bytes(size > 0 ? static_cast<size_t>(size) : 0);
  stream.seekg(0);
  stream.read(reinterpret_cast<char*>(bytes.data()), size);
  if (!stream) throw InputError(path, "", "cannot be read to its end", "Check the disk");
  return bytes;
}

// Exiv2 prints warnings about files to stderr by default; a library does not print.
void SilenceExiv2() { Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute); }

// A pipe would be waited for without end.
auto OpenExif(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) throw std::runtime_error("no file");
  return Exiv2::ImageFactory::open(path);
}

std::string CameraName(const Exiv2::ExifData& exif) {
  const std::string make = Text(exif, "Exif.Image.Make"), model = Text(exif, "Exif.Image.Model");
  return make.empty() || model.empty() ? make + model : make + " " + model;
}

// Degrees of three fractions: degrees, minutes, seconds (cameras may put fractions into any). The
// sign is that of the reference letter, `negative` = S or W.
std::optional<double> Angle(const Exiv2::ExifData& exif, const std::string& key, char positive,
                            char negative, double largest) {
  const auto found = exif.findKey(Exiv2::ExifKey(key));
  if (found == exif.end() || found->count() < 1 || found->count() > 3) return std::nullopt;
  double degrees = 0, unit = 1;
  for (int i = 0; i < static_cast<int>(found->count()); ++i, unit /= 60) {
    const Exiv2::Rational part = found->toRational(i);
    // 0/0 stands for "not given" in the smaller parts.
    if (i > 0 && part.first == 0 && part.second == 0) continue;
    if (part.second == 0) return std::nullopt;
    const double value = static_cast<double>(static_cast<uint32_t>(part.first)) /
                         static_cast<double>(static_cast<uint32_t>(part.second));
    if (i > 0 && value > 60) return std::nullopt;
    degrees += unit * value;
  }
  const std::string letter = Text(exif, (key + "Ref").c_str()).substr(0, 1);
  const bool is_negative = letter == std::string(1, negative);
  if (!is_negative && letter != std::string(1, positive)) return std::nullopt;
  if (!(degrees <= largest)) return std::nullopt;
  return is_negative ? -degrees : degrees;
}

// The orientation of EXIF 2.3 (4.6.4 A): what has to be done to the stored pixels; 1 = nothing,
// also where nothing is said.
int ReadOrientation(const std::string& path) {
  SilenceExiv2();
  try {
    auto image = OpenExif(path);
    image->readMetadata();
    const auto number = PositiveNumber(image->exifData(), "Exif.Image.Orientation");
    return number && *number <= 8 ? static_cast<int>(*number) : 1;
  } catch (const std::exception&) {
    return 1;
  }
}

void Turn(int orientation, cv::Mat* photo) {
  if (orientation >= 5) cv::transpose(*photo, *photo);
  // Then 5 to 8 are as 1 to 4: nothing, mirrored, turned by 180 degrees, upside down.
  static constexpr int kFlips[] = {0, 1, -1, 0};
  const int then = (orientation - 1) % 4;
  if (then > 0) cv::flip(*photo, *photo, kFlips[then]);
}

// OpenCV turns a TIFF as its orientation says, whatever it is told: the first directory then says
// that nothing is to be done. Other files, also broken ones, stay as they are.
void ForgetTiffOrientation(std::vector<unsigned char>* bytes) {
  constexpr size_t kHeader = 8, kEntry = 12;
  constexpr unsigned kOrientationTag = 274;
  if (bytes->size() < kHeader) return;
  unsigned char* const b = bytes->data();
  const bool is_little = b[0] == 'I' && b[1] == 'I' && b[2] == 42 && b[3] == 0;
  const bool is_big = b[0] == 'M' && b[1] == 'M' && b[2] == 0 && b[3] == 42;
  if (!is_little && !is_big) return;
  const auto number = [&](size_t at, int num_bytes) {
    size_t value = 0;
    for (int k = 0; k < num_bytes; ++k) {
      value = value << 8 | b[at + static_cast<size_t>(is_little ? num_bytes - 1 - k : k)];
    }
    return value;
  };
  const size_t directory = number(4, 4);
  if (directory > bytes->size() - 2) return;
  const size_t count = number(directory, 2);
  for (size_t i = 0; i < count; ++i) {
    const size_t at = directory + 2 + kEntry * i;
    if (at + kEntry > bytes->size()) return;
    if (number(at, 2) != kOrientationTag) continue;
    b[at + 8] = is_little ? 1 : 0;
    b[at + 9] = is_little ? 0 : 1;
  }
}

// OpenCV rounds them to whole numbers from 0 to 255, so that a photo from 0 to 1 would be black;
// and what is white in it, nobody says.
void RefuseRealNumbers(const std::string& path, const std::vector<unsigned char>& bytes) {
  const bool is_tiff = bytes.size() > 4 && ((bytes[0] == 'I' && bytes[1] == 'I') ||
                                            (bytes[0] == 'M' && bytes[1] == 'M'));
  if (!is_tiff) return;
  SilenceExiv2();
  try {
    auto image = OpenExif(path);
    image->readMetadata();
    // TIFF 6.0, section 19: 3 = IEEE floating point.
    const auto format = PositiveNumber(image->exifData(), "Exif.Image.SampleFormat");
    if (!format || *format != 3) return;
  } catch (const std::exception&) {
    return;
  }
  throw InputError(path, "",
                   "is a TIFF of floating-point numbers, which does not say what is white",
                   "Export it with 8 or 16 bits");
}

// Decoders fill what a cut-off file lacks with grey, and take inks for Adobe's, which are the other
// way round than others: white became black.
void RefuseBrokenJpeg(const std::string& path, const std::vector<unsigned char>& bytes) {
  if (bytes.size() <= 2 || bytes[0] != 0xff || bytes[1] != 0xd8) return;
  const JpegFacts facts = FindJpegFacts(bytes);
  if (!facts.is_whole) {
    throw InputError(path, BytePosition(static_cast<long long>(bytes.size())),
                     "the file ends before the picture does", "Copy it again from the camera");
  }
  if (facts.num_components == 4 && !facts.has_adobe_marker) {
    throw InputError(path, "",
                     "is a JPEG of four inks (CMYK) that does not say which way round they are",
                     "Export it as RGB");
  }
}

// By the file's header: what is asked for every photo decodes none that cannot be transparent.
bool MayHaveAlpha(const std::string& path) {
  unsigned char start[26] = {};
  std::ifstream stream(path, std::ios::binary);
  stream.read(reinterpret_cast<char*>(start), sizeof start);
  const std::string_view bytes(reinterpret_cast<const char*>(start), sizeof start);
  if (bytes.substr(1, 3) == "PNG") {
    // ISO 15948, 11.2.2: 4 and 6 have alpha, colours of a palette (3) may each have theirs.
    constexpr size_t kColourType = 25;
    return (start[kColourType] & 4) != 0 || start[kColourType] == 3;
  }
  if (bytes.substr(8, 4) == "WEBP") return true;
  if (bytes.substr(0, 2) != "II" && bytes.substr(0, 2) != "MM") return false;
  SilenceExiv2();
  try {
    auto image = OpenExif(path);
    image->readMetadata();
    const auto samples = PositiveNumber(image->exifData(), "Exif.Image.SamplesPerPixel");
    return samples && (*samples == 2 || *samples == 4);
  } catch (const std::exception&) {
    return true;
  }
}

// flags: cv::IMREAD_*.
cv::Mat DecodePhoto(const std::string& path, int flags) {
  RequireFile(path, "Check --image_path: it is the folder that COLMAP was given");
  NoteInput(path);
  std::vector<unsigned char> bytes = ReadBytes(path);
  RefuseRealNumbers(path, bytes);
  ForgetTiffOrientation(&bytes);
  RefuseBrokenJpeg(path, bytes);
  cv::Mat image;
  try {
    if (!bytes.empty()) image = cv::imdecode(bytes, flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty()) {
    throw InputError(path, "", "is not an image that can be decoded",
                     "Expected a JPEG, PNG or TIFF file; re-export or remove it");
  }
  return image;
}

}  // namespace

std::optional<double> ExposureData::RelativeExposure() const {
  if (!exposure_time) return std::nullopt;
  const double n = f_number.value_or(1.0);
  return *exposure_time * iso.value_or(1.0) / (n * n);
}

cv::Mat ReadPhoto(const std::string& path, PhotoPixels pixels) {
  cv::Mat photo = DecodePhoto(path, cv::IMREAD_COLOR);
  if (pixels == PhotoPixels::kTurnedByExif) Turn(ReadOrientation(path), &photo);
  return photo;
}

cv::Mat1b ReadTransparency(const std::string& path, PhotoPixels pixels) {
  constexpr double kOpaqueShare = 0.98;
  if (!MayHaveAlpha(path)) return {};
  const cv::Mat photo = DecodePhoto(path, cv::IMREAD_UNCHANGED);
  if (photo.channels() != 4 && photo.channels() != 2) return {};
  cv::Mat alpha;
  cv::extractChannel(photo, alpha, photo.channels() - 1);
  const double opaque = alpha.depth() == CV_8U ? 255 : alpha.depth() == CV_16U ? 65535 : 1;
  cv::Mat1b transparent = alpha < kOpaqueShare * opaque;
  if (cv::countNonZero(transparent) == 0) return {};
  if (pixels == PhotoPixels::kTurnedByExif) Turn(ReadOrientation(path), &transparent);
  return transparent;
}

bool ExifExchangesSides(const std::string& path) { return ReadOrientation(path) >= 5; }

cv::Mat1b ReadGreyPhoto(const std::string& path, int shrink) {
  switch (shrink) {
    case 8:
      return DecodePhoto(path, cv::IMREAD_REDUCED_GRAYSCALE_8);
    case 4:
      return DecodePhoto(path, cv::IMREAD_REDUCED_GRAYSCALE_4);
    case 2:
      return DecodePhoto(path, cv::IMREAD_REDUCED_GRAYSCALE_2);
    default:
      return DecodePhoto(path, cv::IMREAD_GRAYSCALE);
  }
}

cv::Mat ReadShrunkPhoto(const std::string& path, int shrink) {
  switch (shrink) {
    case 8:
      return DecodePhoto(path, cv::IMREAD_REDUCED_COLOR_8);
    case 4:
      return DecodePhoto(path, cv::IMREAD_REDUCED_COLOR_4);
    case 2:
      return DecodePhoto(path, cv::IMREAD_REDUCED_COLOR_2);
    default:
      return DecodePhoto(path, cv::IMREAD_COLOR);
  }
}

std::array<int, 2> ReadPhotoSize(const std::string& path) {
  NoteInput(path);
  SilenceExiv2();
  try {
    auto image = OpenExif(path);
    image->readMetadata();
    return {image->pixelWidth(), image->pixelHeight()};
  } catch (const std::exception&) {
    return {0, 0};
  }
}

LensData ReadLensData(const std::string& path) {
  SilenceExiv2();
  LensData data;
  try {
    auto image = OpenExif(path);
    image->readMetadata();
    const Exiv2::ExifData& exif = image->exifData();
    data.camera = CameraName(exif);
    data.focal_length_mm = PositiveNumber(exif, "Exif.Photo.FocalLength");
    const auto zoom = PositiveNumber(exif, "Exif.Photo.DigitalZoomRatio");
    if (data.focal_length_mm && zoom) *data.focal_length_mm *= *zoom;
    data.focal_length_on_film_mm = PositiveNumber(exif, "Exif.Photo.FocalLengthIn35mmFilm");
  } catch (const std::exception&) {
  }
  return data;
}

ExposureData ReadExposureData(const std::string& path) {
  SilenceExiv2();
  ExposureData data;
  try {
    auto image = OpenExif(path);
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
    data.camera = CameraName(exif);
    data.date_time = Text(exif, "Exif.Photo.DateTimeOriginal");
  } catch (const std::exception&) {
  }
  return data;
}

namespace {

constexpr double kFilmDiagonal = 43.2666;  // millimetres, of 36 x 24

// change: what it does to the file's EXIF.
template <typename Change>
void ChangeExif(const std::string& path, const Change& change) {
  SilenceExiv2();
  try {
    auto image = OpenExif(path);
    image->readMetadata();
    change(&image->exifData());
    image->writeMetadata();
  } catch (const std::exception& error) {
    throw InputError(path, "", std::string("EXIF cannot be written (") + error.what() + ")",
                     "Check that the file is a picture that may be written");
  }
}

}  // namespace

void WriteExposureData(const std::string& path, const ExposureData& exposure) {
  ChangeExif(path, [&exposure](Exiv2::ExifData* exif) {
    const auto set = [exif](const char* key, const auto& value) { (*exif)[key] = value; };
    if (exposure.exposure_time) {
      set("Exif.Photo.ExposureTime", RationalOf(*exposure.exposure_time));
    }
    if (exposure.f_number) set("Exif.Photo.FNumber", RationalOf(*exposure.f_number));
    if (exposure.iso) {
      set("Exif.Photo.ISOSpeedRatings",
          static_cast<uint16_t>(std::lround(std::clamp(*exposure.iso, 0.0, 65535.0))));
    }
    if (!exposure.camera.empty()) set("Exif.Image.Model", exposure.camera);
    if (!exposure.date_time.empty()) set("Exif.Photo.DateTimeOriginal", exposure.date_time);
  });
}

void CopyExif(const std::vector<char>& picture, const std::string& path) {
  SilenceExiv2();
  Exiv2::ExifData given;
  try {
    const auto image = Exiv2::ImageFactory::open(
        reinterpret_cast<const Exiv2::byte*>(picture.data()), static_cast<long>(picture.size()));
    image->readMetadata();
    given = image->exifData();
  } catch (const std::exception&) {
    return;
  }
  if (given.empty()) return;
  ChangeExif(path, [&given](Exiv2::ExifData* exif) { *exif = given; });
}

void WriteFocalLength(const std::string& path, double focal_length, std::array<int, 2> size) {
  const double on_film = kFilmDiagonal * focal_length / std::hypot(size[0], size[1]);
  ChangeExif(path, [on_film](Exiv2::ExifData* exif) {
    (*exif)["Exif.Photo.FocalLengthIn35mmFilm"] =
        static_cast<uint16_t>(std::lround(std::clamp(on_film, 1.0, 65535.0)));
  });
}

std::optional<double> ReadFocalLength(const std::string& path) {
  SilenceExiv2();
  const auto [width, height] = ReadPhotoSize(path);
  if (width == 0) return std::nullopt;
  std::optional<double> focal;
  try {
    const auto image = OpenExif(path);
    image->readMetadata();
    const Exiv2::ExifData& exif = image->exifData();
    if (const auto on_film = PositiveNumber(exif, "Exif.Photo.FocalLengthIn35mmFilm")) {
      focal = *on_film / kFilmDiagonal * std::hypot(width, height);
    } else {
      const auto millimetres = PositiveNumber(exif, "Exif.Photo.FocalLength");
      const auto resolution = PositiveNumber(exif, "Exif.Photo.FocalPlaneXResolution");
      const auto unit = PositiveNumber(exif, "Exif.Photo.FocalPlaneResolutionUnit");
      const auto full_width = PositiveNumber(exif, "Exif.Photo.PixelXDimension");
      if (millimetres && resolution) {
        const double per_unit = unit.value_or(2) == 3 ? 10 : 25.4;  // millimetres
        focal = *millimetres * *resolution / per_unit * width / full_width.value_or(width);
      }
    }
  } catch (const Exiv2::Error&) {
    return std::nullopt;
  }
  // What no lens has is a mistake of the file: from fisheyes to telescopes.
  const double share = focal.value_or(0) / std::max(width, height);
  return share > 0.2 && share < 100 ? focal : std::nullopt;
}

std::optional<GpsData> ReadGpsData(const std::string& path) {
  SilenceExiv2();
  try {
    auto image = OpenExif(path);
    image->readMetadata();
    const Exiv2::ExifData& exif = image->exifData();
    const auto latitude = Angle(exif, "Exif.GPSInfo.GPSLatitude", 'N', 'S', 90);
    const auto longitude = Angle(exif, "Exif.GPSInfo.GPSLongitude", 'E', 'W', 180);
    if (!latitude || !longitude || (*latitude == 0 && *longitude == 0)) return std::nullopt;
    if (Text(exif, "Exif.GPSInfo.GPSStatus").substr(0, 1) == "V") return std::nullopt;
    GpsData gps;
    gps.latitude_deg = *latitude;
    gps.longitude_deg = *longitude;
    gps.horizontal_error = PositiveNumber(exif, "Exif.GPSInfo.GPSHPositioningError");
    gps.datum = Text(exif, "Exif.GPSInfo.GPSMapDatum");
    return gps;
  } catch (const std::exception&) {
    return std::nullopt;
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

namespace {

// Byte i starts where the value i - 0.5 lies. A table over the square root, where bytes are about
// evenly spaced, says where to start looking: exact, and without a search.
struct SrgbBytes {
  static constexpr int kCells = 1024;
  std::array<float, 257> lower_bounds{};
  std::array<uint8_t, kCells + 1> first_of_cell{};

  SrgbBytes() {
    for (int i = 1; i < 256; ++i) {
      lower_bounds[i] = static_cast<float>(LinearFromSrgb((i - 0.5) / 255));
    }
    lower_bounds[256] = std::numeric_limits<float>::infinity();
    int byte = 0;
    for (int cell = 0; cell <= kCells; ++cell) {
      // A little lower than the cell: roots are rounded.
      const double root = std::max(0.0, cell - 0.01) / kCells;
      while (byte < 255 && lower_bounds[byte + 1] <= root * root) ++byte;
      first_of_cell[cell] = static_cast<uint8_t>(byte);
    }
  }
};

}  // namespace

uint8_t SrgbByteFromLinear(float linear) {
  static const SrgbBytes bytes;
  if (!(linear > 0)) return 0;
  if (linear >= 1) return 255;
  int byte = bytes.first_of_cell[static_cast<int>(std::sqrt(linear) * SrgbBytes::kCells)];
  while (linear >= bytes.lower_bounds[byte + 1]) ++byte;
  return static_cast<uint8_t>(byte);
}

}  // namespace roomtex
