#include "core/photo_fit.h"

#include <exiv2/exiv2.hpp>
#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::HasSubstr;

class PhotoFits : public testing::Test {
 protected:
  // Dark, with a bright upper left quarter; orientation 0 = no EXIF.
  std::string Write(const std::string& name, int width, int height, int orientation = 0) const {
    cv::Mat picture(height, width, CV_8UC3, cv::Scalar(20, 20, 20));
    picture(cv::Rect(0, 0, width / 2, height / 2)).setTo(cv::Scalar(220, 220, 220));
    cv::imwrite(folder_ / name, picture);
    if (orientation == 0) return folder_ / name;
    auto image = Exiv2::ImageFactory::open(folder_ / name);
    image->readMetadata();
    image->exifData()["Exif.Image.Orientation"] = static_cast<uint16_t>(orientation);
    image->writeMetadata();
    return folder_ / name;
  }
  static PhotoFit Fit(const std::string& path) { return FitPhotoToCamera(path, "a.jpg", 120, 80); }

  TempFolder folder_;
};

TEST_F(PhotoFits, PixelsAreThoseStoredWhateverExifSays) {
  for (int orientation = 0; orientation <= 8; ++orientation) {
    const std::string path = Write("a.jpg", 120, 80, orientation);
    const PhotoFit fit = Fit(path);
    EXPECT_TRUE(fit.usable()) << fit.problem;
    EXPECT_EQ(fit.pixels, PhotoPixels::kAsStored);
    EXPECT_FALSE(fit.scaled);
    EXPECT_EQ(fit.note, "");
    const cv::Mat photo = ReadFittedPhoto(path, fit, 120, 80);
    EXPECT_GT(photo.at<cv::Vec3b>(20, 30)[0], 200);
  }
}

// Where the bright quarter of the stored picture is to be seen (EXIF 2.3, 4.6.4).
TEST_F(PhotoFits, ExifTurnsAPhotoOnlyWhereTheCameraIsTurned) {
  struct Case {
    int orientation, x, y;
  };
  for (const Case& one : {Case{5, 30, 20}, {6, 90, 20}, {7, 90, 60}, {8, 30, 60}}) {
    const std::string path = Write("a.jpg", 80, 120, one.orientation);
    const PhotoFit fit = Fit(path);
    ASSERT_TRUE(fit.usable()) << fit.problem;
    EXPECT_EQ(fit.pixels, PhotoPixels::kTurnedByExif);
    EXPECT_EQ(fit.width, 120);
    EXPECT_THAT(fit.note, HasSubstr("is turned as its EXIF orientation says"));
    const cv::Mat photo = ReadFittedPhoto(path, fit, 120, 80);
    ASSERT_EQ(photo.size(), cv::Size(120, 80));
    EXPECT_GT(photo.at<cv::Vec3b>(one.y, one.x)[0], 200) << one.orientation;
    EXPECT_LT(photo.at<cv::Vec3b>(79 - one.y, 119 - one.x)[0], 50) << one.orientation;
  }
}

// Cells of 7 pixels: 17 x 11 of them, and a row of 3 and a column of 1 pixel that are left over.
TEST_F(PhotoFits, CellsAreMeansOfThePixelsWhateverTheFilesSize) {
  for (const int times : {1, 2, 3}) {
    const std::string path = Write("a.png", 120 * times, 80 * times);
    const PhotoFit fit = Fit(path);
    ASSERT_TRUE(fit.usable()) << fit.problem;
    const cv::Mat cells = ReadFittedCells(path, fit, 120, 80, 7);
    ASSERT_EQ(cells.size(), cv::Size(17, 11));
    // The quarter ends at 60 = 8 4/7 cells and at 40 = 5 5/7.
    EXPECT_GT(cells.at<cv::Vec3b>(4, 7)[0], 215);
    EXPECT_NEAR(cells.at<cv::Vec3b>(2, 8)[0], 20 + 200 * 4 / 7, 16);  // half a pixel of seven
    EXPECT_NEAR(cells.at<cv::Vec3b>(5, 3)[0], 20 + 200 * 5 / 7, 16);
    EXPECT_LT(cells.at<cv::Vec3b>(2, 9)[0], 25);
    EXPECT_LT(cells.at<cv::Vec3b>(6, 3)[0], 25);
  }
  for (const auto& [orientation, x, y] : {std::tuple(6, 13, 2), {8, 3, 8}}) {
    const std::string path = Write("a.jpg", 80, 120, orientation);
    const cv::Mat cells = ReadFittedCells(path, Fit(path), 120, 80, 7);
    EXPECT_GT(cells.at<cv::Vec3b>(y, x)[0], 200);
    EXPECT_LT(cells.at<cv::Vec3b>(10 - y, 16 - x)[0], 50);
  }
}

TEST_F(PhotoFits, TurnedWithoutExifIsNamed) {
  for (const int orientation : {0, 1, 3}) {
    const PhotoFit fit = Fit(Write("a.jpg", 80, 120, orientation));
    EXPECT_FALSE(fit.usable());
    EXPECT_THAT(fit.problem, HasSubstr("a.jpg has 80 x 120 pixels, its camera 120 x 80: the file "
                                       "was turned after the model was made. Turn it back"));
  }
}

TEST_F(PhotoFits, ACleanFactorIsACopyOfAnotherSize) {
  for (const auto& [width, height] :
       {std::pair(60, 40), {240, 160}, {61, 41}, {50, 33}, {50, 34}}) {
    const std::string path = Write("a.png", width, height);
    const PhotoFit fit = Fit(path);
    EXPECT_TRUE(fit.usable()) << fit.problem;
    EXPECT_TRUE(fit.scaled);
    EXPECT_THAT(fit.note, HasSubstr("the camera is scaled"));
    EXPECT_EQ(ReadFittedPhoto(path, fit, 120, 80).size(), cv::Size(120, 80));
  }
  // Turned and reduced.
  const PhotoFit fit = Fit(Write("b.jpg", 40, 60, 6));
  EXPECT_TRUE(fit.usable() && fit.scaled);
  EXPECT_EQ(fit.width, 60);
}

TEST_F(PhotoFits, ACropIsNamed) {
  for (const auto& [width, height] : {std::pair(120, 70), {100, 80}, {120, 78}, {90, 90}}) {
    const PhotoFit fit = Fit(Write("a.png", width, height));
    EXPECT_FALSE(fit.usable()) << width << " " << height;
    EXPECT_THAT(fit.problem, HasSubstr("it was cropped, or another photo took its place"));
  }
}

TEST_F(PhotoFits, WhatIsNoPhotoIsNamed) {
  EXPECT_THAT(Fit(folder_ / "none.jpg").problem, HasSubstr("There is no photo"));
  WriteBytes(folder_ / "text.jpg", "no picture");
  EXPECT_THAT(Fit(folder_ / "text.jpg").problem, HasSubstr("text.jpg"));
  WriteBytes(folder_ / "empty.jpg", "");
  EXPECT_FALSE(Fit(folder_ / "empty.jpg").usable());
}

}  // namespace
}  // namespace roomtex
