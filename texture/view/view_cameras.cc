#include "texture/view/view_cameras.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/undistortion.h"

namespace roomtex {
namespace {

constexpr int kCellPx = 18;  // of the lattice, in a photo of 2000 pixels
// A panorama bends lines more than a lens does.
constexpr double kPanoramaCell = 0.5;
constexpr size_t kCacheBytes = 64 << 20;

Eigen::Vector3f Direction(const CameraProjection& projection, const Eigen::Vector2d& x_in_img) {
  const auto ray = projection.RayFromImg(x_in_img);
  if (!ray) return Eigen::Vector3f::Zero();
  return ray->normalized().cast<float>();
}

// A panorama is drawn, and looked out of, as if it saw 90 x 53 degrees.
constexpr double kPanoramaHalfWidth = 1, kPanoramaHalfHeight = 0.5;  // x/z, y/z

std::shared_ptr<const std::string> EncodeJpeg(const cv::Mat& picture) {
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, 92});
  return std::make_shared<const std::string>(bytes.begin(), bytes.end());
}

// The photo, no smaller than `size`; what is a small part of it is decoded from a part of the data.
cv::Mat ReadAtLeast(const std::string& path, PhotoPixels pixels, int size) {
  if (pixels != PhotoPixels::kAsStored) return ReadPhoto(path, pixels);
  const auto [width, height] = ReadPhotoSize(path);
  int shrink = 1;
  while (shrink < 8 && std::max(width, height) / (2 * shrink) >= size) shrink *= 2;
  return shrink > 1 ? ReadShrunkPhoto(path, shrink) : ReadPhoto(path, pixels);
}

Json Vector(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

// Least recently used last.
struct ViewCameras::Cache {
  struct Entry {
    std::pair<int, int> key;  // camera, size
    std::shared_ptr<const std::string> bytes;
  };
  std::mutex decoding;  // one photo at a time: a page asks for all of a list at once
  std::mutex mutex;
  std::list<Entry> entries;
  size_t bytes = 0;

  std::shared_ptr<const std::string> Find(const std::pair<int, int>& key) {
    const std::lock_guard<std::mutex> lock(mutex);
    for (auto entry = entries.begin(); entry != entries.end(); ++entry) {
      if (entry->key != key) continue;
      entries.splice(entries.begin(), entries, entry);
      return entry->bytes;
    }
    return nullptr;
  }
  void Keep(const std::pair<int, int>& key, const std::shared_ptr<const std::string>& picture) {
    const std::lock_guard<std::mutex> lock(mutex);
    entries.push_front({key, picture});
    bytes += picture->size();
    while (bytes > kCacheBytes && entries.size() > 1) {
      bytes -= entries.back().bytes->size();
      entries.pop_back();
    }
  }
};

PhotoLattice MakePhotoLattice(const Camera& camera) {
  const CameraProjection projection(camera);
  PhotoLattice lattice;
  // Finer for larger photos only as far as their distortion asks for it: it goes with the angle.
  const double cell = kCellPx * std::max(1.0, std::max(camera.width, camera.height) / 2000.0) *
                      (camera.IsPanorama() ? kPanoramaCell : 1);
  lattice.columns = 1 + std::max(2, static_cast<int>(std::ceil(camera.width / cell)));
  lattice.rows = 1 + std::max(2, static_cast<int>(std::ceil(camera.height / cell)));
  for (int row = 0; row < lattice.rows; ++row) {
    for (int column = 0; column < lattice.columns; ++column) {
      const Eigen::Vector2d at(static_cast<double>(column) * camera.width / (lattice.columns - 1),
                               static_cast<double>(row) * camera.height / (lattice.rows - 1));
      lattice.directions.push_back(Direction(projection, at));
    }
  }
  return lattice;
}

ViewCameras::ViewCameras(SparseModel model_in_scan, const std::string& image_path)
    : model_(std::move(model_in_scan)), cache_(std::make_shared<Cache>()) {
  for (const auto& [id, image] : model_.images) images_.push_back(&image);
  std::sort(images_.begin(), images_.end(),
            [](const SparseImage* a, const SparseImage* b) { return a->name < b->name; });
  for (const SparseImage* image : images_) {
    const std::filesystem::path path = std::filesystem::path(image_path) / image->name;
    const Camera& camera = model_.cameras.at(image->camera_id);
    PhotoFit fit;
    if (!image_path.empty()) {
      fit = FitPhotoToCamera(path.string(), image->name, camera.width, camera.height);
      if (!fit.usable()) left_out_.push_back({image->name, fit.problem});
    }
    const bool there = !image_path.empty() && fit.usable();
    paths_.push_back(there ? path.string() : "");
    fits_.push_back(fit);
  }
}

size_t ViewCameras::num_photos() const {
  return static_cast<size_t>(std::count_if(paths_.begin(), paths_.end(),
                                           [](const std::string& path) { return !path.empty(); }));
}

const SparseImage& ViewCameras::Image(int id) const {
  if (id < 0 || id >= static_cast<int>(images_.size()))
    throw UsageError("There is no such camera.");
  return *images_[id];
}

Json ViewCameras::ToJson() const {
  Json list = Json::array();
  for (size_t i = 0; i < images_.size(); ++i) {
    const SparseImage& image = *images_[i];
    const Camera& camera = model_.cameras.at(image.camera_id);
    const CameraProjection projection(camera);
    const double w = camera.width, h = camera.height;
    Json corners = Json::array();
    for (const Eigen::Vector2d& at : {Eigen::Vector2d(0, 0), Eigen::Vector2d(w, 0),
                                      Eigen::Vector2d(w, h), Eigen::Vector2d(0, h)}) {
      Eigen::Vector3d corner = Direction(projection, at).cast<double>();
      if (camera.IsPanorama()) {
        corner = Eigen::Vector3d((2 * at.x() / w - 1) * kPanoramaHalfWidth,
                                 (2 * at.y() / h - 1) * kPanoramaHalfHeight, 1)
                     .normalized();
      }
      if (corner.isZero()) {  // beyond the field of a fisheye
        const double f = camera.MeanFocalLength();
        corner = Eigen::Vector3d((at.x() - w / 2) / f, (at.y() - h / 2) / f, 1).normalized();
      }
      corners.push_back(Vector(corner));
    }
    const Eigen::Quaterniond& q = image.cam_from_model.rotation;
    list.push_back({{"id", i},
                    {"name", image.name},
                    {"width", camera.width},
                    {"height", camera.height},
                    {"focal", camera.IsPanorama() ? 0.5 * camera.height / kPanoramaHalfHeight
                                                  : camera.MeanFocalLength()},
                    {"center", Vector(image.cam_from_model.TargetOriginInSource())},
                    {"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
                    {"corners", corners},
                    {"photo", !paths_[i].empty()}});
  }
  return list;
}

Json ViewCameras::Lattice(int id) const {
  const PhotoLattice lattice = MakePhotoLattice(model_.cameras.at(Image(id).camera_id));
  Json directions = Json::array();
  for (const Eigen::Vector3f& direction : lattice.directions) {
    // Seven digits: a ten-thousandth of a pixel.
    for (int k = 0; k < 3; ++k) directions.push_back(std::round(1e7 * direction[k]) / 1e7);
  }
  return {{"columns", lattice.columns}, {"rows", lattice.rows}, {"directions", directions}};
}

std::shared_ptr<const std::string> ViewCameras::Photo(int id, int max_size) const {
  const SparseImage& image = Image(id);
  if (paths_[id].empty()) return nullptr;
  const int size = std::clamp(max_size, 16, 8192);
  if (auto found = cache_->Find({id, size})) return found;
  const std::lock_guard<std::mutex> one_at_a_time(cache_->decoding);
  if (auto found = cache_->Find({id, size})) return found;
  cv::Mat photo = ReadAtLeast(paths_[id], fits_[id].pixels, size);
  const Camera& camera = model_.cameras.at(image.camera_id);
  const double shape = static_cast<double>(photo.cols) / photo.rows;
  if (std::abs(shape * camera.height / camera.width - 1) > 0.02) {
    const auto [width, height] = ReadPhotoSize(paths_[id]);  // it changed since it was looked at
    throw InputError(paths_[id], "",
                     "is " + std::to_string(width) + " x " + std::to_string(height) +
                         " pixels, its camera " + std::to_string(camera.width) + " x " +
                         std::to_string(camera.height),
                     "Give the photos that the model was made from");
  }
  const double scale = static_cast<double>(size) / std::max(photo.cols, photo.rows);
  if (scale < 1) {
    const cv::Size to(std::max(1, static_cast<int>(std::lround(scale * photo.cols))),
                      std::max(1, static_cast<int>(std::lround(scale * photo.rows))));
    cv::resize(photo, photo, to, 0, 0, cv::INTER_AREA);
  }
  auto result = EncodeJpeg(photo);
  cache_->Keep({id, size}, result);
  return result;
}

std::optional<Camera> ViewCameras::Pinhole(int id, int max_size) const {
  const Camera& camera = model_.cameras.at(Image(id).camera_id);
  if (paths_[id].empty()) return std::nullopt;
  PinholeOptions options;
  options.max_image_size = max_size;
  return PinholeCamera(camera, options);
}

std::shared_ptr<const std::string> ViewCameras::PinholePhoto(int id, int max_size,
                                                             const ResponseCurve* response) const {
  const int size = std::clamp(max_size, 16, 8192);
  const std::optional<Camera> pinhole = Pinhole(id, size);
  if (!pinhole) return nullptr;
  const std::pair<int, int> key(id, -size);  // beside the photo as it is
  if (auto found = cache_->Find(key)) return found;
  const std::lock_guard<std::mutex> one_at_a_time(cache_->decoding);
  if (auto found = cache_->Find(key)) return found;
  const Camera& camera = model_.cameras.at(Image(id).camera_id);
  cv::Mat photo = ReadFittedPhoto(paths_[id], fits_[id], camera.width, camera.height);
  if (response != nullptr) response->ToSrgb(&photo);
  auto result = EncodeJpeg(UndistortPhoto(photo, camera, *pinhole).picture);
  cache_->Keep(key, result);
  return result;
}

cv::Mat1b ViewCameras::PinholeTransparency(int id, int max_size) const {
  const std::optional<Camera> pinhole = Pinhole(id, max_size);
  if (!pinhole) return {};
  cv::Mat1b transparent = ReadTransparency(paths_[id], fits_[id].pixels);
  if (transparent.empty()) return {};
  const Camera& camera = model_.cameras.at(Image(id).camera_id);
  cv::resize(transparent, transparent, {camera.width, camera.height}, 0, 0, cv::INTER_AREA);
  return UndistortPhoto(transparent, camera, *pinhole).picture > 0;
}

std::string ViewCameras::EncodePoints(const Eigen::Vector3d& origin) const {
  std::string bytes;
  bytes.reserve(16 * model_.points.size());
  for (const auto& [id, point] : model_.points) {
    const Eigen::Vector3f p = (point.x_in_model - origin).cast<float>();
    // Points of nearly parallel rays lie kilometres away and would only make the depths coarse.
    if (!p.allFinite() || p.norm() > 1000) continue;
    const uint8_t rgba[4] = {point.color[0], point.color[1], point.color[2], 255};
    bytes.append(reinterpret_cast<const char*>(p.data()), 12);
    bytes.append(reinterpret_cast<const char*>(rgba), 4);
  }
  return bytes;
}

}  // namespace roomtex
