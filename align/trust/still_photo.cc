#include "align/trust/still_photo.h"

#include <vector>

#include <opencv2/imgproc.hpp>

#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr double kUsualDepth = 3;  // metres, where the scan shows nothing at all

double MedianDepth(const ScanView& view) {
  std::vector<float> depths;
  for (int y = 0; y < view.depth.rows; ++y) {
    for (int x = 0; x < view.depth.cols; ++x) {
      if (view.valid(y, x)) depths.push_back(view.depth(y, x));
    }
  }
  return depths.empty() ? kUsualDepth : Median(&depths);
}

}  // namespace

cv::Mat WithStillRows(const cv::Mat& photo, const ScanView& view, const LookSetup& camera,
                      const RowMotion& motion) {
  const double usual_depth = MedianDepth(view);
  cv::Mat2f shifts(view.depth.size());  // pixels of the camera
  for (int y = 0; y < shifts.rows; ++y) {
    for (int x = 0; x < shifts.cols; ++x) {
      const Eigen::Vector2d still = view.cell_px * Eigen::Vector2d(x + 0.5, y + 0.5);
      const double depth = view.valid(y, x) ? view.depth(y, x) : usual_depth;
      const auto shown = ImgFromMovingCam(camera.projection, motion,
                                          depth * camera.lattice.RayAt(still).homogeneous());
      const Eigen::Vector2d shift = shown.value_or(still) - still;
      shifts(y, x) = {static_cast<float>(shift.x()), static_cast<float>(shift.y())};
    }
  }
  // The view has whole cells only: what lies beyond is shifted like the last ones.
  const Camera& whole = camera.projection.camera();
  const double px_x = static_cast<double>(whole.width) / photo.cols;
  const double px_y = static_cast<double>(whole.height) / photo.rows;
  cv::Mat2f places(photo.size());
  for (int y = 0; y < photo.rows; ++y) {
    for (int x = 0; x < photo.cols; ++x) {
      places(y, x) = {static_cast<float>((x + 0.5) * px_x / view.cell_px - 0.5),
                      static_cast<float>((y + 0.5) * px_y / view.cell_px - 0.5)};
    }
  }
  cv::Mat2f moved;
  cv::remap(shifts, moved, places, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  for (int y = 0; y < photo.rows; ++y) {
    for (int x = 0; x < photo.cols; ++x) {
      places(y, x) = {static_cast<float>(x + moved(y, x)[0] / px_x),
                      static_cast<float>(y + moved(y, x)[1] / px_y)};
    }
  }
  cv::Mat result;
  cv::remap(photo, result, places, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return result;
}

}  // namespace roomtex
