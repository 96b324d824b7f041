#include "align/trust/photo_detail.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr float kNotSeen = std::numeric_limits<float>::quiet_NaN();
// Cells along a window's side, between the middles of windows, and of a window that must be seen.
constexpr int kWindow = 9, kStep = 5, kMinSeen = 60;
// Standard deviation over a window of the logarithm of what others show, at least.
constexpr double kLeastDetail = 0.16;
constexpr double kAlike = 0.5;  // correlation
constexpr size_t kMinOthers = 2;
// Photos of another room with the same walls agree in 0.62 to 0.78 of 700 to 1160 windows (six, of
// three rooms); right ones in 0.88 to 1 (a room with 14 photos from everywhere, two stations; three
// with 16), and right ones that find 5 and 7 % of what others found in 0.93 and 0.99.
constexpr double kLeastShare = 0.9;
constexpr int kMinWindows = 150;

// A photo in cells.
struct Looked {
  const SparseImage* image = nullptr;
  const LookSetup* camera = nullptr;
  cv::Mat1f light;  // LogLight(), kNotSeen where no smooth surface is seen; empty = not read
  cv::Mat1f depth;  // of its view
};

Looked Look(const PerspectiveViews& views, const ScanViewer& viewer, const SparseImage& image,
            const LookSetup& camera) {
  Looked looked{&image, &camera, {}, {}};
  std::string ignored;  // MeasureAgreement() says it
  auto look = views.Look(viewer, image, camera, &ignored);
  if (!look) return looked;
  looked.depth = look->view.depth;
  looked.light = cv::Mat1f(looked.depth.size(), kNotSeen);
  for (int y = 0; y < looked.light.rows; ++y) {
    for (int x = 0; x < looked.light.cols; ++x) {
      if (look->view.valid(y, x)) looked.light(y, x) = LogLight(look->cells.at<cv::Vec3b>(y, x));
    }
  }
  return looked;
}

// What `other` shows at the cells of `photo`.
cv::Mat1f SeenBy(const Looked& other, const Looked& photo) {
  cv::Mat1f seen(photo.light.size(), kNotSeen);
  const Rigid scan_from_cam = photo.image->cam_from_model.Inverse();
  const int cell_px = photo.camera->cell_px;
  for (int y = 0; y < photo.light.rows; ++y) {
    for (int x = 0; x < photo.light.cols; ++x) {
      if (std::isnan(photo.light(y, x))) continue;
      const Eigen::Vector2d ray = photo.camera->lattice.RayAt(
          cell_px * Eigen::Vector2d(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5));
      const double depth = photo.depth(y, x);
      const Eigen::Vector3d x_in_cam =
          other.image->cam_from_model * (scan_from_cam * (depth * ray.homogeneous()));
      if (!(x_in_cam.z() > 0)) continue;
      const auto x_in_img = other.camera->projection.ImgFromCam(x_in_cam);
      if (!x_in_img) continue;
      const double column = x_in_img->x() / other.camera->cell_px - 0.5,
                   row = x_in_img->y() / other.camera->cell_px - 0.5;
      if (!(column >= 0 && column < other.light.cols - 1 && row >= 0 &&
            row < other.light.rows - 1)) {
        continue;
      }
      const int i = static_cast<int>(column), j = static_cast<int>(row);
      if (!IsAsDeep(other.depth(j, i), x_in_cam.z())) continue;
      const float u = static_cast<float>(column - i), v = static_cast<float>(row - j);
      seen(y, x) = (1 - v) * ((1 - u) * other.light(j, i) + u * other.light(j, i + 1)) +
                   v * ((1 - u) * other.light(j + 1, i) + u * other.light(j + 1, i + 1));
    }
  }
  return seen;
}

// Makes it as bright as the photo, in the median of what both show.
void MakeAsBright(const Looked& photo, cv::Mat1f* seen) {
  std::vector<float> above;
  for (int y = 0; y < seen->rows; ++y) {
    for (int x = 0; x < seen->cols; ++x) {
      if (!std::isnan((*seen)(y, x))) above.push_back((*seen)(y, x) - photo.light(y, x));
    }
  }
  if (!above.empty()) *seen -= cv::Scalar(Median(&above));
}

// The median over the others, where enough of them see it.
cv::Mat1f MedianOf(const std::vector<cv::Mat1f>& seen, const cv::Size& size) {
  cv::Mat1f median(size, kNotSeen);
  std::vector<float> values;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      values.clear();
      for (const cv::Mat1f& one : seen) {
        if (!std::isnan(one(y, x))) values.push_back(one(y, x));
      }
      if (values.size() >= kMinOthers) median(y, x) = Median(&values);
    }
  }
  return median;
}

DetailAgreement CompareWindows(const cv::Mat1f& own, const cv::Mat1f& others) {
  DetailAgreement agreement;
  for (int top = 0; top + kWindow <= own.rows; top += kStep) {
    for (int left = 0; left + kWindow <= own.cols; left += kStep) {
      double n = 0, p = 0, o = 0, pp = 0, oo = 0, po = 0;
      for (int y = top; y < top + kWindow; ++y) {
        for (int x = left; x < left + kWindow; ++x) {
          const double a = own(y, x), b = others(y, x);
          if (std::isnan(a) || std::isnan(b)) continue;
          ++n, p += a, o += b, pp += a * a, oo += b * b, po += a * b;
        }
      }
      if (n < kMinSeen) continue;
      const double var_p = pp / n - p * p / (n * n), var_o = oo / n - o * o / (n * n);
      if (!(var_o > kLeastDetail * kLeastDetail)) continue;
      ++agreement.num_windows;
      const double covariance = po / n - p * o / (n * n);
      agreement.num_alike += var_p > 0 && covariance > kAlike * std::sqrt(var_p * var_o);
    }
  }
  return agreement;
}

}  // namespace

double DetailAgreement::Share() const {
  return num_windows > 0 ? static_cast<double>(num_alike) / num_windows
                         : std::numeric_limits<double>::quiet_NaN();
}

bool DetailAgreement::Agrees() const {
  return num_windows >= kMinWindows && Share() >= kLeastShare;
}

std::map<uint32_t, DetailAgreement> CompareDetail(
    const AlignedPhotos& aligned, const ScanViewer& viewer, const std::set<uint32_t>& asked,
    const std::set<uint32_t>& not_believed, const PhotoDetailOptions& options, int num_threads) {
  const PerspectiveViews views(aligned);
  std::map<uint32_t, const SparseImage*> images;
  for (const SparseImage* image : SpreadImages(views.model(), options.num_others)) {
    if (not_believed.count(image->image_id) == 0) images[image->image_id] = image;
  }
  for (const uint32_t id : asked) {
    const auto image = views.model().images.find(id);
    if (image != views.model().images.end()) images[id] = &image->second;
  }
  std::map<uint32_t, LookSetup> cameras;
  std::vector<const SparseImage*> all;
  for (const auto& [id, image] : images) {
    const Camera& camera = views.model().cameras.at(image->camera_id);
    cameras.try_emplace(image->camera_id, camera, viewer,
                        std::max(1, std::max(camera.width, camera.height) / options.pixels_across));
    all.push_back(image);
  }
  std::vector<Looked> looked(all.size());
  ParallelFor(num_threads, 0, static_cast<int>(all.size()), [&](int k) {
    looked[k] = Look(views, viewer, *all[k], cameras.at(all[k]->camera_id));
  });

  std::map<uint32_t, DetailAgreement> agreements;
  for (const Looked& photo : looked) {
    if (asked.count(photo.image->image_id) == 0 || photo.light.empty()) continue;
    std::vector<cv::Mat1f> seen(looked.size());
    ParallelFor(num_threads, 0, static_cast<int>(looked.size()), [&](int k) {
      const Looked& other = looked[k];
      if (other.light.empty() || other.image == photo.image ||
          not_believed.count(other.image->image_id) > 0) {
        return;
      }
      seen[k] = SeenBy(other, photo);
      MakeAsBright(photo, &seen[k]);
    });
    seen.erase(
        std::remove_if(seen.begin(), seen.end(), [](const cv::Mat1f& one) { return one.empty(); }),
        seen.end());
    agreements[photo.image->image_id] =
        CompareWindows(photo.light, MedianOf(seen, photo.light.size()));
  }
  return agreements;
}

}  // namespace roomtex
