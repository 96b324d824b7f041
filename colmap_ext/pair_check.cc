#include "colmap_ext/pair_check.h"

#include <algorithm>
#include <cmath>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace roomtex {
namespace {

// Descriptors as 16-bit numbers, whose products processors add up eight at a time.
std::vector<int16_t> Widened(const std::vector<uint8_t>& bytes) {
  return {bytes.begin(), bytes.end()};
}

int ScalarProduct(const int16_t* a, const int16_t* b) {
  int sum = 0;
  for (int i = 0; i < kSiftSize; ++i) sum += static_cast<int>(a[i]) * static_cast<int>(b[i]);
  return sum;
}

float LengthOf(const int16_t* descriptor) {
  return std::sqrt(static_cast<float>(ScalarProduct(descriptor, descriptor)));
}

struct Nearest {
  int row = -1;
  float cosine = -1, next = -1;
};

// The nearest and next nearest right descriptor of every left one, and the nearest left one of
// every right one.
void FindNearest(const std::vector<int16_t>& left, const std::vector<int16_t>& right,
                 std::vector<Nearest>* of_left, std::vector<Nearest>* of_right) {
  std::vector<float> right_scales(of_right->size());
  for (size_t j = 0; j < right_scales.size(); ++j) {
    right_scales[j] = 1 / std::max(1.0f, LengthOf(&right[j * kSiftSize]));
  }
  for (size_t i = 0; i < of_left->size(); ++i) {
    const int16_t* descriptor = &left[i * kSiftSize];
    const float left_scale = 1 / std::max(1.0f, LengthOf(descriptor));
    Nearest& nearest = (*of_left)[i];
    for (size_t j = 0; j < of_right->size(); ++j) {
      const float cosine = static_cast<float>(ScalarProduct(descriptor, &right[j * kSiftSize])) *
                           left_scale * right_scales[j];
      if (cosine > nearest.cosine) {
        nearest.next = nearest.cosine;
        nearest.cosine = cosine;
        nearest.row = static_cast<int>(j);
      } else if (cosine > nearest.next) {
        nearest.next = cosine;
      }
      if (cosine > (*of_right)[j].cosine) {
        (*of_right)[j].cosine = cosine;
        (*of_right)[j].row = static_cast<int>(i);
      }
    }
  }
}

int NumInHull(const std::vector<cv::Point2f>& corners, const std::vector<Eigen::Vector2f>& x) {
  std::vector<cv::Point2f> hull;
  cv::convexHull(corners, hull);
  return static_cast<int>(std::count_if(x.begin(), x.end(), [&](const Eigen::Vector2f& point) {
    return cv::pointPolygonTest(hull, {point.x(), point.y()}, false) >= 0;
  }));
}

float AngleOf(float cosine) { return std::acos(std::clamp(cosine, -1.0f, 1.0f)); }

}  // namespace

ComparedFeatures UndistortFeatures(const DatabaseFeatures& features, const Camera& camera) {
  const CameraProjection projection(camera);
  const double focal_length = camera.MeanFocalLength();
  ComparedFeatures compared;
  for (size_t i = 0; i < features.x_in_img.size(); ++i) {
    const auto x = projection.CamFromImg(features.x_in_img[i]);
    if (!x) continue;
    compared.x.emplace_back((focal_length * *x).cast<float>());
    const auto first = features.descriptors.begin() + static_cast<std::ptrdiff_t>(i * kSiftSize);
    compared.descriptors.insert(compared.descriptors.end(), first, first + kSiftSize);
  }
  return compared;
}

PairCheck CheckPair(const ComparedFeatures& left, const ComparedFeatures& right,
                    const PairCheckOptions& options) {
  std::vector<Nearest> of_left(left.x.size()), of_right(right.x.size());
  FindNearest(Widened(left.descriptors), Widened(right.descriptors), &of_left, &of_right);
  std::vector<cv::Point2f> x_left, x_right;
  for (size_t i = 0; i < of_left.size(); ++i) {
    const Nearest& nearest = of_left[i];
    if (nearest.row < 0 || of_right[static_cast<size_t>(nearest.row)].row != static_cast<int>(i)) {
      continue;
    }
    if (AngleOf(nearest.cosine) > options.max_ratio * AngleOf(nearest.next)) continue;
    const Eigen::Vector2f& to = right.x[static_cast<size_t>(nearest.row)];
    x_left.emplace_back(left.x[i].x(), left.x[i].y());
    x_right.emplace_back(to.x(), to.y());
  }
  PairCheck check;
  check.num_matches = static_cast<int>(x_left.size());
  if (check.num_matches < std::max(8, options.min_num_matches)) return check;
  constexpr double kConfidence = 0.999;
  constexpr int kMaxSamples = 2000;
  std::vector<uint8_t> is_inlier;
  const cv::Mat fundamental = cv::findFundamentalMat(
      x_left, x_right, cv::USAC_DEFAULT, options.max_error_px, kConfidence, kMaxSamples, is_inlier);
  if (fundamental.empty()) return check;
  std::vector<cv::Point2f> left_inliers, right_inliers;
  for (size_t i = 0; i < is_inlier.size(); ++i) {
    if (is_inlier[i] == 0) continue;
    left_inliers.push_back(x_left[i]);
    right_inliers.push_back(x_right[i]);
  }
  check.num_inliers = static_cast<int>(left_inliers.size());
  if (left_inliers.empty()) return check;
  check.num_in_hull = std::min(NumInHull(left_inliers, left.x), NumInHull(right_inliers, right.x));
  return check;
}

}  // namespace roomtex
