#include "align/pick/photo_corner.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <opencv2/imgproc.hpp>

namespace roomtex {
namespace {

constexpr int kMinReach = 3, kMaxReach = 25;  // pixels
// Of the sums of squared gradients along and across: below, it is an edge. A right angle has 1, one
// of 30 degrees 0.07.
constexpr double kMinRoundness = 0.05;
constexpr double kMinGradient = 4;      // grey levels per pixel, rms over the window, across
constexpr double kMaxDisagreement = 1;  // pixels between a window and one of half its size

constexpr double kMaxAstray = 0.25;  // pixels, when it is looked for from beside it

// By cornerSubPix, in its coordinates: whole numbers are pixel centres.
cv::Point2f Refined(const cv::Mat1b& photo, cv::Point2f at, int half) {
  std::vector<cv::Point2f> points = {at};
  cv::cornerSubPix(photo, points, {half, half}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
  return points[0];
}

// Where cornerSubPix runs away it gives the place that it began at, which looks like a corner
// found.
bool IsFoundFromBeside(const cv::Mat1b& photo, cv::Point2f corner, int half) {
  const cv::Point2f again = Refined(photo, corner + cv::Point2f(0.5F, -0.5F), half);
  return std::hypot(again.x - corner.x, again.y - corner.y) <= kMaxAstray;
}

bool IsCorner(const cv::Mat1b& photo, cv::Point2f at, int half) {
  const cv::Rect around(cvRound(at.x) - half, cvRound(at.y) - half, 2 * half + 1, 2 * half + 1);
  cv::Mat1f dx, dy;
  cv::Scharr(photo(around), dx, CV_32F, 1, 0, 1.0 / 32);
  cv::Scharr(photo(around), dy, CV_32F, 0, 1, 1.0 / 32);
  const double xx = dx.dot(dx), yy = dy.dot(dy), xy = dx.dot(dy);
  const double middle = 0.5 * (xx + yy), spread = std::hypot(0.5 * (xx - yy), xy);
  const double smaller = middle - spread;
  // An edge across the window has its gradients on a line of 2 half + 1 of its pixels, thrice.
  const double on_a_line = 3.0 * (2 * half + 1);
  return smaller > kMinRoundness * (middle + spread) &&
         smaller > kMinGradient * kMinGradient * on_a_line / 2;
}

}  // namespace

std::optional<Eigen::Vector2d> FindCorner(const cv::Mat1b& photo, const Eigen::Vector2d& x_in_img,
                                          double reach) {
  const int half = std::clamp(cvRound(reach), kMinReach, kMaxReach);
  const cv::Point2f click(static_cast<float>(x_in_img.x() - 0.5),
                          static_cast<float>(x_in_img.y() - 0.5));
  const auto fits = [&](cv::Point2f at) {
    const int x = cvRound(at.x), y = cvRound(at.y);
    return x >= half && y >= half && x + half < photo.cols && y + half < photo.rows;
  };
  if (!fits(click)) return std::nullopt;
  const cv::Point2f wide = Refined(photo, click, half);
  const int narrow = std::max(kMinReach, half / 2);
  const cv::Point2f corner = Refined(photo, wide, narrow);
  const bool agree = std::hypot(corner.x - wide.x, corner.y - wide.y) <= kMaxDisagreement;
  const bool near = std::hypot(corner.x - click.x, corner.y - click.y) <= half;
  if (!agree || !near || !fits(corner) || !IsCorner(photo, corner, half)) return std::nullopt;
  if (!IsFoundFromBeside(photo, corner, narrow)) return std::nullopt;
  return Eigen::Vector2d(corner.x + 0.5, corner.y + 0.5);
}

}  // namespace roomtex
