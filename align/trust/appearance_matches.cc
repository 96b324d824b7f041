#include "align/trust/appearance_matches.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "core/camera_model.h"
#include "core/frames.h"
#include "core/parallel.h"

namespace roomtex {
namespace {

constexpr double kViewField = 65;                             // degrees across and down
constexpr double kViewTurn = 45;                              // degrees from view to view
constexpr std::array<double, 2> kViewLean = {-25, 20};        // degrees above the horizon
constexpr double kFinestPixel = 0.08, kCoarsestPixel = 0.35;  // degrees, of views and photos
constexpr double kNormalised = 0.9;  // degrees, standard deviation of the neighbourhood
constexpr double kPointReach = 0.6;  // degrees from a keypoint to the sparse point it stands for

constexpr double kLeastSide = 32;    // pixels, of a photo as it is described
constexpr double kMostCells = 1000;  // across a photo

constexpr int kNearest = 5;         // that may be one place, seen in several views
constexpr double kElsewhere = 0.3;  // metres

// Features of several pictures: a row of `sift` each, unit length.
struct Features {
  std::vector<Eigen::Vector3d> places;
  std::vector<Eigen::Vector2d> in_img;  // of a photo: in the photo as it is
  std::vector<uint32_t> image_ids;
  std::vector<float> responses;
  cv::Mat1f sift;
};

// (x - local mean) / local deviation as 8 bits; where invalid, the mean.
cv::Mat1b LocallyNormalised(const cv::Mat1f& grey, const cv::Mat1b& valid, double sigma) {
  cv::Mat1f weight, mean, square;
  cv::Mat1f used;
  valid.convertTo(used, CV_32F, 1 / 255.0);
  const cv::Mat1f masked = grey.mul(used);
  cv::GaussianBlur(used, weight, {}, sigma);
  cv::GaussianBlur(masked, mean, {}, sigma);
  cv::GaussianBlur(masked.mul(masked), square, {}, sigma);
  cv::Mat1b out(grey.size(), static_cast<uchar>(128));
  constexpr float kNoise = 4, kContrast = 48;  // of 255
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      if (!valid(y, x) || weight(y, x) < 0.05f) continue;
      const float m = mean(y, x) / weight(y, x);
      const float variance = std::max(0.0f, square(y, x) / weight(y, x) - m * m);
      const float value = 128 + kContrast * (grey(y, x) - m) / (std::sqrt(variance) + kNoise);
      out(y, x) = cv::saturate_cast<uchar>(value);
    }
  }
  return out;
}

// Degrees, as cv::KeyPoint has them, of the direction (dx, dy).
float KeypointAngle(const Eigen::Vector2d& direction) {
  const double angle = DegFromRad(std::atan2(direction.y(), direction.x()));
  return static_cast<float>(angle < 0 ? angle + 360 : angle);
}

// RootSIFT (Arandjelovic and Zisserman 2012).
void TakeRoots(cv::Mat1f* sift) {
  for (int i = 0; i < sift->rows; ++i) {
    float* const row = sift->ptr<float>(i);
    float sum = 0;
    for (int k = 0; k < sift->cols; ++k) sum += row[k];
    for (int k = 0; k < sift->cols; ++k) row[k] = std::sqrt(row[k] / std::max(sum, 1e-6f));
  }
}

// Opposite gradients as one: half of the eight directions of each cell.
cv::Mat1f Folded(const cv::Mat1f& root_sift) {
  cv::Mat1f folded(root_sift.rows, 64);
  for (int i = 0; i < root_sift.rows; ++i) {
    for (int cell = 0; cell < 16; ++cell) {
      for (int k = 0; k < 4; ++k) {
        const float a = root_sift(i, 8 * cell + k), b = root_sift(i, 8 * cell + k + 4);
        folded(i, 4 * cell + k) = std::sqrt(a * a + b * b);
      }
    }
  }
  return folded;
}

// place_of: where a keypoint is and, if known, which way is down there; none to leave it out.
struct Place {
  Eigen::Vector3d x;
  std::optional<Eigen::Vector2d> down;
  Eigen::Vector2d in_img;
};
template <typename PlaceOf>
Features Describe(const cv::Mat1b& picture, const cv::Mat1b& valid, bool upright, int most,
                  const PlaceOf& place_of) {
  const cv::Ptr<cv::SIFT> sift = cv::SIFT::create(0, 3, 0.02, 12, 1.6);
  std::vector<cv::KeyPoint> found, used;
  sift->detect(picture, found, valid);
  std::sort(found.begin(), found.end(), [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return std::make_tuple(-a.response, a.pt.x, a.pt.y, a.size) <
           std::make_tuple(-b.response, b.pt.x, b.pt.y, b.size);
  });
  Features features;
  for (const cv::KeyPoint& one : found) {
    if (static_cast<int>(used.size()) == most) break;
    const bool is_again = !used.empty() && used.back().pt == one.pt && used.back().size == one.size;
    if (upright && is_again) continue;  // several directions of its gradients
    const std::optional<Place> place = place_of(Eigen::Vector2d(one.pt.x + 0.5, one.pt.y + 0.5));
    if (!place) continue;
    used.push_back(one);
    if (place->down) used.back().angle = KeypointAngle(*place->down);
    features.places.push_back(place->x);
    features.in_img.push_back(place->in_img);
    features.responses.push_back(one.response);
  }
  cv::Mat descriptors;
  if (!used.empty()) sift->compute(picture, used, descriptors);
  features.sift = descriptors;
  TakeRoots(&features.sift);
  return features;
}

// part_ids: of the photos, or none.
Features Joined(std::vector<Features> parts, const std::vector<uint32_t>& part_ids, size_t most) {
  std::vector<std::tuple<float, size_t, size_t>> order;
  for (size_t i = 0; i < parts.size(); ++i) {
    for (size_t k = 0; k < parts[i].places.size(); ++k) {
      order.emplace_back(-parts[i].responses[k], i, k);
    }
  }
  std::sort(order.begin(), order.end());
  if (order.size() > most) order.resize(most);
  Features all;
  all.sift = cv::Mat1f(static_cast<int>(order.size()), 128);
  for (const auto& [response, i, k] : order) {
    parts[i]
        .sift.row(static_cast<int>(k))
        .copyTo(all.sift.row(static_cast<int>(all.places.size())));
    all.places.push_back(parts[i].places[k]);
    all.in_img.push_back(parts[i].in_img[k]);
    all.image_ids.push_back(part_ids.empty() ? 0 : part_ids[i]);
  }
  return all;
}

double PixelAngle(const ScanViewer& viewer) {
  return std::clamp(DegFromRad(viewer.sample_angle()), kFinestPixel, kCoarsestPixel);
}

Features FeaturesOfView(const ScanViewer& viewer, const Scan& scan, const Eigen::Vector3d& up,
                        bool upright, double azimuth, double lean, int most) {
  const double pixel = PixelAngle(viewer);
  const int size = static_cast<int>(kViewField / pixel) / 8 * 8;
  const double f = 0.5 * size / std::tan(RadFromDeg(0.5 * kViewField));
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.width = camera.height = size;
  camera.params = {f, f, 0.5 * size, 0.5 * size};
  const CameraProjection projection(camera);
  const Eigen::Vector3d level = Eigen::AngleAxisd(RadFromDeg(azimuth), up) * up.unitOrthogonal();
  const Eigen::Vector3d z = std::cos(RadFromDeg(lean)) * level + std::sin(RadFromDeg(lean)) * up;
  const Eigen::Vector3d x = z.cross(up).normalized(), y = z.cross(x);
  Eigen::Matrix3d cam_from_scan;
  cam_from_scan << x.transpose(), y.transpose(), z.transpose();
  Rigid pose;
  pose.rotation = Eigen::Quaterniond(cam_from_scan);
  pose.translation = -(pose.rotation * scan.Station());
  const int cell = viewer.has_mesh() ? 1 : 4;
  const ScanView view = viewer.Look(RayLattice(projection, cell), camera, pose, 1);
  const cv::Mat1b picture = LocallyNormalised(view.grey, view.valid, kNormalised / pixel);
  const Rigid scan_from_cam = pose.Inverse();
  const Eigen::Vector3d down = pose.rotation * -up;
  return Describe(picture, view.valid, upright, most,
                  [&](const Eigen::Vector2d& at) -> std::optional<Place> {
                    const int column = std::clamp(static_cast<int>(at.x()), 0, size - 1);
                    const int row = std::clamp(static_cast<int>(at.y()), 0, size - 1);
                    const float depth = view.depth(row, column);
                    if (!(depth > 0)) return std::nullopt;
                    const Eigen::Vector2d ray((at.x() - 0.5 * size) / f, (at.y() - 0.5 * size) / f);
                    const Eigen::Vector3d x_in_cam = depth * ray.homogeneous();
                    Place place = {scan_from_cam * x_in_cam, {}, at};
                    if (upright) place.down = down.head<2>() - ray * down.z();
                    return place;
                  });
}

// As it is described; empty if it cannot be read, or is too small.
cv::Mat1b ReadPicture(const SparseImage& image, const Camera& camera, const std::string& image_path,
                      double pixel) {
  const double scale = std::min(1.0, 1 / (RadFromDeg(pixel) * camera.MeanFocalLength()));
  if (scale * std::min(camera.width, camera.height) < kLeastSide) return {};
  std::string ignored;  // comes again when the result is compared
  const std::optional<cv::Mat> photo = ReadPhotoOf(image, camera, image_path, &ignored);
  if (!photo) return {};
  cv::Mat grey;
  cv::cvtColor(*photo, grey, cv::COLOR_BGR2GRAY);
  if (scale < 1) cv::resize(grey, grey, {}, scale, scale, cv::INTER_AREA);
  cv::Mat1f values;
  grey.convertTo(values, CV_32F);
  const double px_per_deg = RadFromDeg(1.0) * camera.MeanFocalLength() * grey.cols / camera.width;
  return LocallyNormalised(values, cv::Mat1b(grey.size(), static_cast<uchar>(255)),
                           kNormalised * px_per_deg);
}

Features FeaturesOfPhoto(const SparseModel& model, const SparseImage& image,
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
  return Describe(picture, cv::Mat1b(), up_in_sparse.has_value(), most,
                  [&](const Eigen::Vector2d& small_at) -> std::optional<Place> {
                    const Eigen::Vector2d at = small_at.cwiseProduct(size.cwiseQuotient(small));
                    int nearest = -1;
                    double least = reach * reach;
                    const int row = cell_of(at.y(), rows), column = cell_of(at.x(), columns);
                    for (int r = std::max(0, row - 1); r <= std::min(rows - 1, row + 1); ++r) {
                      for (int c = std::max(0, column - 1); c <= std::min(columns - 1, column + 1);
                           ++c) {
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
                    Place place = {model.points.at(image.point3d_ids[nearest]).x_in_model, {}, at};
                    if (!up_in_sparse) return place;
                    const auto ray = projection.RayFromImg(at);
                    if (!ray) return std::nullopt;
                    const Eigen::Vector3d down = image.cam_from_model.rotation * -*up_in_sparse;
                    const auto lower = projection.ImgFromCam(ray->normalized() + 1e-3 * down);
                    if (!lower) return std::nullopt;
                    place.down = *lower - at;
                    return place;
                  });
}

// Pairs (feature of a photo, feature of the scan). Views overlap, so that the next best may be the
// same place of the scan.
void AddMatches(const cv::Mat1f& photos, const cv::Mat1f& scan,
                const std::vector<Eigen::Vector3d>& places, double max_ratio,
                std::vector<std::pair<int, int>>* pairs) {
  std::vector<std::vector<cv::DMatch>> nearest;
  cv::BFMatcher(cv::NORM_L2).knnMatch(photos, scan, nearest, kNearest);
  for (const std::vector<cv::DMatch>& near : nearest) {
    const auto elsewhere = std::find_if(near.begin(), near.end(), [&](const cv::DMatch& one) {
      return (places[one.trainIdx] - places[near[0].trainIdx]).norm() > kElsewhere;
    });
    const cv::DMatch* const other = elsewhere == near.end() ? nullptr : &*elsewhere;
    if (other == nullptr || near[0].distance > max_ratio * other->distance) continue;
    pairs->emplace_back(near[0].queryIdx, near[0].trainIdx);
  }
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
    photos_[i] = ReadPicture(*images_[i], model.cameras.at(images_[i]->camera_id), image_path,
                             PixelAngle(viewer));
  });
}

std::vector<AppearanceMatch> AppearanceMatcher::Match(
    const std::optional<Eigen::Vector3d>& up_in_sparse, const Eigen::Vector3d& up_in_scan) const {
  std::vector<const Scan*> stations;
  for (const Scan& scan : viewer_.scans()) {
    if (scan.organised) stations.push_back(&scan);
  }
  if (stations.empty()) return {};
  const int per_turn = static_cast<int>(std::lround(360 / kViewTurn));
  const int num_stations = std::min<int>(options_.max_stations, static_cast<int>(stations.size()));
  const int per_station = per_turn * static_cast<int>(kViewLean.size());
  const int num_views = num_stations * per_station;
  std::vector<Features> of_views(num_views), of_photos(images_.size());
  ParallelFor(num_threads_, 0, num_views, [&](int i) {
    const Scan& scan = *stations[static_cast<size_t>(i / per_station) * stations.size() /
                                 static_cast<size_t>(num_stations)];
    const int k = i % per_station;
    of_views[i] =
        FeaturesOfView(viewer_, scan, up_in_scan, up_in_sparse.has_value(), kViewTurn * (k / 2),
                       kViewLean[k % 2], 2 * options_.max_scan_features / num_views);
  });
  std::vector<uint32_t> image_ids;
  for (const SparseImage* image : images_) image_ids.push_back(image->image_id);
  ParallelFor(num_threads_, 0, static_cast<int>(images_.size()), [&](int i) {
    of_photos[i] =
        FeaturesOfPhoto(model_, *images_[i], photos_[i], up_in_sparse,
                        2 * options_.max_photo_features / static_cast<int>(images_.size()));
  });
  const Features scan = Joined(std::move(of_views), {}, options_.max_scan_features);
  const Features photos = Joined(std::move(of_photos), image_ids, options_.max_photo_features);
  std::vector<std::pair<int, int>> pairs;
  if (scan.places.empty() || photos.places.empty()) return {};
  AddMatches(photos.sift, scan.sift, scan.places, options_.max_ratio, &pairs);
  AddMatches(Folded(photos.sift), Folded(scan.sift), scan.places, options_.max_ratio, &pairs);
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  std::vector<AppearanceMatch> matches;
  for (const auto& [photo, view] : pairs) {
    matches.push_back(
        {photos.places[photo], scan.places[view], photos.image_ids[photo], photos.in_img[photo]});
  }
  return matches;
}

}  // namespace roomtex
