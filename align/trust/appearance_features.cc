#include "align/trust/appearance_features.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "align/trust/transparent_parts.h"
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

constexpr double kLeastSide = 32;  // pixels, of a photo as it is described

constexpr double kBeside = 2;  // pixels, of a view: for the side of a surface that it shows

constexpr int kNearest = 5;              // that may be one place, seen in several views
constexpr double kElsewhere = 0.3;       // metres
constexpr double kElsewhereNear = 0.25;  // of the reach

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

cv::Ptr<cv::SIFT> MakeSift() { return cv::SIFT::create(0, 3, 0.02, 12, 1.6); }

double PixelAngle(const ScanViewer& viewer) {
  return std::clamp(DegFromRad(viewer.sample_angle()), kFinestPixel, kCoarsestPixel);
}

// Views overlap, so that the next best may be the same place of the scan.
void AddMatches(const Descriptors& photos, const Descriptors& scan,
                const std::vector<Eigen::Vector3d>& places, double max_ratio,
                std::vector<std::pair<int, int>>* pairs) {
  const auto nearest = FindNearestDescriptors(photos, scan, kNearest);
  for (size_t i = 0; i < nearest.size(); ++i) {
    const std::vector<NearDescriptor>& near = nearest[i];
    const auto elsewhere = std::find_if(near.begin(), near.end(), [&](const NearDescriptor& one) {
      return (places[one.row] - places[near[0].row]).norm() > kElsewhere;
    });
    if (near.empty()) continue;
    // Where all of the nearest are the same place, elsewhere is no nearer than the last of them.
    const NearDescriptor& other = elsewhere == near.end() ? near.back() : *elsewhere;
    if (near[0].distance > max_ratio * other.distance) continue;
    pairs->emplace_back(static_cast<int>(i), near[0].row);
  }
}

}  // namespace

std::optional<Eigen::Vector2d> DirectionInImg(const CameraProjection& projection,
                                              const Eigen::Vector2d& plane,
                                              const Eigen::Vector3d& direction_in_cam) {
  const Eigen::Vector3d ray = plane.homogeneous();
  const auto at = projection.ImgFromCam(ray),
             moved = projection.ImgFromCam(ray + 1e-3 * direction_in_cam);
  if (!at || !moved) return std::nullopt;
  return *moved - *at;
}

std::vector<cv::KeyPoint> FindKeypoints(const cv::Mat1b& picture, const cv::Mat1b& valid) {
  std::vector<cv::KeyPoint> found;
  MakeSift()->detect(picture, found, valid);
  std::sort(found.begin(), found.end(), [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return std::make_tuple(-a.response, a.pt.x, a.pt.y, a.size) <
           std::make_tuple(-b.response, b.pt.x, b.pt.y, b.size);
  });
  return found;
}

std::vector<AppearanceFeatures> DescribeFeatures(const cv::Mat1b& picture,
                                                 const std::vector<cv::KeyPoint>& keypoints,
                                                 const std::vector<KeypointUse>& uses, int most) {
  std::vector<AppearanceFeatures> features(uses.size());
  std::vector<cv::KeyPoint> used;  // of all uses, one after the other
  for (size_t use = 0; use < uses.size(); ++use) {
    AppearanceFeatures& of_use = features[use];
    const size_t first = used.size();
    for (const cv::KeyPoint& one : keypoints) {
      if (static_cast<int>(of_use.places.size()) == most) break;
      const bool is_again =
          used.size() > first && used.back().pt == one.pt && used.back().size == one.size;
      if (uses[use].upright && is_again) continue;  // several directions of its gradients
      const std::optional<FeaturePlace> place =
          uses[use].place_of(Eigen::Vector2d(one.pt.x + 0.5, one.pt.y + 0.5));
      if (!place) continue;
      used.push_back(one);
      if (place->down) used.back().angle = KeypointAngle(*place->down);
      of_use.places.push_back(place->x);
      of_use.in_img.push_back(place->in_img);
      of_use.responses.push_back(one.response);
    }
  }
  cv::Mat descriptors(0, 128, CV_32F);
  if (!used.empty()) MakeSift()->compute(picture, used, descriptors);
  int row = 0;
  for (AppearanceFeatures& of_use : features) {
    const int end = row + static_cast<int>(of_use.places.size());
    of_use.sift = RootSift(descriptors.rowRange(row, end));
    row = end;
  }
  return features;
}

AppearanceFeatures JoinFeatures(std::vector<AppearanceFeatures> parts,
                                const std::vector<uint32_t>& part_ids, size_t most) {
  std::vector<std::tuple<float, size_t, size_t>> order;
  for (size_t i = 0; i < parts.size(); ++i) {
    for (size_t k = 0; k < parts[i].places.size(); ++k) {
      order.emplace_back(-parts[i].responses[k], i, k);
    }
  }
  std::sort(order.begin(), order.end());
  if (order.size() > most) order.resize(most);
  AppearanceFeatures all;
  all.sift = Descriptors(static_cast<int>(order.size()), 128);
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

namespace {

// The camera of a view, looking `lean` above the horizon.
Rigid PoseOfView(const Scan& scan, const Eigen::Vector3d& up, double azimuth, double lean) {
  const Eigen::Vector3d level = Eigen::AngleAxisd(RadFromDeg(azimuth), up) * up.unitOrthogonal();
  const Eigen::Vector3d z = std::cos(RadFromDeg(lean)) * level + std::sin(RadFromDeg(lean)) * up;
  const Eigen::Vector3d x = z.cross(up).normalized(), y = z.cross(x);
  Eigen::Matrix3d cam_from_scan;
  cam_from_scan << x.transpose(), y.transpose(), z.transpose();
  Rigid pose;
  pose.rotation = Eigen::Quaterniond(cam_from_scan);
  pose.translation = -(pose.rotation * scan.Station());
  return pose;
}

Camera ViewCamera(double pixel) {
  Camera camera;
  const int size = static_cast<int>(kViewField / pixel) / 8 * 8;
  const double f = 0.5 * size / std::tan(RadFromDeg(0.5 * kViewField));
  camera.model = CameraModel::kPinhole;
  camera.width = camera.height = size;
  camera.params = {f, f, 0.5 * size, 0.5 * size};
  return camera;
}

// The scan drawn from one place, and the keypoints found there.
class DrawnView {
 public:
  DrawnView(const ScanViewer& viewer, const Camera& camera, const Rigid& cam_from_scan)
      : viewer_(viewer),
        projection_(camera),
        cam_from_scan_(cam_from_scan),
        scan_from_cam_(cam_from_scan.Inverse()),
        view_(viewer.Look(RayLattice(projection_, viewer.has_mesh() ? 1 : 4), camera, cam_from_scan,
                          1)),
        picture_(LocallyNormalised(view_.grey, view_.valid,
                                   kNormalised * RadFromDeg(1.0) * camera.MeanFocalLength())),
        keypoints_(FindKeypoints(picture_, view_.valid)) {}

  std::vector<AppearanceFeatures> Describe(const Eigen::Vector3d& up_in_scan,
                                           const std::vector<bool>& upright, int most) const {
    std::vector<KeypointUse> uses;
    for (const bool is_upright : upright) {
      uses.push_back({is_upright, [this, is_upright, &up_in_scan](const Eigen::Vector2d& at) {
                        return FeatureAt(at, is_upright ? &up_in_scan : nullptr);
                      }});
    }
    return DescribeFeatures(picture_, keypoints_, uses, most);
  }

 private:
  // up_in_scan: of upright ones, else null.
  std::optional<FeaturePlace> FeatureAt(const Eigen::Vector2d& at,
                                        const Eigen::Vector3d* up_in_scan) const {
    const auto plane = projection_.CamFromImg(at);
    const auto x = PlaceAt(at);
    if (!plane || !x) return std::nullopt;
    if (!viewer_.has_mesh() && IsSeenFromBehind(at, *x)) return std::nullopt;
    FeaturePlace place = {*x, {}, at};
    if (!up_in_scan) return place;
    place.down = DirectionInImg(projection_, *plane, cam_from_scan_.rotation * -*up_in_scan);
    if (!place.down) return std::nullopt;
    return place;
  }

  cv::Point CellOf(const Eigen::Vector2d& at) const {
    return {std::min(static_cast<int>(at.x()), view_.depth.cols - 1),
            std::min(static_cast<int>(at.y()), view_.depth.rows - 1)};
  }

  std::optional<Eigen::Vector3d> PlaceAt(const Eigen::Vector2d& at) const {
    if (!projection_.InImage(at)) return std::nullopt;
    const float depth = view_.depth(CellOf(at));
    const auto plane = projection_.CamFromImg(at);
    if (!(depth > 0) || !plane) return std::nullopt;
    return scan_from_cam_ * (depth * plane->homogeneous());
  }

  // From behind, the mirror image of a wall looks like the wall.
  bool IsSeenFromBehind(const Eigen::Vector2d& at, const Eigen::Vector3d& x) const {
    const auto right = PlaceAt(at + Eigen::Vector2d(kBeside, 0)),
               left = PlaceAt(at - Eigen::Vector2d(kBeside, 0)),
               below = PlaceAt(at + Eigen::Vector2d(0, kBeside)),
               above = PlaceAt(at - Eigen::Vector2d(0, kBeside));
    if (!right || !left || !below || !above) return true;  // an edge: no side at all
    const Eigen::Vector3d normal = (*right - *left).cross(*below - *above);
    const Eigen::Vector3d station = viewer_.scans()[view_.scan(CellOf(at))].Station();
    return normal.dot(station - x) * normal.dot(scan_from_cam_.translation - x) < 0;
  }

  const ScanViewer& viewer_;
  CameraProjection projection_;
  Rigid cam_from_scan_, scan_from_cam_;
  ScanView view_;
  cv::Mat1b picture_;
  std::vector<cv::KeyPoint> keypoints_;
};

}  // namespace

AppearanceFeatures FeaturesOfView(const ScanViewer& viewer, const Camera& camera,
                                  const Rigid& cam_from_scan, const Eigen::Vector3d& up_in_scan,
                                  int most) {
  return DrawnView(viewer, camera, cam_from_scan).Describe(up_in_scan, {true}, most)[0];
}

std::vector<AppearanceFeatures> FeaturesOfScan(const ScanViewer& viewer,
                                               const Eigen::Vector3d& up_in_scan,
                                               const std::vector<bool>& upright, int max_stations,
                                               int most, int num_threads) {
  std::vector<const Scan*> stations;
  for (const Scan& scan : viewer.scans()) {
    if (scan.organised) stations.push_back(&scan);
  }
  if (stations.empty()) return std::vector<AppearanceFeatures>(upright.size());
  const int per_turn = static_cast<int>(std::lround(360 / kViewTurn));
  const int num_stations = std::min<int>(max_stations, static_cast<int>(stations.size()));
  const int per_station = per_turn * static_cast<int>(kViewLean.size());
  const int num_views = num_stations * per_station;
  const Camera camera = ViewCamera(PixelAngle(viewer));
  std::vector<std::vector<AppearanceFeatures>> of_views(upright.size(),
                                                        std::vector<AppearanceFeatures>(num_views));
  ParallelFor(num_threads, 0, num_views, [&](int i) {
    const Scan& scan = *stations[static_cast<size_t>(i / per_station) * stations.size() /
                                 static_cast<size_t>(num_stations)];
    const int k = i % per_station;
    const DrawnView view(viewer, camera,
                         PoseOfView(scan, up_in_scan, kViewTurn * (k / 2), kViewLean[k % 2]));
    std::vector<AppearanceFeatures> ways = view.Describe(up_in_scan, upright, 2 * most / num_views);
    for (size_t way = 0; way < upright.size(); ++way) of_views[way][i] = std::move(ways[way]);
  });
  std::vector<AppearanceFeatures> features;
  for (auto& of_way : of_views) features.push_back(JoinFeatures(std::move(of_way), {}, most));
  return features;
}

cv::Mat1b ReadPictureOf(const SparseImage& image, const Camera& camera,
                        const std::string& image_path, const ScanViewer& viewer) {
  const double pixel = PixelAngle(viewer);
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
  cv::Mat1b seen(grey.size(), static_cast<uchar>(255));
  const cv::Mat1b transparent = ReadTransparencyOf(image, camera, image_path);
  if (!transparent.empty()) {
    cv::resize(255 - transparent, seen, seen.size(), 0, 0, cv::INTER_AREA);
    seen = seen == 255;
  }
  const double px_per_deg = RadFromDeg(1.0) * camera.MeanFocalLength() * grey.cols / camera.width;
  return LocallyNormalised(values, seen, kNormalised * px_per_deg);
}

std::vector<std::pair<int, int>> MatchNear(const AppearanceFeatures& photo,
                                           const AppearanceFeatures& view, double reach,
                                           double max_ratio) {
  const Descriptors folded[2] = {FoldGradients(photo.sift), FoldGradients(view.sift)};
  std::vector<std::pair<int, int>> pairs;
  const double elsewhere = kElsewhereNear * reach;
  for (int i = 0; i < photo.sift.rows; ++i) {
    for (const bool fold : {false, true}) {
      const Descriptors& of_photo = fold ? folded[0] : photo.sift;
      const Descriptors& of_view = fold ? folded[1] : view.sift;
      std::vector<std::pair<float, int>> near;
      for (int k = 0; k < view.sift.rows; ++k) {
        if ((view.in_img[k] - photo.in_img[i]).squaredNorm() > reach * reach) continue;
        near.emplace_back(DescriptorDistance(of_photo, i, of_view, k), k);
      }
      if (near.empty()) continue;
      const auto best = *std::min_element(near.begin(), near.end());
      float other = std::numeric_limits<float>::infinity();
      for (const auto& [distance, k] : near) {
        if ((view.in_img[k] - view.in_img[best.second]).norm() > elsewhere) {
          other = std::min(other, distance);
        }
      }
      if (best.first <= max_ratio * other && std::isfinite(other))
        pairs.emplace_back(i, best.second);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

std::vector<std::pair<int, int>> MatchFeatures(const AppearanceFeatures& photos,
                                               const AppearanceFeatures& scan, double max_ratio) {
  std::vector<std::pair<int, int>> pairs;
  if (scan.places.empty() || photos.places.empty()) return {};
  AddMatches(photos.sift, scan.sift, scan.places, max_ratio, &pairs);
  AddMatches(FoldGradients(photos.sift), FoldGradients(scan.sift), scan.places, max_ratio, &pairs);
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace roomtex
