#pragma once
// A room without a single plane: the inside of an ellipsoid, with semi-axes of 2.5, 2.0 and 1.5 m.

#include <random>

#include "align/clicks/picks.h"
#include "colmap_ext/sparse_model.h"
#include "core/frames.h"
#include "core/scan.h"

namespace roomtex {

class CurvedRoom {
 public:
  CurvedRoom() : random_(5) {
    MakeScan();
    MakeModel();
  }

  Scan scan;                // 2 mm of noise along the ray
  SparseModel model;        // scan frame, true poses and points; keypoints with 0.7 pixels of noise
  std::vector<Pick> picks;  // six in the first photo, 1.5 pixels of noise

  Rigid TruePose(uint32_t image_id) const { return poses_.at(image_id); }

 private:
  double Gaussian() { return std::normal_distribution<double>()(random_); }
  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  // Distance from `origin` along the unit `direction`.
  static double Hit(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
    const Eigen::Vector3d axes(2.5, 2.0, 1.5);
    const Eigen::Vector3d o = origin.cwiseQuotient(axes), d = direction.cwiseQuotient(axes);
    const double a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm() - 1;
    return (-b + std::sqrt(b * b - a * c)) / a;
  }

  void MakeScan() {
    const Eigen::Vector3d station(0.2, -0.1, 0.1);
    scan.path = "curved.ptx";
    scan.num_columns = 800;
    scan.num_rows = 400;
    scan.up = Eigen::Vector3d::UnitZ();
    scan.scan_from_station.translation = station;
    for (int row = 0; row < scan.num_rows; ++row) {
      const double elevation = RadFromDeg(75 - 150 * (row + 0.5) / scan.num_rows);
      for (int column = 0; column < scan.num_columns; ++column) {
        const double azimuth = 2 * kPi * column / scan.num_columns;
        const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                        std::cos(elevation) * std::sin(azimuth),
                                        std::sin(elevation));
        scan.points.push_back(station + (Hit(station, direction) + 0.002 * Gaussian()) * direction);
      }
    }
    scan.intensity.assign(scan.points.size(), 1);
  }

  void MakeModel() {
    model.cameras[1] = {1, CameraModel::kSimpleRadial, 1936, 1288, {1500, 968, 644, -0.05}};
    const CameraProjection projection(model.cameras[1]);
    for (uint32_t id = 1; id <= 16; ++id) {
      // On a circle, looking across the middle.
      const double angle = 2 * kPi * id / 16;
      const Eigen::Vector3d centre(0.9 * std::cos(angle), 0.7 * std::sin(angle),
                                   Uniform(-0.3, 0.3));
      const Eigen::Vector3d ahead =
          (Eigen::Vector3d(0, 0, Uniform(-0.5, 0.5)) - centre).normalized();
      const Eigen::Vector3d right = ahead.cross(Eigen::Vector3d::UnitZ()).normalized();
      Eigen::Matrix3d rotation;
      rotation << right.transpose(), ahead.cross(right).transpose(), ahead.transpose();
      SparseImage& image = model.images[id];
      image.image_id = id;
      image.camera_id = 1;
      image.name = "photo_" + std::to_string(id) + ".jpg";
      image.cam_from_model.rotation = Eigen::Quaterniond(rotation).normalized();
      image.cam_from_model.translation = -(image.cam_from_model.rotation * centre);
      poses_[id] = image.cam_from_model;
    }
    while (model.points.size() < 4000) AddPoint(projection);
    for (int i = 0; i < 6; ++i) AddPick(projection, i);
  }

  void AddPoint(const CameraProjection& projection) {
    const Eigen::Vector3d direction =
        Eigen::Vector3d(Gaussian(), Gaussian(), 0.7 * Gaussian()).normalized();
    const Eigen::Vector3d x_in_scan = Hit(Eigen::Vector3d::Zero(), direction) * direction;
    std::vector<std::pair<uint32_t, Eigen::Vector2d>> seen;
    for (const auto& [id, pose] : poses_) {
      const auto x = projection.ImgFromCam(pose * x_in_scan);
      if (x && projection.InImage(*x)) seen.push_back({id, *x});
    }
    if (seen.size() < 3) return;
    const uint64_t point_id = model.points.size() + 1;
    SparsePoint& point = model.points[point_id];
    point.x_in_model = x_in_scan;
    for (const auto& [id, x] : seen) {
      SparseImage& image = model.images.at(id);
      point.track.push_back({id, static_cast<uint32_t>(image.points2d.size())});
      image.points2d.push_back(x + 0.7 * Eigen::Vector2d(Gaussian(), Gaussian()));
      image.point3d_ids.push_back(point_id);
    }
  }

  void AddPick(const CameraProjection& projection, int i) {
    const Eigen::Vector2d x(250 + 700 * (i % 3), 250 + 800 * (i / 3));
    const Rigid scan_from_cam = poses_.at(1).Inverse();
    const Eigen::Vector3d direction =
        scan_from_cam.rotation * projection.CamFromImg(x).value().homogeneous().normalized();
    const Eigen::Vector3d& eye = scan_from_cam.translation;
    picks.push_back({"photo_1.jpg", x + 1.5 * Eigen::Vector2d(Gaussian(), Gaussian()),
                     eye + Hit(eye, direction) * direction});
  }

  std::mt19937 random_;
  std::map<uint32_t, Rigid> poses_;
};

}  // namespace roomtex
