#pragma once
// Keypoints and matches of a made-up scene with known truth, without images: what is left of a
// COLMAP database when everything but geometry is taken away.

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "colmap_ext/matched_images.h"
#include "core/camera_model.h"
#include "core/frames.h"

namespace roomtex {

struct SimulatedViewsOptions {
  enum class Scene {
    kRoom,    // points in a volume
    kWall,    // on a plane
    kRelief,  // on a plane + relief
    kCorner   // on two walls that meet at 90 degrees
  };
  Scene scene = Scene::kRoom;
  double relief = 0.05;  // kRelief: depth of the relief over the distance
  double period = 0;     // metres; above 0 the wall repeats along x, see next_in_period
  int num_points = 400;
  int num_views = 2;
  double field_of_view_deg = 58;
  double baseline = 0.5;   // metres between neighbouring views, at 3 m from the wall
  bool only_turn = false;  // pure rotation instead
  double noise_px = 0.5;
  double outlier_share = 0.1;  // matches that join wrong keypoints
  bool distortion = false;
  bool two_cameras = false;  // odd views have a camera of their own
  int random_seed = 0;
};

struct SimulatedViews {
  std::map<uint32_t, Camera> cameras;
  std::map<uint32_t, DatabaseImage> images;  // ids from 1 on
  std::map<uint32_t, std::vector<Eigen::Vector2d>> keypoints;
  std::map<uint32_t, std::vector<int>> point_of_keypoint;
  std::vector<DatabasePair> pairs;
  std::map<uint32_t, Rigid> cam_from_scene;  // truth
  std::vector<Eigen::Vector3d> points_in_scene;
  // With a period: the point that looks like this one, one period to the right; -1 = none.
  std::vector<int> next_in_period;

  MatchedImages Matched() const {
    return MatchedImages(cameras, images, pairs,
                         [this](uint32_t image_id) { return keypoints.at(image_id); });
  }
  Rigid TrueRelativePose(uint32_t left, uint32_t right) const {
    return cam_from_scene.at(right) * cam_from_scene.at(left).Inverse();
  }
};

inline Camera SimulatedCamera(uint32_t camera_id, const SimulatedViewsOptions& options) {
  Camera camera;
  camera.camera_id = camera_id;
  camera.width = camera_id == 2 ? 1200 : 1000;
  camera.height = camera_id == 2 ? 900 : 750;
  camera.model = options.distortion ? CameraModel::kOpenCv : CameraModel::kPinhole;
  const double fov = options.field_of_view_deg * (camera_id == 2 ? 1.15 : 1.0);
  const double f = 0.5 * camera.width / std::tan(0.5 * RadFromDeg(fov));
  camera.params = {f, f, 0.5 * camera.width + 7, 0.5 * camera.height - 4};
  if (options.distortion) camera.params.insert(camera.params.end(), {-0.12, 0.03, 0.001, -0.0007});
  camera.has_prior_focal_length = true;
  return camera;
}

// The points of the leftmost period, copied to the right as often as the scene is wide.
inline void RepeatAlongX(double period, SimulatedViews* views) {
  std::vector<Eigen::Vector3d>& points = views->points_in_scene;
  double low = points[0].x(), high = low;
  for (const Eigen::Vector3d& x : points) {
    low = std::min(low, x.x());
    high = std::max(high, x.x());
  }
  const int num_copies = std::max(1, static_cast<int>((high - low) / period));
  const size_t num_base = points.size() / num_copies;
  std::vector<Eigen::Vector3d> repeated;
  for (size_t i = 0; i < num_base; ++i) {
    const double offset = std::fmod(points[i].x() - low, period);
    for (int k = 0; k < num_copies; ++k) {
      views->next_in_period.push_back(k + 1 < num_copies ? static_cast<int>(repeated.size()) + 1
                                                         : -1);
      repeated.emplace_back(low + offset + k * period, points[i].y(), points[i].z());
    }
  }
  points = repeated;
}

inline SimulatedViews SimulateViews(const SimulatedViewsOptions& options) {
  using Scene = SimulatedViewsOptions::Scene;
  std::mt19937_64 random(options.random_seed * 7919 + 17);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto normal = [&](double sigma) {
    return sigma * std::normal_distribution<double>()(random);
  };
  SimulatedViews views;
  const double distance = 3;
  const double half = distance * std::tan(0.5 * RadFromDeg(options.field_of_view_deg));
  for (int i = 0; i < options.num_points; ++i) {
    Eigen::Vector3d x(uniform(-1.3, 1.3) * half + uniform(0, 1) * options.baseline,
                      uniform(-1, 1) * half, 0);
    if (options.scene == Scene::kRoom) x.z() = uniform(-1.3, 1.3);
    if (options.scene == Scene::kRelief) x.z() = uniform(-0.5, 0.5) * options.relief * distance;
    if (options.scene == Scene::kCorner) x.z() = 0.65 * half - std::abs(x.x());
    views.points_in_scene.push_back(x);
  }
  if (options.period > 0) RepeatAlongX(options.period, &views);
  views.cameras[1] = SimulatedCamera(1, options);
  if (options.two_cameras) views.cameras[2] = SimulatedCamera(2, options);
  for (int k = 0; k < options.num_views; ++k) {
    const uint32_t image_id = k + 1;
    const uint32_t camera_id = options.two_cameras && k % 2 == 1 ? 2 : 1;
    char name[32];
    std::snprintf(name, sizeof(name), "view_%03d.jpg", k);
    views.images[image_id] = {image_id, camera_id, name};
    // In a row before the wall, at different heights and distances, looking at it askew.
    Eigen::Vector3d centre(options.baseline * (k - 0.5 * (options.num_views - 1)),
                           uniform(-0.3, 0.3) * options.baseline,
                           -distance + uniform(-0.5, 0.5) * options.baseline);
    if (options.only_turn) centre = {0, 0, -distance};
    const Eigen::Vector3d target(0.5 * centre.x() + uniform(-0.25, 0.25), uniform(-0.25, 0.25), 0);
    const Eigen::Vector3d z = (target - centre).normalized();
    const Eigen::Vector3d x = Eigen::Vector3d(0, 1, 0).cross(z).normalized();
    Eigen::Matrix3d rotation;
    rotation << x.transpose(), z.cross(x).transpose(), z.transpose();
    rotation = Eigen::AngleAxisd(normal(0.05), Eigen::Vector3d::UnitZ()) * rotation;
    views.cam_from_scene[image_id] = {Eigen::Quaterniond(rotation), -rotation * centre};
    const CameraProjection projection(views.cameras.at(camera_id));
    for (int p = 0; p < static_cast<int>(views.points_in_scene.size()); ++p) {
      const auto x_in_img =
          projection.ImgFromCam(views.cam_from_scene[image_id] * views.points_in_scene[p]);
      if (!x_in_img || !projection.InImage(*x_in_img)) continue;
      views.keypoints[image_id].push_back(
          *x_in_img + Eigen::Vector2d(normal(options.noise_px), normal(options.noise_px)));
      views.point_of_keypoint[image_id].push_back(p);
    }
  }
  for (uint32_t a = 1; a <= views.images.size(); ++a) {
    for (uint32_t b = a + 1; b <= views.images.size(); ++b) {
      std::map<int, int> row_in_b;
      for (size_t row = 0; row < views.point_of_keypoint[b].size(); ++row) {
        row_in_b[views.point_of_keypoint[b][row]] = static_cast<int>(row);
      }
      DatabasePair pair{a, b, 2, {}};
      std::vector<size_t> wrong;
      for (size_t row = 0; row < views.point_of_keypoint[a].size(); ++row) {
        const auto found = row_in_b.find(views.point_of_keypoint[a][row]);
        if (found == row_in_b.end()) continue;
        if (uniform(0, 1) < options.outlier_share) wrong.push_back(pair.matches.size());
        pair.matches.emplace_back(static_cast<int>(row), found->second);
      }
      // Outliers: matches that swap their partners in a ring.
      for (size_t i = 0; i + 1 < wrong.size(); ++i) {
        std::swap(pair.matches[wrong[i]].y(), pair.matches[wrong[i + 1]].y());
      }
      if (!pair.matches.empty()) views.pairs.push_back(std::move(pair));
    }
  }
  return views;
}

// Angle between the directions of two translations, radians.
inline double BaselineAngle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace roomtex
