#include "align/trust/appearance_matches.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "align/trust/appearance_features.h"
#include "core/camera_model.h"
#include "core/frames.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr double kPointReach = 0.6;  // degrees from a keypoint to the sparse point it stands for
constexpr double kMostCells = 1000;  // across a photo

AppearanceFeatures FeaturesOfPhoto(const SparseModel& model, const SparseImage& image,
                                   const cv::Mat1b& picture,
                                   const std::optional<Eigen::Vector3d>& up_in_sparse, int most) {
  if (picture.empty()) return {};
  const Camera& camera = model.cameras.at(image.camera_id);
  const Eigen::Vector2d size(camera.width, camera.height), small(picture.cols, picture.rows);
  // Sparse points by cells of the picture, to find the nearest one.
  const double reach = std::max(kPointReach * RadFromDeg(1.0) * camera.MeanFocalLength(),
                                std::max(camera.width, camera.height) / kMostCells);
  const int columns = static_cast<int>(camera.width / reach) + 1;
  const int rows = static_cast<int>(camera.height / reach) + 1;
  std::vector<std::vector<int>> cells(static_cast<size_t>(columns) * rows);
  const auto cell_of = [&](double v, int count) {
    return std::clamp(static_cast<int>(v / reach), 0, count - 1);
  };
  for (size_t i = 0; i < image.points2d.size(); ++i) {
    if (image.point3d_ids[i] == kInvalidPoint3dId) continue;
    const Eigen::Vector2d& at = image.points2d[i];
    cells[static_cast<size_t>(cell_of(at.y(), rows)) * columns + cell_of(at.x(), columns)]
        .push_back(static_cast<int>(i));
  }
  const CameraProjection projection(camera);
  const PlaceOfKeypoint place_of =
      [&](const Eigen::Vector2d& small_at) -> std::optional<FeaturePlace> {
    const Eigen::Vector2d at = small_at.cwiseProduct(size.cwiseQuotient(small));
    int nearest = -1;
    double least = reach * reach;
    const int row = cell_of(at.y(), rows), column = cell_of(at.x(), columns);
    for (int r = std::max(0, row - 1); r <= std::min(rows - 1, row + 1); ++r) {
      for (int c = std::max(0, column - 1); c <= std::min(columns - 1, column + 1); ++c) {
        for (const int i : cells[static_cast<size_t>(r) * columns + c]) {
          const double distance = (image.points2d[i] - at).squaredNorm();
          if (distance < least) {
            least = distance;
            nearest = i;
          }
        }
      }
    }
    if (nearest < 0) return std::nullopt;
    FeaturePlace place = {model.points.at(image.point3d_ids[nearest]).x_in_model, {}, at};
    if (!up_in_sparse) return place;
    const auto ray = projection.RayFromImg(at);
    if (!ray) return std::nullopt;
    const Eigen::Vector3d down = image.cam_from_model.rotation * -*up_in_sparse;
    const auto lower = projection.ImgFromCam(ray->normalized() + 1e-3 * down);
    if (!lower) return std::nullopt;
    place.down = *lower - at;
    return place;
  };
  return DescribeFeatures(picture, FindKeypoints(picture, cv::Mat1b()),
                          {{up_in_sparse.has_value(), place_of}}, most)[0];
}

}  // namespace

AppearanceMatcher::AppearanceMatcher(const SparseModel& model, const std::string& image_path,
                                     const ScanViewer& viewer, const AppearanceOptions& options,
                                     int num_threads)
    : model_(model),
      viewer_(viewer),
      options_(options),
      num_threads_(num_threads),
      images_(SpreadImages(model, options.max_photos)),
      photos_(images_.size()) {
  ParallelFor(num_threads, 0, static_cast<int>(images_.size()), [&](int i) {
    photos_[i] =
        ReadPictureOf(*images_[i], model.cameras.at(images_[i]->camera_id), image_path, viewer);
  });
}

std::vector<AppearanceMatch> AppearanceMatcher::Match(
    const std::optional<Eigen::Vector3d>& up_in_sparse, const Eigen::Vector3d& up_in_scan) const {
  const AppearanceFeatures scan =
      FeaturesOfScan(viewer_, up_in_scan, {up_in_sparse.has_value()}, options_.max_stations,
                     options_.max_scan_features, num_threads_)[0];
  if (scan.places.empty()) return {};
  std::vector<AppearanceFeatures> of_photos(images_.size());
  std::vector<uint32_t> image_ids;
  for (const SparseImage* image : images_) image_ids.push_back(image->image_id);
  ParallelFor(num_threads_, 0, static_cast<int>(images_.size()), [&](int i) {
    of_photos[i] =
        FeaturesOfPhoto(model_, *images_[i], photos_[i], up_in_sparse,
                        2 * options_.max_photo_features / static_cast<int>(images_.size()));
  });
  const AppearanceFeatures photos =
      JoinFeatures(std::move(of_photos), image_ids, options_.max_photo_features);
  std::vector<AppearanceMatch> matches;
  for (const auto& [photo, view] : MatchFeatures(photos, scan, options_.max_ratio)) {
    matches.push_back(
        {photos.places[photo], scan.places[view], photos.image_ids[photo], photos.in_img[photo]});
  }
  return matches;
}

}  // namespace roomtex
