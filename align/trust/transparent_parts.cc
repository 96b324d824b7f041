#include "align/trust/transparent_parts.h"

#include <algorithm>
#include <limits>

#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/photo.h"
#include "core/photo_fit.h"

namespace roomtex {

cv::Mat1b ReadTransparencyOf(const SparseImage& image, const Camera& camera,
                             const std::string& image_path) {
  const std::string path = image_path + "/" + image.name;
  const PhotoFit fit = FitPhotoToCamera(path, image.name, camera.width, camera.height);
  if (!fit.usable()) return {};
  cv::Mat1b transparent;
  try {
    transparent = ReadTransparency(path, fit.pixels);
  } catch (const InputError&) {
    return {};
  }
  const cv::Size size(camera.width, camera.height);
  if (transparent.empty() || transparent.size() == size) return transparent;
  // Not opaque as soon as a part of the pixel is not.
  cv::resize(transparent, transparent, size, 0, 0,
             size.width < transparent.cols ? cv::INTER_AREA : cv::INTER_LINEAR);
  return transparent > 0;
}

void LeaveOutTransparent(const cv::Mat1b& transparent, ScanView* view) {
  constexpr int kReach = 8;  // pixels
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  if (transparent.empty() || view->valid.empty()) return;
  cv::Mat1b around;
  cv::dilate(transparent, around, cv::Mat::ones(2 * kReach + 1, 2 * kReach + 1, CV_8U));
  const cv::Size size = view->valid.size();
  const cv::Rect whole(0, 0, size.width * view->cell_px, size.height * view->cell_px);
  cv::Mat1f covered;
  around(whole).convertTo(covered, CV_32F);
  cv::resize(covered, covered, size, 0, 0, cv::INTER_AREA);
  view->unseen = covered > 0;
  view->grey.setTo(0, view->unseen);
  view->valid.setTo(0, view->unseen);
  view->depth.setTo(0, view->unseen);
  view->column.setTo(kNaN, view->unseen);
  view->row.setTo(kNaN, view->unseen);
  view->valid_share =
      static_cast<double>(cv::countNonZero(view->valid)) / std::max(1, size.width * size.height);
}

}  // namespace roomtex
