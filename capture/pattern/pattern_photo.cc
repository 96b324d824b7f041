#include "capture/pattern/pattern_photo.h"

#include <algorithm>
#include <cmath>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {
namespace {

constexpr int kLargestPhoto = 2400;  // pixels of the longer side: larger photos are made smaller
constexpr int kMostFeatures = 8192;  // COLMAP's limit
constexpr int kLeastOnPlane = 25;    // chance brings together fewer
constexpr int kMostPlanes = 4;
constexpr double kPlaneTolerance = 4;  // photo pixels: a lens bends lines
constexpr int kLeastFeatures = 200;    // on planes, for the photo to be of use

using Point = cv::Point2f;

cv::Mat1b SmallGrey(const cv::Mat& photo, double* scale) {
  cv::Mat grey;
  if (photo.channels() == 3) {
    cv::cvtColor(photo, grey, cv::COLOR_BGR2GRAY);
  } else {
    grey = photo;
  }
  *scale = std::min(1.0, static_cast<double>(kLargestPhoto) / std::max(grey.cols, grey.rows));
  if (*scale < 1) cv::resize(grey, grey, {}, *scale, *scale, cv::INTER_AREA);
  return grey;
}

Point Apply(const cv::Matx33d& h, const Point& p) {
  const cv::Vec3d q = h * cv::Vec3d(p.x, p.y, 1);
  return {static_cast<float>(q[0] / q[2]), static_cast<float>(q[1] / q[2])};
}

// Square root of how many times an area grows.
double ScaleAt(const cv::Matx33d& h, const Point& p) {
  const Point o = Apply(h, p), x = Apply(h, p + Point(1, 0)) - o, y = Apply(h, p + Point(0, 1)) - o;
  return std::sqrt(std::abs(x.x * y.y - x.y * y.x));
}

// Planes one after the other, each taking its matches away.
std::vector<PatternPlane> FindPlanes(std::vector<Point> in_pattern, std::vector<Point> in_photo) {
  std::vector<PatternPlane> planes;
  while (static_cast<int>(planes.size()) < kMostPlanes &&
         static_cast<int>(in_pattern.size()) >= kLeastOnPlane) {
    std::vector<uchar> inlier;
    const cv::Mat h =
        cv::findHomography(in_pattern, in_photo, cv::RANSAC, kPlaneTolerance, inlier, 5000, 0.999);
    if (h.empty()) break;
    PatternPlane plane;
    plane.photo_from_pattern = cv::Matx33d(h);
    std::vector<Point> rest_pattern, rest_photo;
    std::vector<double> scales;
    for (size_t i = 0; i < inlier.size(); ++i) {
      if (inlier[i] == 0) {
        rest_pattern.push_back(in_pattern[i]);
        rest_photo.push_back(in_photo[i]);
      } else {
        scales.push_back(ScaleAt(plane.photo_from_pattern, in_pattern[i]));
      }
    }
    plane.matched = static_cast<int>(scales.size());
    if (plane.matched < kLeastOnPlane) break;
    plane.photo_pixels = Median(&scales);
    planes.push_back(plane);
    in_pattern.swap(rest_pattern);
    in_photo.swap(rest_photo);
  }
  std::stable_sort(planes.begin(), planes.end(), [](const PatternPlane& a, const PatternPlane& b) {
    return a.matched > b.matched;
  });
  return planes;
}

// The place of the photo where the largest plane shows the pattern: hull of its matches.
cv::Mat1b RegionOf(const PatternPlane& plane, const std::vector<Point>& in_pattern,
                   const std::vector<Point>& in_photo, cv::Size size) {
  std::vector<cv::Point> points, hull;
  for (size_t i = 0; i < in_photo.size(); ++i) {
    const Point step = Apply(plane.photo_from_pattern, in_pattern[i]) - in_photo[i];
    if (std::hypot(step.x, step.y) <= kPlaneTolerance) points.push_back(in_photo[i]);
  }
  cv::Mat1b mask(size, uchar{0});
  cv::convexHull(points, hull);
  cv::fillConvexPoly(mask, hull, cv::Scalar(255));
  return mask;
}

struct Fit {
  double correlation = -1, gain = 0;
};
Fit FitGrey(const cv::Mat1b& seen, const cv::Mat1f& expected, const cv::Mat1b& mask) {
  double n = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  for (int row = 0; row < seen.rows; ++row) {
    for (int column = 0; column < seen.cols; ++column) {
      if (mask(row, column) == 0 || seen(row, column) >= 250) continue;
      const double e = expected(row, column), s = seen(row, column);
      n += 1, x += e, y += s, xx += e * e, yy += s * s, xy += e * s;
    }
  }
  if (n < 100) return {};
  const double var_x = xx / n - x * x / n / n, var_y = yy / n - y * y / n / n;
  const double cov = xy / n - x * y / n / n;
  return {cov / std::sqrt(std::max(var_x * var_y, 1e-9)), cov / std::max(var_x, 1e-9)};
}

// How much the pattern, put into the photo, must be blurred to look like it. The tolerance of a
// plane is wider than a blur, so the fit is made with the homography refined to the photo.
void MeasureFocus(const cv::Mat1b& photo, const cv::Mat1b& pattern, const cv::Mat1b& region,
                  const PatternPlane& plane, PatternPhotoCheck* check) {
  // Only a middle piece: over it the homography holds to a fraction of a pixel.
  const cv::Moments moments = cv::moments(region, true);
  if (moments.m00 < 400) return;
  const int half = std::clamp(static_cast<int>(std::sqrt(moments.m00) / 6), 10, 120);
  const cv::Rect piece =
      cv::Rect(static_cast<int>(moments.m10 / moments.m00) - half,
               static_cast<int>(moments.m01 / moments.m00) - half, 2 * half, 2 * half) &
      cv::Rect(0, 0, photo.cols, photo.rows);
  if (piece.width < 16 || piece.height < 16) return;
  cv::Mat1f source(pattern);
  const double shrink = 1 / plane.photo_pixels;
  // A photo pixel averages `shrink` pattern pixels: a box of that width has this sigma.
  if (shrink > 1) cv::GaussianBlur(source, source, {}, std::sqrt(shrink * shrink - 1) / 3.46);
  Fit best;
  double best_sigma = 0;
  for (int dy = -3; dy <= 3; ++dy) {
    for (int dx = -3; dx <= 3; ++dx) {
      const cv::Matx33d move(1, 0, 0.5 * dx - piece.x, 0, 1, 0.5 * dy - piece.y, 0, 0, 1);
      cv::Mat1f sharp, blurred;
      cv::warpPerspective(source, sharp, move * plane.photo_from_pattern, piece.size(),
                          cv::INTER_LINEAR);
      for (double sigma = 0.4; sigma < 12; sigma *= 1.19) {
        cv::GaussianBlur(sharp, blurred, {}, sigma);
        const Fit fit = FitGrey(photo(piece), blurred, region(piece));
        if (fit.correlation > best.correlation) {
          best = fit;
          best_sigma = sigma;
        }
      }
    }
  }
  check->blur_px = best_sigma;
  check->blur_pattern_px = best_sigma / plane.photo_pixels;
  check->contrast = best.gain;
}

void MeasureExposure(const cv::Mat1b& photo, const cv::Mat1b& region, PatternPhotoCheck* check) {
  double count = 0, over = 0, sum = 0;
  for (int row = 0; row < photo.rows; ++row) {
    for (int column = 0; column < photo.cols; ++column) {
      if (region(row, column) == 0) continue;
      count += 1;
      over += photo(row, column) > 250;
      sum += photo(row, column);
    }
  }
  check->over_exposed = count > 0 ? over / count : 0;
  check->mean_grey = count > 0 ? sum / count : 0;
}

void Judge(PatternPhotoCheck* check) {
  check->usable = check->on_planes >= kLeastFeatures;
  auto& verdict = check->verdict;
  const std::string found = std::to_string(check->on_planes) + " of " +
                            std::to_string(check->features) +
                            " features of the photo are known from the pattern";
  if (check->usable) {
    verdict.push_back("The pattern can be used: " + found + ".");
  } else {
    verdict.push_back("The pattern cannot be used: only " + found + ", " +
                      std::to_string(kLeastFeatures) +
                      " are wanted. Is it the same pattern (seed, size, photo), shown unscaled?");
  }
  if (check->over_exposed > 0.05) {
    verdict.push_back(Percent(check->over_exposed) +
                      " of the pattern is over-exposed: shorten the exposure.");
  }
  if (check->mean_grey < 35) {
    verdict.push_back("The photo is dark (mean grey value " + Number(check->mean_grey, 1) +
                      " of 255): expose longer.");
  }
  if (check->planes.empty()) return;
  if (check->blur_px > 1.7 && check->blur_pattern_px > 1.7) {
    verdict.push_back("The pattern is blurred by " + Number(check->blur_px, 1) + " photo pixels (" +
                      Number(check->blur_pattern_px, 1) +
                      " projector pixels): focus the projector, then the camera.");
  }
  if (check->contrast < 0.25) {
    verdict.push_back("The pattern is pale (" + Percent(check->contrast) +
                      " of its contrast): darken the room or move the projector nearer.");
  }
}

}  // namespace

PatternPhotoCheck CheckPatternPhoto(const cv::Mat& photo, const cv::Mat1b& pattern,
                                    const PatternFeatures& pattern_features, int num_threads) {
  double scale = 1;
  const cv::Mat1b grey = SmallGrey(photo, &scale);
  const PatternFeatures features = FindFeatures(grey, kMostFeatures, 0.02);
  PatternPhotoCheck check;
  check.features = static_cast<int>(features.places.size());
  check.blur_px = check.blur_pattern_px = check.contrast = std::nan("");
  const auto matches = MatchFeatures(features, pattern_features, 4, num_threads);
  std::vector<Point> in_pattern, in_photo;
  for (size_t i = 0; i < matches.size(); ++i) {
    if (matches[i].nearest < 0 || matches[i].Ratio() >= 0.8f) continue;
    in_pattern.push_back(pattern_features.places[matches[i].nearest]);
    in_photo.push_back(features.places[i]);
  }
  check.matched = static_cast<int>(in_photo.size());
  check.planes = FindPlanes(in_pattern, in_photo);
  cv::Mat1b region(grey.size(), uchar{255});
  if (!check.planes.empty()) {
    const PatternPlane& plane = check.planes[0];
    region = RegionOf(plane, in_pattern, in_photo, grey.size());
    MeasureFocus(grey, pattern, region, plane, &check);
  }
  MeasureExposure(grey, region, &check);
  // Back to the photo's own pixels; INTER_AREA keeps the corners of the image.
  check.blur_px /= scale;
  const double shift = 0.5 / scale - 0.5;
  const cv::Matx33d photo_from_small(1 / scale, 0, shift, 0, 1 / scale, shift, 0, 0, 1);
  for (PatternPlane& plane : check.planes) {
    plane.photo_from_pattern = photo_from_small * plane.photo_from_pattern;
    plane.photo_pixels /= scale;
    check.on_planes += plane.matched;
  }
  Judge(&check);
  return check;
}

}  // namespace roomtex
