#include "align/pick/photo_corner.h"

#include <gmock/gmock.h>
#include <opencv2/imgproc.hpp>

#include "tests/support/matchers.h"

namespace roomtex {
namespace {

// A dark square with its upper-left corner at a place between pixels, or two that touch there,
// drawn sixteen times as large and made smaller, so that the borders fall as a camera sees them;
// with noise.
cv::Mat1b PhotoOfSquare(const Eigen::Vector2d& corner, double noise, bool crossing = false) {
  constexpr int kFiner = 16;
  cv::Mat1b large(100 * kFiner, 120 * kFiner, uchar{190});
  const cv::Point at(cvRound(corner.x() * kFiner), cvRound(corner.y() * kFiner));
  large(cv::Rect(at, cv::Size(50 * kFiner, 40 * kFiner))).setTo(60);
  if (crossing) large(cv::Rect(cv::Point(0, 0), at)).setTo(60);
  cv::Mat1b photo;
  cv::resize(large, photo, {120, 100}, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(photo, photo, {}, 0.7);
  cv::Mat1d noisy(photo.size());
  cv::RNG random(3);
  random.fill(noisy, cv::RNG::NORMAL, 0, noise);
  noisy += photo;
  noisy.convertTo(photo, CV_8U);
  return photo;
}

TEST(PhotoCorner, IsFoundToAFractionOfAPixel) {
  for (const Eigen::Vector2d& corner :
       {Eigen::Vector2d(40, 30), {40.25, 30.5}, {39.8125, 30.625}}) {
    const cv::Mat1b photo = PhotoOfSquare(corner, 2), crossing = PhotoOfSquare(corner, 2, true);
    for (const Eigen::Vector2d& off : {Eigen::Vector2d(0, 0), {4, -3}, {-3, -4}, {2, 5}}) {
      const auto found = FindCorner(photo, corner + off, 8);
      ASSERT_TRUE(found) << off.transpose();
      // Blur rounds a corner: its place goes inwards by a part of the blur's 0.7 pixels.
      EXPECT_LT((*found - corner).norm(), 0.35) << off.transpose();
      const auto crossed = FindCorner(crossing, corner + off, 8);
      ASSERT_TRUE(crossed) << off.transpose();
      EXPECT_LT((*crossed - corner).norm(), 0.1) << off.transpose();
    }
  }
}

TEST(PhotoCorner, IsNoneOnAnEdgeInNoiseOnNothingAndAtTheBorder) {
  const cv::Mat1b photo = PhotoOfSquare({40, 30}, 2);
  EXPECT_FALSE(FindCorner(photo, {65, 30}, 8)) << "the middle of an edge";
  EXPECT_FALSE(FindCorner(photo, {65, 50}, 8)) << "noise";
  EXPECT_FALSE(FindCorner(photo, {20, 80}, 8)) << "noise";
  EXPECT_FALSE(FindCorner(PhotoOfSquare({40, 30}, 0), {20, 80}, 8)) << "nothing";
  EXPECT_FALSE(FindCorner(photo, {2, 30}, 8));
  EXPECT_FALSE(FindCorner(photo, {119.5, 99.5}, 8));
  EXPECT_FALSE(FindCorner(photo, {60, 40}, 3)) << "out of reach";
}

// Blobs without order: from many places the search runs away, and gives what it began with.
TEST(PhotoCorner, IsTheSameFromBesideOrNone) {
  cv::Mat1b photo(100, 120);
  cv::RNG(5).fill(photo, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(photo, photo, {}, 1.5);
  int found = 0, astray = 0;
  for (double y = 20; y < 80; y += 3.7) {
    for (double x = 20; x < 100; x += 3.7) {
      for (const double reach : {3.0, 8.0}) {
        const auto corner = FindCorner(photo, {x, y}, reach);
        if (!corner) continue;
        ++found;
        const auto again = FindCorner(photo, *corner + Eigen::Vector2d(-0.4, 0.2), reach);
        if (!again || (*again - *corner).norm() > 0.3) ++astray;
      }
    }
  }
  EXPECT_GT(found, 100);
  EXPECT_LT(astray, found / 20) << found;
}

}  // namespace
}  // namespace roomtex
