#include "align/search/search_cloud.h"

#include <map>

namespace roomtex {
namespace {

constexpr size_t kEnoughPoints = 300;
constexpr int kSightsPerPoint = 2;

// Points that three photos see; of a model that has few of them, those of two as well.
std::vector<SurfacePoint> PointsOf(const SparseModel& model, double sigma_px, size_t max_points) {
  std::vector<SurfacePoint> points = FindSurfacePoints(model, 3, sigma_px, max_points);
  if (points.size() >= kEnoughPoints) return points;
  return FindSurfacePoints(model, 2, sigma_px, max_points);
}

}  // namespace

SearchCloud MakeSearchCloud(const SparseModel& model, double sigma_px, size_t max_points) {
  SearchCloud cloud;
  cloud.points = PointsOf(model, sigma_px, max_points);
  std::map<uint32_t, int> photos;
  for (const auto& [id, image] : model.images) {
    photos[id] = static_cast<int>(cloud.centres.size());
    cloud.centres.push_back(image.cam_from_model.TargetOriginInSource());
    const Eigen::Matrix3d rotation = image.cam_from_model.rotation.toRotationMatrix();
    cloud.right.emplace_back(rotation.row(0));
    cloud.down.emplace_back(rotation.row(1));
  }
  for (size_t i = 0; i < cloud.points.size(); ++i) {
    const auto& track = model.points.at(cloud.points[i].point3d_id).track;
    for (size_t k = 0; k < kSightsPerPoint; ++k) {
      // Of two points side by side, not the same photos.
      const size_t at = (i + k * track.size() / kSightsPerPoint) % track.size();
      cloud.sights.push_back({photos.at(track[at].image_id), static_cast<int>(i)});
    }
  }
  return cloud;
}

SearchCloud Mirrored(SearchCloud cloud) {
  const Eigen::Vector3d flip(-1, 1, 1);
  for (SurfacePoint& point : cloud.points) {
    point.x_in_sparse = flip.cwiseProduct(point.x_in_sparse);
    point.to_cameras = flip.cwiseProduct(point.to_cameras);
    point.covariance = flip.asDiagonal() * point.covariance * flip.asDiagonal();
  }
  for (auto* vectors : {&cloud.centres, &cloud.right, &cloud.down}) {
    for (Eigen::Vector3d& x : *vectors) x = flip.cwiseProduct(x);
  }
  cloud.is_mirrored = !cloud.is_mirrored;
  return cloud;
}

SearchCloud Thinned(const SearchCloud& cloud, size_t max_points) {
  if (cloud.points.size() <= max_points) return cloud;
  const int stride = static_cast<int>((cloud.points.size() + max_points - 1) / max_points);
  SearchCloud thin = cloud;
  thin.points.clear();
  thin.sights.clear();
  for (size_t i = 0; i < cloud.points.size(); i += stride) thin.points.push_back(cloud.points[i]);
  for (const SearchCloud::Sight& sight : cloud.sights) {
    if (sight.point % stride == 0) thin.sights.push_back({sight.photo, sight.point / stride});
  }
  return thin;
}

}  // namespace roomtex
