#include "core/photo.h"

#include <cmath>

#include <exiv2/exiv2.hpp>
#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

// Left half one colour, right half another; the corner at the upper left is marked.
cv::Mat TestImage(int width, int height) {
  cv::Mat image(height, width, CV_8UC3, cv::Scalar(40, 90, 200));
  image(cv::Rect(width / 2, 0, width - width / 2, height)).setTo(cv::Scalar(200, 120, 30));
  image(cv::Rect(0, 0, 8, 8)).setTo(cv::Scalar(255, 255, 255));
  return image;
}

class PhotoFile : public testing::Test {
 protected:
  void SetUp() override { cv::imwrite(path_, TestImage(64, 48)); }
  TempFolder folder_;
  const std::string path_ = folder_ / "photo.jpg";
};

TEST_F(PhotoFile, IsReadAsStored) {
  const cv::Mat image = ReadPhoto(path_);
  ASSERT_EQ(image.type(), CV_8UC3);
  EXPECT_EQ(image.cols, 64);
  EXPECT_EQ(image.rows, 48);
  EXPECT_NEAR(image.at<cv::Vec3b>(40, 5)[2], 200, 8);   // BGR: red on the left
  EXPECT_NEAR(image.at<cv::Vec3b>(40, 60)[0], 200, 8);  // blue on the right
  EXPECT_EQ(ReadPhotoSize(path_), (std::array<int, 2>{64, 48}));
}

TEST_F(PhotoFile, IsReadSmallAndGrey) {
  const cv::Mat1b whole = ReadGreyPhoto(path_, 1), half = ReadGreyPhoto(path_, 2);
  EXPECT_EQ(whole.size(), cv::Size(64, 48));
  EXPECT_EQ(half.size(), cv::Size(32, 24));
  EXPECT_EQ(ReadGreyPhoto(path_, 8).size(), cv::Size(8, 6));
  // 0.114 blue + 0.587 green + 0.299 red of the left half.
  EXPECT_NEAR(whole(40, 5), 0.114 * 40 + 0.587 * 90 + 0.299 * 200, 4);
  EXPECT_NEAR(half(20, 3), whole(40, 6), 4);
  const std::string bytes = ReadBytes(path_);
  WriteBytes(path_, bytes.substr(0, bytes.size() / 2));
  EXPECT_INPUT_ERROR(ReadGreyPhoto(path_, 2), "ends before the picture does");
}

// 8 x 8 pixels of four inks, each 0 everywhere: baseline, each table with one code of one bit.
std::string FourInks(bool adobe) {
  std::string bytes("\xff\xd8", 2);
  if (adobe)
    bytes += std::string(
        "\xff\xee\0\x0e"
        "Adobe\0\x64\0\0\0\0\0",
        16);
  bytes += std::string("\xff\xdb\0\x43\0", 5) + std::string(64, '\x08');
  bytes += std::string("\xff\xc0\0\x14\x08\0\x08\0\x08\x04", 10);
  for (const char id : {1, 2, 3, 4}) bytes += std::string{id, '\x11', '\0'};
  for (const char table : {'\0', '\x10'}) {  // DC: a difference of 8 bits; AC: the block ends
    bytes += std::string("\xff\xc4\0\x14", 4) + table + '\x01' + std::string(15, '\0');
    bytes += table == 0 ? '\x08' : '\0';
  }
  bytes += std::string("\xff\xda\0\x0e\x04", 5);
  for (const char id : {1, 2, 3, 4}) bytes += std::string{id, '\0'};
  bytes += std::string("\0\x3f\0", 3);
  // Four times 0, then the 8 bits of -128, then 0.
  return bytes + std::string("\x3f\x8f\xe3\xf8\xfe", 5) + "\xff\xd9";
}

TEST_F(PhotoFile, InksMustSayWhichWayRoundTheyAre) {
  WriteBytes(path_, FourInks(true));  // Adobe's 0 is all ink
  EXPECT_EQ(ReadPhoto(path_).at<cv::Vec3b>(4, 4), cv::Vec3b(0, 0, 0));
  WriteBytes(path_, FourInks(false));
  EXPECT_INPUT_ERROR(ReadPhoto(path_), "four inks (CMYK) that does not say which way round");
}

TEST_F(PhotoFile, OrientationIsNotApplied) {
  auto exif_image = Exiv2::ImageFactory::open(path_);
  exif_image->readMetadata();
  exif_image->exifData()["Exif.Image.Orientation"] =
      static_cast<uint16_t>(6);  // turn by 90 degrees
  exif_image->writeMetadata();
  const cv::Mat image = ReadPhoto(path_);
  EXPECT_EQ(image.cols, 64);
  EXPECT_EQ(image.rows, 48);
  EXPECT_GT(image.at<cv::Vec3b>(3, 3)[0], 220);  // the mark is still at the upper left
  EXPECT_EQ(ReadPhotoSize(path_), (std::array<int, 2>{64, 48}));
}

// OpenCV turns a TIFF by itself.
TEST_F(PhotoFile, OrientationOfATiffIsNotApplied) {
  const std::string tiff = folder_ / "photo.tif";
  for (const int orientation : {1, 2, 3, 4, 5, 6, 7, 8}) {
    cv::imwrite(tiff, TestImage(64, 48));
    auto exif_image = Exiv2::ImageFactory::open(tiff);
    exif_image->readMetadata();
    exif_image->exifData()["Exif.Image.Orientation"] = static_cast<uint16_t>(orientation);
    exif_image->writeMetadata();
    const cv::Mat image = ReadPhoto(tiff);
    ASSERT_EQ(image.size(), cv::Size(64, 48)) << orientation;
    EXPECT_EQ(cv::norm(image, TestImage(64, 48), cv::NORM_INF), 0) << orientation;
    EXPECT_EQ(ExifExchangesSides(tiff), orientation >= 5);
  }
}

TEST(ReadPhoto, TakesGreyAlphaAndSixteenBits) {
  const TempFolder folder;
  cv::imwrite(folder / "grey.png", cv::Mat(10, 20, CV_8UC1, cv::Scalar(77)));
  cv::imwrite(folder / "alpha.png", cv::Mat(10, 20, CV_8UC4, cv::Scalar(1, 2, 3, 4)));
  cv::imwrite(folder / "deep.png", cv::Mat(10, 20, CV_16UC3, cv::Scalar(257, 514, 65535)));
  EXPECT_EQ(ReadPhoto(folder / "grey.png").at<cv::Vec3b>(5, 5), cv::Vec3b(77, 77, 77));
  EXPECT_EQ(ReadPhoto(folder / "alpha.png").at<cv::Vec3b>(5, 5), cv::Vec3b(1, 2, 3));
  EXPECT_EQ(ReadPhoto(folder / "deep.png").at<cv::Vec3b>(5, 5), cv::Vec3b(1, 2, 255));
}

TEST(ReadPhoto, RefusesRealNumbers) {
  TempFolder folder;
  // Without the option OpenCV writes logarithms, which have a white.
  cv::imwrite(folder / "light.tif", cv::Mat(10, 20, CV_32FC3, cv::Scalar(0.2, 0.5, 0.9)),
              {cv::IMWRITE_TIFF_COMPRESSION, 1});
  EXPECT_INPUT_ERROR(ReadPhoto(folder / "light.tif"), "floating-point");
  cv::imwrite(folder / "deep.tif", cv::Mat(10, 20, CV_16UC3, cv::Scalar(51 * 257, 0, 255 * 257)));
  EXPECT_EQ(ReadPhoto(folder / "deep.tif").at<cv::Vec3b>(5, 5), cv::Vec3b(51, 0, 255));
}

TEST(ReadTransparency, KnowsThatAColourOfAPaletteMayBeTransparent) {
  TempFolder folder;
  // Two pixels of a palette of two colours (red, green, blue: 200 10 20 and 30 40 50), of which the
  // first is transparent (tRNS).
  constexpr char kPng[] =
      "\x89\x50\x4e\x47\x0d\x0a\x1a\x0a\x00\x00\x00\x0d\x49\x48\x44\x52"
      "\x00\x00\x00\x02\x00\x00\x00\x01\x08\x03\x00\x00\x00\xc3\xfc\x8f"
      "\xb8\x00\x00\x00\x06\x50\x4c\x54\x45\xc8\x0a\x14\x1e\x28\x32\x4e"
      "\x25\x8c\x2f\x00\x00\x00\x02\x74\x52\x4e\x53\x00\xff\x5b\x91\x22"
      "\xb5\x00\x00\x00\x0e\x49\x44\x41\x54\x78\x01\x01\x03\x00\xfc\xff"
      "\x00\x00\x01\x00\x04\x00\x02\x0b\x21\x8b\x71\x00\x00\x00\x00\x49"
      "\x45\x4e\x44\xae\x42\x60\x82";
  WriteBytes(folder / "palette.png", std::string(kPng, sizeof kPng - 1));
  EXPECT_EQ(ReadPhoto(folder / "palette.png").at<cv::Vec3b>(0, 1), cv::Vec3b(50, 40, 30));
  const cv::Mat1b transparent = ReadTransparency(folder / "palette.png", PhotoPixels::kAsStored);
  ASSERT_EQ(transparent.size(), cv::Size(2, 1));
  EXPECT_GT(transparent(0, 0), 0);
  EXPECT_EQ(transparent(0, 1), 0);
}

TEST_F(PhotoFile, BrokenOnesAreRefused) {
  EXPECT_INPUT_ERROR(ReadPhoto(folder_ / "missing.jpg"), "does not exist");
  EXPECT_INPUT_ERROR(ReadPhoto(folder_.path()), "is a folder");
  const std::string bytes = ReadBytes(path_);
  for (const size_t size :
       {size_t{3}, size_t{20}, bytes.size() / 2, bytes.size() - 20, bytes.size() - 1}) {
    WriteBytes(path_, bytes.substr(0, size));
    EXPECT_INPUT_ERROR(ReadPhoto(path_), "the file ends before the picture does");
  }
  for (const std::string& other : {std::string(), std::string("no image at all"),
                                   std::string(1000, '\0'), std::string("\xff\xd8")}) {
    WriteBytes(path_, other);
    EXPECT_INPUT_ERROR(ReadPhoto(path_), path_);
  }
  const std::string png = folder_ / "photo.png";
  cv::imwrite(png, TestImage(64, 48));
  WriteBytes(png, ReadBytes(png).substr(0, 60));
  EXPECT_INPUT_ERROR(ReadPhoto(png), "is not an image that can be decoded");
}

TEST_F(PhotoFile, EveryTruncationIsRefused) {
  const std::string bytes = ReadBytes(path_);
  for (size_t size = 0; size < bytes.size(); ++size) {
    WriteBytes(path_, bytes.substr(0, size));
    EXPECT_THROW(ReadPhoto(path_), InputError) << size;
  }
}

TEST_F(PhotoFile, BytesBehindThePictureAreAllowed) {
  WriteBytes(path_, ReadBytes(path_) + "a motion photo's film");
  EXPECT_EQ(ReadPhoto(path_).cols, 64);
}

TEST(ReadPhotoSize, CannotTellForOtherFiles) {
  const TempFolder folder;
  EXPECT_EQ(ReadPhotoSize(folder / "missing"), (std::array<int, 2>{0, 0}));
  WriteBytes(folder / "text", "text");
  EXPECT_EQ(ReadPhotoSize(folder / "text"), (std::array<int, 2>{0, 0}));
  EXPECT_EQ(ReadPhotoSize(folder.path()), (std::array<int, 2>{0, 0}));
}

// EXIF.

class ExposureTime : public PhotoFile, public testing::WithParamInterface<double> {};
INSTANTIATE_TEST_SUITE_P(All, ExposureTime,
                         testing::Values(1.0 / 32000, 1.0 / 8000, 1.0 / 4000, 1.0 / 2000, 1.0 / 125,
                                         1.0 / 3, 0.5, 0.8, 1.0, 1.6, 30.0, 3600.0));

TEST_P(ExposureTime, GoesRound) {
  ExposureData written;
  written.exposure_time = GetParam();
  WriteExposureData(path_, written);
  const ExposureData read = ReadExposureData(path_);
  ASSERT_TRUE(read.exposure_time);
  EXPECT_NEAR(*read.exposure_time / GetParam(), 1, 1e-6);
}

TEST_F(PhotoFile, ExposureDataGoesRoundAndKeepsThePicture) {
  const cv::Mat before = ReadPhoto(path_);
  const ExposureData written{0.02, 5.6, 400, "Canon EOS 20D", "2008:05:01 12:00:00"};
  WriteExposureData(path_, written);
  const ExposureData read = ReadExposureData(path_);
  EXPECT_NEAR(read.exposure_time.value_or(0), 0.02, 1e-8);
  EXPECT_NEAR(read.f_number.value_or(0), 5.6, 1e-5);
  EXPECT_EQ(read.iso.value_or(0), 400);
  EXPECT_EQ(read.camera, written.camera);
  EXPECT_EQ(read.date_time, written.date_time);
  EXPECT_EQ(cv::norm(before, ReadPhoto(path_), cv::NORM_INF), 0);
}

TEST_F(PhotoFile, FocalLengthGoesRoundToAMillimetreOfFilm) {
  WriteExposureData(path_, {0.02, 5.6, 400, "Canon EOS 20D", ""});
  WriteFocalLength(path_, 60, {64, 48});
  // 80 pixels of diagonal are 43.27 mm of film: 32.45 mm, which are noted as 32.
  EXPECT_EQ(ReadLensData(path_).focal_length_on_film_mm.value_or(0), 32);
  EXPECT_NEAR(ReadFocalLength(path_).value_or(0), 32 / 43.2666 * 80, 1e-3);
  EXPECT_EQ(ReadExposureData(path_).iso.value_or(0), 400);
}

TEST_F(PhotoFile, ExposureTimeHasTheTypeThatExifDemands) {
  WriteExposureData(path_, {0.02, 5.6, 400, "", ""});
  auto image = Exiv2::ImageFactory::open(path_);
  image->readMetadata();
  EXPECT_EQ(image->exifData()["Exif.Photo.ExposureTime"].typeId(), Exiv2::unsignedRational);
  EXPECT_EQ(image->exifData()["Exif.Photo.FNumber"].typeId(), Exiv2::unsignedRational);
  EXPECT_EQ(image->exifData()["Exif.Photo.ISOSpeedRatings"].typeId(), Exiv2::unsignedShort);
}

TEST_F(PhotoFile, ShutterSpeedStandsInForTheExposureTime) {
  auto image = Exiv2::ImageFactory::open(path_);
  image->exifData()["Exif.Photo.ShutterSpeedValue"] = Exiv2::Rational(5, 1);  // APEX: 1/32 s
  image->exifData()["Exif.Image.Make"] = "Canon";
  image->exifData()["Exif.Image.Model"] = "EOS";
  image->writeMetadata();
  EXPECT_NEAR(ReadExposureData(path_).exposure_time.value_or(0), 1.0 / 32, 1e-9);
  EXPECT_EQ(ReadExposureData(path_).camera, "Canon EOS");
}

TEST_F(PhotoFile, MissingOrBrokenExifIsNoError) {
  const TempFolder folder;
  WriteBytes(folder / "text", "text");
  for (const std::string& path : {path_, folder / "text", folder / "missing", folder.path()}) {
    const ExposureData data = ReadExposureData(path);
    EXPECT_FALSE(data.exposure_time) << path;
    EXPECT_FALSE(data.RelativeExposure());
    EXPECT_EQ(data.camera, "");
  }
  auto image = Exiv2::ImageFactory::open(path_);
  image->exifData()["Exif.Photo.ExposureTime"] = Exiv2::URational(1, 0);
  image->exifData()["Exif.Photo.FNumber"] = Exiv2::URational(0, 1);
  image->writeMetadata();
  EXPECT_FALSE(ReadExposureData(path_).exposure_time);
  EXPECT_FALSE(ReadExposureData(path_).f_number);
}

TEST(WriteExposureData, SaysWhyItCannot) {
  const TempFolder folder;
  EXPECT_INPUT_ERROR(WriteExposureData(folder / "missing.jpg", {}), "EXIF cannot be written");
}

TEST(ExposureData, CollectsLightAsTimeAndIsoOverSquaredAperture) {
  ExposureData data;
  EXPECT_FALSE(data.RelativeExposure());
  data.exposure_time = 0.5;
  EXPECT_EQ(data.RelativeExposure(), 0.5);
  data.f_number = 2;
  data.iso = 100;
  EXPECT_EQ(data.RelativeExposure(), 0.5 * 100 / 4);
}

// GPS.

// Writes EXIF entries as "key value" in exiv2's text form, e.g. {"GPSLatitude", "47/1 30/1 0/1"}.
void WriteGps(const std::string& path,
              const std::vector<std::pair<std::string, std::string>>& entries) {
  auto image = Exiv2::ImageFactory::open(path);
  image->readMetadata();
  image->exifData().clear();
  for (const auto& [key, value] : entries) image->exifData()["Exif.GPSInfo." + key] = value;
  image->writeMetadata();
}

TEST_F(PhotoFile, GpsPositionIsRead) {
  WriteGps(path_, {{"GPSLatitudeRef", "N"},
                   {"GPSLatitude", "47/1 30/1 3660/100"},
                   {"GPSLongitudeRef", "E"},
                   {"GPSLongitude", "8/1 15/1 0/1"}});
  const std::optional<GpsData> plain = ReadGpsData(path_);
  ASSERT_TRUE(plain);
  EXPECT_NEAR(plain->latitude_deg, 47 + 30 / 60.0 + 36.6 / 3600, 1e-12);
  EXPECT_NEAR(plain->longitude_deg, 8.25, 1e-12);
  EXPECT_FALSE(plain->horizontal_error);
  EXPECT_EQ(plain->datum, "");
  // South and west, fractions of minutes, seconds not given, the error and the datum stated.
  WriteGps(path_, {{"GPSLatitudeRef", "S"},
                   {"GPSLatitude", "33/1 545678/10000 0/0"},
                   {"GPSLongitudeRef", "W"},
                   {"GPSLongitude", "4000000000/50000000 0/1 0/1"},
                   {"GPSHPositioningError", "48/10"},
                   {"GPSMapDatum", "WGS-84"},
                   {"GPSStatus", "A"}});
  const std::optional<GpsData> full = ReadGpsData(path_);
  ASSERT_TRUE(full);
  EXPECT_NEAR(full->latitude_deg, -(33 + 54.5678 / 60), 1e-12);
  EXPECT_NEAR(full->longitude_deg, -80, 1e-12);
  EXPECT_NEAR(full->horizontal_error.value_or(0), 4.8, 1e-6);
  EXPECT_EQ(full->datum, "WGS-84");
}

TEST_F(PhotoFile, BrokenGpsIsNone) {
  using Entries = std::vector<std::pair<std::string, std::string>>;
  const Entries good = {{"GPSLatitudeRef", "N"},
                        {"GPSLatitude", "47/1 30/1 0/1"},
                        {"GPSLongitudeRef", "E"},
                        {"GPSLongitude", "8/1 15/1 0/1"}};
  WriteGps(path_, good);
  EXPECT_TRUE(ReadGpsData(path_));
  const std::pair<std::string, std::string> bad[] = {{"GPSLatitude", "47/0 30/1 0/1"},
                                                     {"GPSLatitude", "0/0 0/0 0/0"},
                                                     {"GPSLatitude", "91/1 0/1 0/1"},
                                                     {"GPSLatitude", "47/1 61/1 0/1"},
                                                     {"GPSLongitude", "181/1 0/1 0/1"},
                                                     {"GPSLongitude", "1/1 0/1 0/1 0/1"},
                                                     {"GPSLongitudeRef", "X"},
                                                     {"GPSLatitudeRef", ""},
                                                     {"GPSStatus", "V"}};
  for (const auto& [key, value] : bad) {
    Entries entries = good;
    for (auto& [good_key, good_value] : entries) {
      if (good_key == key) good_value = value;
    }
    if (key == "GPSStatus") entries.emplace_back(key, value);
    WriteGps(path_, entries);
    EXPECT_FALSE(ReadGpsData(path_)) << key << " " << value;
  }
  for (const std::string key : {"GPSLatitude", "GPSLongitude", "GPSLatitudeRef"}) {
    Entries entries;
    for (const auto& entry : good) {
      if (entry.first != key) entries.push_back(entry);
    }
    WriteGps(path_, entries);
    EXPECT_FALSE(ReadGpsData(path_)) << key;
  }
  WriteGps(path_, {{"GPSLatitudeRef", "N"},
                   {"GPSLatitude", "0/1 0/1 0/1"},
                   {"GPSLongitudeRef", "E"},
                   {"GPSLongitude", "0/1 0/1 0/1"}});
  EXPECT_FALSE(ReadGpsData(path_));
  WriteGps(path_, {});
  EXPECT_FALSE(ReadGpsData(path_));
  EXPECT_FALSE(ReadGpsData(folder_ / "missing.jpg"));
}

// sRGB.

TEST(Srgb, EveryByteGoesRound) {
  for (int byte = 0; byte < 256; ++byte) {
    EXPECT_EQ(SrgbByteFromLinear(LinearFromSrgbByte()[byte]), byte);
    EXPECT_NEAR(255 * SrgbFromLinear(LinearFromSrgb(byte / 255.0)), byte, 1e-4);
  }
}

TEST(Srgb, BytesAreTheNearestOnes) {
  for (int i = 0; i <= 10000; ++i) {
    const double linear = i / 10000.0;
    EXPECT_NEAR(SrgbByteFromLinear(static_cast<float>(linear)), 255 * SrgbFromLinear(linear),
                0.5001);
  }
}

TEST(Srgb, HasTheValuesOfTheStandard) {
  EXPECT_EQ(LinearFromSrgb(0), 0);
  EXPECT_NEAR(LinearFromSrgb(1), 1, 1e-12);
  EXPECT_NEAR(LinearFromSrgb(0.5), 0.21404114, 1e-7);
  EXPECT_NEAR(LinearFromSrgb(0.04), 0.04 / 12.92, 1e-12);
  EXPECT_NEAR(SrgbFromLinear(0.18), 0.46135612, 1e-6);
}

TEST(Srgb, ClampsWhatIsOutside) {
  EXPECT_EQ(SrgbByteFromLinear(-1), 0);
  EXPECT_EQ(SrgbByteFromLinear(2), 255);
  EXPECT_EQ(SrgbByteFromLinear(std::nanf("")), 0);
  EXPECT_EQ(SrgbByteFromLinear(std::numeric_limits<float>::infinity()), 255);
}

TEST(Srgb, BytesAreTheNearestForEveryLight) {
  for (int i = 0; i <= 2000000; ++i) {
    const float linear = static_cast<float>(i) / 1900000.0f;
    const double nearest = 255 * SrgbFromLinear(std::min(1.0f, linear));
    ASSERT_LE(std::abs(SrgbByteFromLinear(linear) - nearest), 0.5 + 1e-3) << linear;
  }
  EXPECT_EQ(SrgbByteFromLinear(1e-30f), 0);
}

}  // namespace
}  // namespace roomtex
