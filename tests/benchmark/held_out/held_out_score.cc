#include "tests/benchmark/held_out/held_out_score.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <opencv2/imgproc.hpp>

#include "core/parallel.h"
#include "core/photo.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"
#include "core/twist.h"

namespace roomtex {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

cv::Mat1f Grey(const cv::Mat& picture, double sigma) {
  cv::Mat1b bytes;
  cv::cvtColor(picture, bytes, cv::COLOR_BGR2GRAY);
  cv::Mat1f grey = bytes;
  if (sigma > 0) cv::GaussianBlur(grey, grey, {}, sigma);
  return grey;
}

// Linear between the four pixels around a position in `img`; false outside.
bool LookUp(const cv::Mat1f& image, const Eigen::Vector2d& x_in_img, double* value,
            Eigen::Vector2d* gradient) {
  const double x = x_in_img.x() - 0.5, y = x_in_img.y() - 0.5;
  const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
  if (column < 0 || row < 0 || column + 1 >= image.cols || row + 1 >= image.rows) return false;
  const double s = x - column, t = y - row;
  const double a = image(row, column), b = image(row, column + 1), c = image(row + 1, column),
               d = image(row + 1, column + 1);
  *value = (1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * c + s * d);
  *gradient = {(1 - t) * (b - a) + t * (d - c), (1 - s) * (c - a) + s * (d - b)};
  return true;
}

// One step of a pose towards a photo.
class PoseStep {
 public:
  PoseStep(const CameraProjection& camera, const cv::Mat1f& photo)
      : camera_(camera), photo_(photo) {}

  void Add(const Rigid& cam_from_scan, const Eigen::Vector3d& x_in_scan, double predicted) {
    const Eigen::Vector3d x_in_cam = cam_from_scan * x_in_scan;
    const auto position = camera_.ImgFromCam(x_in_cam);
    double value = 0;
    Eigen::Vector2d gradient;
    if (!position || !LookUp(photo_, *position, &value, &gradient)) return;
    // The lens bends little from pixel to pixel: its share of the Jacobian is left out.
    const double f = camera_.camera().MeanFocalLength(), z = x_in_cam.z();
    Eigen::Matrix<double, 2, 3> by_point;
    by_point << f / z, 0, -f * x_in_cam.x() / (z * z), 0, f / z, -f * x_in_cam.y() / (z * z);
    Eigen::Matrix<double, 3, 6> point_by_step;
    point_by_step << -CrossMatrix(cam_from_scan.rotation * x_in_scan), Eigen::Matrix3d::Identity();
    const Vector6d jacobian = (gradient.transpose() * by_point * point_by_step).transpose();
    constexpr double kScale = 12;  // grey levels
    const double residual = predicted - value;
    const double weight = GemanMcClureWeight(residual * residual / (kScale * kScale));
    normal_ += weight * jacobian * jacobian.transpose();
    right_ += weight * residual * jacobian;
    const double square = residual * residual / (kScale * kScale);
    cost_ += square / (1 + square);
    ++count_;
  }

  double Cost() const { return count_ > 0 ? cost_ / count_ : 1; }
  Vector6d Solve() const {
    Matrix6d damped = normal_;
    damped.diagonal() *= 1.001;
    return damped.ldlt().solve(right_);
  }

 private:
  const CameraProjection& camera_;
  const cv::Mat1f& photo_;
  Matrix6d normal_ = Matrix6d::Zero();
  Vector6d right_ = Vector6d::Zero();
  double cost_ = 0;
  int count_ = 0;
};

// Gains that bring the prediction's light to the photo's: ratio of the medians per channel, of
// pixels that are neither dark nor clipped.
cv::Vec3f ChannelGains(const Prediction& prediction, const cv::Mat3b& photo) {
  const auto& linear = LinearFromSrgbByte();
  cv::Vec3f gains(1, 1, 1);
  for (int k = 0; k < 3; ++k) {
    std::vector<float> ratios;
    for (int i = 0; i < static_cast<int>(photo.total()); ++i) {
      const int row = i / photo.cols, column = i % photo.cols;
      const uint8_t have = prediction.picture(row, column)[k], want = photo(row, column)[k];
      if (prediction.seen(row, column) == 0 || have < 20 || want < 20 || want > 245) continue;
      ratios.push_back(linear[want] / linear[have]);
    }
    gains[k] = Median(&ratios, 1.0f);
  }
  return gains;
}

cv::Mat3b WithGains(const cv::Mat3b& picture, const cv::Vec3f& gains) {
  cv::Mat table(1, 256, CV_8UC3);
  for (int level = 0; level < 256; ++level) {
    for (int k = 0; k < 3; ++k) {
      table.at<cv::Vec3b>(0, level)[k] = SrgbByteFromLinear(gains[k] * LinearFromSrgbByte()[level]);
    }
  }
  cv::Mat result;
  cv::LUT(picture, table, result);
  return result;
}

double GradientEnergy(const cv::Mat1f& grey, const cv::Mat1b& mask) {
  cv::Mat1f dx, dy;
  cv::Sobel(grey, dx, CV_32F, 1, 0);
  cv::Sobel(grey, dy, CV_32F, 0, 1);
  return cv::mean(dx.mul(dx) + dy.mul(dy), mask)[0];
}

double Correlation(const cv::Mat1f& a, const cv::Mat1f& b, const cv::Mat1b& mask) {
  const double mean_a = cv::mean(a, mask)[0], mean_b = cv::mean(b, mask)[0];
  const double ab = cv::mean((a - mean_a).mul(b - mean_b), mask)[0];
  const double aa = cv::mean((a - mean_a).mul(a - mean_a), mask)[0];
  const double bb = cv::mean((b - mean_b).mul(b - mean_b), mask)[0];
  return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0;
}

}  // namespace

Prediction PhotoPredictor::Predict(const Camera& camera, const Rigid& cam_from_scan) const {
  // A pixel is seen if all of its rays meet the scan, whatever colour stands for none: rendered
  // before two of them, such a pixel is the same.
  RenderSettings settings;
  settings.num_threads = num_threads_;
  settings.empty = {0, 0, 0};
  Prediction result;
  result.picture = renderer_.Render(camera, cam_from_scan, settings);
  settings.empty = {255, 255, 255};
  const cv::Mat3b other = renderer_.Render(camera, cam_from_scan, settings);
  result.seen = cv::Mat1b(other.size(), uint8_t{0});
  for (int row = 0; row < other.rows; ++row) {
    for (int column = 0; column < other.cols; ++column) {
      if (result.picture(row, column) == other(row, column)) result.seen(row, column) = 255;
    }
  }
  return result;
}

cv::Mat3d PhotoPredictor::PointsSeen(const Camera& camera, const Rigid& cam_from_scan) const {
  const CameraProjection projection(camera);
  const Rigid scan_from_cam = cam_from_scan.Inverse();
  cv::Mat3d points(camera.height, camera.width, cv::Vec3d(NAN, NAN, NAN));
  ParallelFor(num_threads_, 0, points.rows, [&](int y) {
    for (int x = 0; x < points.cols; ++x) {
      const auto ray = projection.RayFromImg({x + 0.5, y + 0.5});
      if (!ray) continue;
      const auto hit = caster_.Cast(scan_from_cam.translation,
                                    (scan_from_cam.rotation * *ray).normalized(), 0.01);
      if (hit) points(y, x) = {hit->point.x(), hit->point.y(), hit->point.z()};
    }
  });
  return points;
}

Rigid PhotoPredictor::RefinePose(const Camera& camera, const Rigid& cam_from_scan,
                                 const cv::Mat& photo) const {
  const Prediction prediction = Predict(camera, cam_from_scan);
  const cv::Mat picture = WithPhotoGains(prediction, photo);
  const cv::Mat3d points = PointsSeen(camera, cam_from_scan);
  cv::Mat1b inner;
  cv::erode(prediction.seen, inner, cv::Mat(), {-1, -1}, 3);
  const CameraProjection projection(camera);
  Rigid pose = cam_from_scan;
  double first_cost = -1, last_cost = -1;
  for (const double sigma : {8.0, 4.0, 2.0, 1.0}) {
    const double size = sigma * camera.width / 640.0;
    const cv::Mat1f wanted = Grey(photo, size), have = Grey(picture, size);
    const int stride = std::max(1, static_cast<int>(size));
    constexpr int kRounds = 8;
    for (int round = 0; round <= kRounds; ++round) {
      PoseStep step(projection, wanted);
      for (int y = 0; y < have.rows; y += stride) {
        for (int x = 0; x < have.cols; x += stride) {
          const cv::Vec3d& p = points(y, x);
          if (inner(y, x) == 0 || std::isnan(p[0])) continue;
          step.Add(pose, {p[0], p[1], p[2]}, have(y, x));
        }
      }
      if (sigma == 1.0 && round == kRounds) last_cost = step.Cost();
      if (round < kRounds) pose = Moved(pose, step.Solve());
    }
    if (sigma > 1) continue;
    PoseStep before(projection, wanted);
    for (int y = 0; y < have.rows; y += stride) {
      for (int x = 0; x < have.cols; x += stride) {
        const cv::Vec3d& p = points(y, x);
        if (inner(y, x) != 0 && !std::isnan(p[0])) {
          before.Add(cam_from_scan, {p[0], p[1], p[2]}, have(y, x));
        }
      }
    }
    first_cost = before.Cost();
  }
  return last_cost < first_cost ? pose : cam_from_scan;
}

cv::Mat3b WithPhotoGains(const Prediction& prediction, const cv::Mat& photo) {
  return WithGains(prediction.picture, ChannelGains(prediction, photo));
}

HeldOutScore ScorePrediction(const Prediction& prediction, const cv::Mat& photo) {
  HeldOutScore score;
  cv::Mat1b mask;
  cv::erode(prediction.seen, mask, cv::Mat(), {-1, -1}, 3, cv::BORDER_CONSTANT, 0);
  const int count = cv::countNonZero(mask);
  score.share_seen = static_cast<double>(count) / static_cast<double>(mask.total());
  if (count == 0) return score;
  const cv::Mat picture = WithPhotoGains(prediction, photo);
  cv::Mat3f difference = cv::Mat3f(picture) - cv::Mat3f(cv::Mat3b(photo));
  const cv::Scalar squares = cv::mean(difference.mul(difference), mask);
  const double mean_square = std::max((squares[0] + squares[1] + squares[2]) / 3, 1e-6);
  score.psnr = 10 * std::log10(255.0 * 255.0 / mean_square);
  const cv::Mat1f have = Grey(picture, 0), want = Grey(photo, 0);
  score.gradient_energy = GradientEnergy(have, mask) / std::max(GradientEnergy(want, mask), 1e-9);
  score.detail_correlation = Correlation(have - Grey(picture, 2), want - Grey(photo, 2), mask);
  return score;
}

}  // namespace roomtex
