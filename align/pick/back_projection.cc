#include "align/pick/back_projection.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "align/pick/reduced_photo.h"
#include "core/frames.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr double kPixelsPerSample = 1.5;  // of the photo as it is decoded
constexpr size_t kMaxPictures = 4;        // kept; 16 MB each for 3 M samples
constexpr int kPngCompression = 1;        // fast
constexpr int kBorderSteps = 16;          // places along each side of a photo that bound its field

// Largest radius x/z, y/z of any ray of the photo; infinite if the lens says nothing at a border.
double FieldRadius(const CameraProjection& projection) {
  const Camera& camera = projection.camera();
  double radius = 0;
  for (int k = 0; k <= kBorderSteps; ++k) {
    const double u = 1.0 * k / kBorderSteps;
    for (const Eigen::Vector2d& at : {Eigen::Vector2d(u, 0), Eigen::Vector2d(u, 1),
                                      Eigen::Vector2d(0, u), Eigen::Vector2d(1, u)}) {
      const auto ray = projection.CamFromImg({at.x() * camera.width, at.y() * camera.height});
      if (!ray) return std::numeric_limits<double>::infinity();
      radius = std::max(radius, ray->norm());
    }
  }
  return 1.02 * radius;
}

cv::Vec4b ColorAt(const cv::Mat3b& photo, const Eigen::Vector2d& x_in_photo) {
  const Eigen::Vector2d at = OpenCvFromImg(x_in_photo);
  const double x = std::clamp(at.x(), 0.0, photo.cols - 1.0);
  const double y = std::clamp(at.y(), 0.0, photo.rows - 1.0);
  const int left = std::min(static_cast<int>(x), std::max(photo.cols - 2, 0));
  const int top = std::min(static_cast<int>(y), std::max(photo.rows - 2, 0));
  const int right = std::min(left + 1, photo.cols - 1), bottom = std::min(top + 1, photo.rows - 1);
  const float s = static_cast<float>(x - left), t = static_cast<float>(y - top);
  const cv::Vec3f color =
      (1 - t) * ((1 - s) * cv::Vec3f(photo(top, left)) + s * cv::Vec3f(photo(top, right))) +
      t * ((1 - s) * cv::Vec3f(photo(bottom, left)) + s * cv::Vec3f(photo(bottom, right)));
  return {cv::saturate_cast<uchar>(color[0]), cv::saturate_cast<uchar>(color[1]),
          cv::saturate_cast<uchar>(color[2]), 255};
}

}  // namespace

cv::Mat DrawBackProjection(const PickScene& scene, const ScanRays& rays, const PickPhoto& photo,
                           const CameraProjection& projection, const Rigid& cam_from_scan, int scan,
                           const std::function<bool()>& give_up) {
  const ScanPlaces& places = scene.places(scan);
  const Camera& camera = projection.camera();
  const double pixels = 1 / (camera.MeanFocalLength() * std::max(places.step(), 1e-9));
  const int min_width =
      static_cast<int>(std::ceil(camera.width * std::min(1.0, kPixelsPerSample * pixels)));
  const cv::Mat3b reduced = ReadReducedPhoto(photo.path, photo.fit, min_width);
  const Eigen::Vector2d shrink(1.0 * reduced.cols / camera.width,
                               1.0 * reduced.rows / camera.height);
  const double max_radius2 = std::pow(FieldRadius(projection), 2);
  const Eigen::Matrix3d rotation = cam_from_scan.rotation.toRotationMatrix();
  const Eigen::Vector3d centre = cam_from_scan.TargetOriginInSource();
  cv::Mat4b picture(places.height(), places.width(), cv::Vec4b(0, 0, 0, 0));
  std::atomic<bool> gave_up{false};
  ParallelFor(scene.input().num_threads, 0, picture.rows, [&](int row) {
    if (gave_up || give_up()) {
      gave_up = true;
      return;
    }
    for (int column = 0; column < picture.cols; ++column) {
      const Eigen::Vector3d& x_in_scan = places.scan().points[places.SampleAt(column, row)];
      const Eigen::Vector3d x = rotation * x_in_scan + cam_from_scan.translation;
      if (!(projection.Depth(x) > 1e-6)) continue;  // NaN as well
      if (camera.IsPerspective() && x.head<2>().squaredNorm() > max_radius2 * x.z() * x.z()) {
        continue;
      }
      const auto x_in_img = projection.ImgFromCam(x);
      if (!x_in_img || !projection.InImage(*x_in_img)) continue;
      if (rays.IsHidden(centre, x_in_scan)) continue;
      picture(row, column) = ColorAt(reduced, x_in_img->cwiseProduct(shrink));
    }
  });
  return gave_up ? cv::Mat() : cv::Mat(picture);
}

cv::Mat HalvedWithAlpha(const cv::Mat& image) {
  const cv::Mat4b source = image;
  cv::Mat4b half((source.rows + 1) / 2, (source.cols + 1) / 2);
  for (int row = 0; row < half.rows; ++row) {
    for (int column = 0; column < half.cols; ++column) {
      int sums[4] = {0, 0, 0, 0};
      for (int k = 0; k < 4; ++k) {
        const int y = std::min(2 * row + k / 2, source.rows - 1);
        const int x = std::min(2 * column + k % 2, source.cols - 1);
        const cv::Vec4b& color = source(y, x);
        for (int i = 0; i < 3; ++i) sums[i] += color[i] * color[3];
        sums[3] += color[3];
      }
      cv::Vec4b& mean = half(row, column);
      for (int i = 0; i < 3; ++i) {
        mean[i] = static_cast<uchar>(sums[3] > 0 ? (sums[i] + sums[3] / 2) / sums[3] : 0);
      }
      mean[3] = static_cast<uchar>((sums[3] + 2) / 4);
    }
  }
  return half;
}

std::shared_ptr<const std::string> BackProjections::Tile(const Key& key, int level, int x, int y,
                                                         const Draw& draw) {
  std::shared_ptr<Picture> picture;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    pictures_.remove_if(
        [&](const auto& other) { return other->key.solution_number < key.solution_number; });
    const auto found = std::find_if(pictures_.begin(), pictures_.end(),
                                    [&](const auto& other) { return other->key == key; });
    if (found == pictures_.end()) {
      picture = std::make_shared<Picture>();
      picture->key = key;
    } else {
      picture = *found;
      pictures_.erase(found);
    }
    pictures_.push_front(picture);
    if (pictures_.size() > kMaxPictures) pictures_.pop_back();
  }
  const std::lock_guard<std::mutex> lock(picture->making);
  std::vector<cv::Mat>& levels = picture->levels;
  if (levels.empty()) {
    cv::Mat drawn = draw();
    if (drawn.empty()) return nullptr;
    levels.push_back(std::move(drawn));
    while (std::max(levels.back().cols, levels.back().rows) > tile_size_) {
      levels.push_back(HalvedWithAlpha(levels.back()));
    }
  }
  if (level < 0 || level >= static_cast<int>(levels.size()) || x < 0 || y < 0) return nullptr;
  const cv::Mat& image = levels[level];
  if (x > image.cols / tile_size_ || y > image.rows / tile_size_) return nullptr;
  const cv::Rect place = cv::Rect(x * tile_size_, y * tile_size_, tile_size_, tile_size_) &
                         cv::Rect(0, 0, image.cols, image.rows);
  if (place.empty()) return nullptr;
  std::vector<uchar> bytes;
  cv::imencode(".png", image(place), bytes, {cv::IMWRITE_PNG_COMPRESSION, kPngCompression});
  return std::make_shared<const std::string>(bytes.begin(), bytes.end());
}

}  // namespace roomtex
