// Edge directions of small pictures, and their correlation.

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "capture/association/associated_views_light.h"
#include "capture/association/associated_views_shift.h"

namespace roomtex {
namespace {

constexpr int kThumbSize = 384;  // pixels of the longer side
constexpr float kFaint = 0.03f;  // step of log light per pixel that counts half
constexpr int kPeakRadius = 3;   // pixels around the peak that belong to it

// Correlation of the edge directions: at (y, x) the sum of the dot products when `second` is moved
// back by the shift (x, y), taken modulo the size.
cv::Mat1f Correlate(const EdgeThumb& first, const EdgeThumb& second, int margin) {
  const cv::Size size(cv::getOptimalDFTSize(first.cols + margin),
                      cv::getOptimalDFTSize(first.rows + margin));
  cv::Mat a, b, product, correlation;
  cv::copyMakeBorder(first, a, 0, size.height - first.rows, 0, size.width - first.cols,
                     cv::BORDER_CONSTANT, cv::Scalar::all(0));
  cv::copyMakeBorder(second, b, 0, size.height - second.rows, 0, size.width - second.cols,
                     cv::BORDER_CONSTANT, cv::Scalar::all(0));
  cv::dft(a, a);
  cv::dft(b, b);
  cv::mulSpectrums(b, a, product, 0, true);
  cv::dft(product, correlation, cv::DFT_INVERSE | cv::DFT_SCALE);
  cv::Mat1f real;
  cv::extractChannel(correlation, real, 0);
  return real;
}

double Energy(const EdgeThumb& thumb) {
  const double norm = cv::norm(thumb);
  return norm * norm;
}

// Place of the largest value of a parabola through three, -0.5 .. 0.5.
double Peak(double before, double at, double after) {
  const double bend = before - 2 * at + after;
  return bend < 0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0;
}

}  // namespace

EdgeThumb MakeEdgeThumb(const cv::Mat1b& grey) {
  const double scale =
      std::min(1.0, static_cast<double>(kThumbSize) / std::max(grey.cols, grey.rows));
  cv::Mat small, light, dx, dy;
  cv::resize(grey, small, {}, scale, scale, cv::INTER_AREA);
  light = LogLight(small);
  cv::GaussianBlur(light, light, {}, 1);
  cv::Sobel(light, dx, CV_32F, 1, 0, 1, 0.5, 0, cv::BORDER_REPLICATE);
  cv::Sobel(light, dy, CV_32F, 0, 1, 1, 0.5, 0, cv::BORDER_REPLICATE);
  EdgeThumb thumb(light.size());
  for (int row = 0; row < light.rows; ++row) {
    for (int column = 0; column < light.cols; ++column) {
      const float x = dx.at<float>(row, column), y = dy.at<float>(row, column);
      const float length2 = x * x + y * y;
      const float weight = std::sqrt(length2) / (length2 + kFaint * kFaint);
      thumb(row, column) = {x * weight, y * weight};
    }
  }
  return thumb;
}

CoarseShift FindCoarseShift(const EdgeThumb& first, const EdgeThumb& second, int max_shift) {
  CoarseShift result;
  const cv::Mat1f map = Correlate(first, second, max_shift + 1);
  const auto at = [&](int x, int y) {
    return static_cast<double>(map((y + map.rows) % map.rows, (x + map.cols) % map.cols));
  };
  int best_x = 0, best_y = 0;
  for (int y = -max_shift; y <= max_shift; ++y) {
    for (int x = -max_shift; x <= max_shift; ++x) {
      if (at(x, y) > at(best_x, best_y)) best_x = x, best_y = y;
    }
  }
  double count = 0, sum = 0, squares = 0;
  for (int y = -max_shift; y <= max_shift; ++y) {
    for (int x = -max_shift; x <= max_shift; ++x) {
      if (std::max(std::abs(x - best_x), std::abs(y - best_y)) <= kPeakRadius) continue;
      count += 1, sum += at(x, y), squares += at(x, y) * at(x, y);
    }
  }
  const double peak = at(best_x, best_y), mean = sum / count;
  const double deviation = std::sqrt(std::max(squares / count - mean * mean, 1e-12));
  result.significance = (peak - mean) / deviation;
  result.agreement = peak / std::max(std::min(Energy(first), Energy(second)), 1e-9);
  result.shift = {best_x + Peak(at(best_x - 1, best_y), peak, at(best_x + 1, best_y)),
                  best_y + Peak(at(best_x, best_y - 1), peak, at(best_x, best_y + 1))};
  return result;
}

}  // namespace roomtex
