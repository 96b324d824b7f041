#include "core/undistortion.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "core/camera_formulas.h"
#include "core/frames.h"

namespace roomtex {
namespace {

constexpr float kOutside = -1e6f;      // of every picture
constexpr int kStripeRows = 128;       // the map of a whole photo of 20 MP would take 160 MB
constexpr double kAverageBelow = 0.8;  // of the photo's size: coarser pictures are averaged first
constexpr double kMaxEnlargement = 2;  // of the longest side, as COLMAP's undistorter
constexpr int kSmallest = 16;          // pixels

bool IsPinhole(const Camera& camera) {
  return camera.model == CameraModel::kPinhole || camera.model == CameraModel::kSimplePinhole;
}

// For each row of `pinhole` where its pixels lie in the photo, positions of OpenCV.
cv::Mat MapOfStripe(const CameraProjection& from, const CameraProjection& pinhole, int first_row,
                    int num_rows) {
  cv::Mat map(num_rows, pinhole.camera().width, CV_32FC2);
  for (int y = 0; y < num_rows; ++y) {
    auto* row = map.ptr<cv::Vec2f>(y);
    for (int x = 0; x < map.cols; ++x) {
      const auto ray = pinhole.RayFromImg(ImgFromOpenCv(Eigen::Vector2d(x, first_row + y)));
      const auto at = ray ? from.ImgFromCam(*ray) : std::nullopt;
      row[x] = {kOutside, kOutside};
      if (!at || !from.InImage(*at)) continue;
      const Eigen::Vector2d position = OpenCvFromImg(*at);
      row[x] = {static_cast<float>(position.x()), static_cast<float>(position.y())};
    }
  }
  return map;
}

}  // namespace

std::optional<Camera> PinholeCamera(const Camera& camera, const PinholeOptions& options) {
  if (camera.IsPanorama()) return std::nullopt;
  Camera pinhole = camera;
  pinhole.model = CameraModel::kPinhole;
  const std::vector<double>& p = camera.params;
  const bool one_focal_length = camera_formulas::HasOneFocalLength(camera.model);
  pinhole.params = one_focal_length ? std::vector<double>{p[0], p[0], p[1], p[2]}
                                    : std::vector<double>(p.begin(), p.begin() + 4);
  if (!IsPinhole(camera)) {
    const CameraProjection projection(camera);
    const double limit = std::tan(RadFromDeg(options.max_field_deg) / 2);
    double left = -limit, right = limit, top = -limit, bottom = limit;  // x/z, y/z
    constexpr int kSteps = 256;
    const auto at = [&](double x, double y) { return projection.CamFromImg({x, y}); };
    for (int i = 0; i <= kSteps; ++i) {
      const double x = camera.width * static_cast<double>(i) / kSteps;
      const double y = camera.height * static_cast<double>(i) / kSteps;
      if (const auto ray = at(0, y)) left = std::max(left, ray->x());
      if (const auto ray = at(camera.width, y)) right = std::min(right, ray->x());
      if (const auto ray = at(x, 0)) top = std::max(top, ray->y());
      if (const auto ray = at(x, camera.height)) bottom = std::min(bottom, ray->y());
    }
    const double fx = pinhole.params[0], fy = pinhole.params[1];
    const double width = std::floor((right - left) * fx + 1e-6);
    const double height = std::floor((bottom - top) * fy + 1e-6);
    if (!(width >= kSmallest && height >= kSmallest && std::max(width, height) < 1e9)) {
      return std::nullopt;
    }
    pinhole.params = {fx, fy, -left * fx, -top * fy};
    pinhole.width = static_cast<int>(width);
    pinhole.height = static_cast<int>(height);
  }
  const double longest = std::max(pinhole.width, pinhole.height);
  double scale = std::min(1.0, kMaxEnlargement * std::max(camera.width, camera.height) / longest);
  if (options.max_image_size > 0) scale = std::min(scale, options.max_image_size / longest);
  if (scale < 1) {
    pinhole.Resize(std::max(1, static_cast<int>(std::lround(pinhole.width * scale))),
                   std::max(1, static_cast<int>(std::lround(pinhole.height * scale))));
  }
  return pinhole;
}

UndistortedPhoto UndistortPhoto(const cv::Mat& photo, const Camera& camera, const Camera& pinhole) {
  if (IsPinhole(camera) && camera.width == pinhole.width && camera.height == pinhole.height) {
    return {photo, cv::Mat1b(photo.size(), uint8_t{255})};
  }
  Camera from = camera;
  cv::Mat picture = photo;
  const double scale = pinhole.params[0] / camera.params[0];
  if (scale < kAverageBelow) {
    from.Resize(std::max(1, static_cast<int>(std::lround(camera.width * scale))),
                std::max(1, static_cast<int>(std::lround(camera.height * scale))));
    cv::resize(photo, picture, {from.width, from.height}, 0, 0, cv::INTER_AREA);
  }
  const CameraProjection projection(from), target(pinhole);
  UndistortedPhoto result{cv::Mat(pinhole.height, pinhole.width, photo.type()),
                          cv::Mat1b(pinhole.height, pinhole.width)};
  for (int row = 0; row < pinhole.height; row += kStripeRows) {
    const cv::Range rows(row, std::min(row + kStripeRows, pinhole.height));
    const cv::Mat map = MapOfStripe(projection, target, rows.start, rows.size());
    cv::Mat stripe = result.picture.rowRange(rows);
    cv::remap(picture, stripe, map, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
    for (int y = 0; y < rows.size(); ++y) {
      for (int x = 0; x < pinhole.width; ++x) {
        result.shown(rows.start + y, x) = map.at<cv::Vec2f>(y, x)[0] > kOutside ? 255 : 0;
      }
    }
  }
  result.picture.setTo(cv::Scalar::all(0), result.shown == 0);
  return result;
}

}  // namespace roomtex
