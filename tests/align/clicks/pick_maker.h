#pragma once
// Points seen by one known camera, for the tests of poses.

#include <cmath>
#include <random>

#include "align/clicks/view_pose.h"

namespace roomtex {

inline Camera TestCamera(CameraModel model = CameraModel::kOpenCv) {
  Camera camera{1, model, 1936, 1288, {}};
  switch (model) {
    case CameraModel::kSimplePinhole:
      camera.params = {1500, 960, 650};
      break;
    case CameraModel::kPinhole:
      camera.params = {1500, 1490, 960, 650};
      break;
    case CameraModel::kSimpleRadial:
      camera.params = {1500, 960, 650, -0.08};
      break;
    case CameraModel::kRadial:
      camera.params = {1500, 960, 650, -0.08, 0.02};
      break;
    case CameraModel::kOpenCv:
      camera.params = {1500, 1490, 960, 650, -0.1, 0.03, 0.001, -0.0008};
      break;
    case CameraModel::kOpenCvFisheye:
      camera.params = {1500, 1490, 960, 650, -0.02, 0.01, 0.001, -0.0005};
      break;
    case CameraModel::kFullOpenCv:
      camera.params = {1500, 1490, 960, 650, -0.1, 0.03, 0.001, -0.0008, 0.002, 0.01, 0.002, 0.001};
      break;
    case CameraModel::kFov:
      camera.params = {1500, 1490, 960, 650, 0.6};
      break;
    case CameraModel::kSimpleRadialFisheye:
      camera.params = {1500, 960, 650, -0.03};
      break;
    case CameraModel::kRadialFisheye:
      camera.params = {1500, 960, 650, -0.03, 0.01};
      break;
    case CameraModel::kThinPrismFisheye:
      camera.params = {1500, 1490, 960, 650, -0.02, 0.01, 1e-3, -8e-4, 1e-3, -5e-4, 1e-3, 5e-4};
      break;
    case CameraModel::kRadTanThinPrismFisheye:
      camera.params = {1500, 1490,  960,  650,   -0.02, 0.01, 1e-3, -5e-4,
                       1e-4, -1e-4, 1e-3, -8e-4, 1e-3,  2e-4, 5e-4, -2e-4};
      break;
    case CameraModel::kSimpleDivision:
      camera.params = {1500, 960, 650, -0.08};
      break;
    case CameraModel::kDivision:
      camera.params = {1500, 1490, 960, 650, -0.08};
      break;
    case CameraModel::kSimpleFisheye:
      camera.params = {700, 960, 650};
      break;
    case CameraModel::kFisheye:
      camera.params = {500, 495, 960, 650};  // 220 degrees across
      break;
    case CameraModel::kEucm:
      camera.params = {600, 595, 960, 650, 0.62, 1.05};
      break;
    case CameraModel::kEquirectangular:
      camera.params = {1936, 1288};
      break;
  }
  return camera;
}

class PickMaker {
 public:
  explicit PickMaker(unsigned seed, CameraModel model = CameraModel::kOpenCv)
      : projection(TestCamera(model)), random_(seed) {
    // Somewhere in a room, looking anywhere.
    cam_from_scan.rotation =
        Eigen::Quaterniond(Gaussian(), Gaussian(), Gaussian(), Gaussian()).normalized();
    cam_from_scan.translation = {Uniform(-2, 2), Uniform(-2, 2), Uniform(-2, 2)};
  }

  double Gaussian() { return std::normal_distribution<double>()(random_); }
  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  // All over the photo, 1.5 to 5 m deep.
  PointPairs General(int count) {
    return Make(count, [&](const Eigen::Vector3d&) { return Uniform(1.5, 5); });
  }

  // On a plane through the point 3 m ahead; tilt: angle of its normal from the optical axis,
  // radians.
  PointPairs Coplanar(int count, double tilt) {
    const Eigen::Vector3d normal(std::sin(tilt), 0, std::cos(tilt));
    return Make(count,
                [&](const Eigen::Vector3d& ray) { return 3 * normal.z() / normal.dot(ray); });
  }

  PointPairs WithNoise(PointPairs pairs, double sigma_px) {
    for (int i = 0; i < pairs.size(); ++i) {
      pairs.x_in_img.col(i) += sigma_px * Eigen::Vector2d(Gaussian(), Gaussian());
    }
    return pairs;
  }

  CameraProjection projection;
  Rigid cam_from_scan;

 private:
  template <typename Depth>
  PointPairs Make(int count, const Depth& depth) {
    PointPairs pairs{Eigen::Matrix2Xd(2, count), Eigen::Matrix3Xd(3, count)};
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector2d x_in_img(Uniform(30, 1900), Uniform(30, 1250));
      const Eigen::Vector3d ray = projection.RayFromImg(x_in_img).value();
      const double distance = depth(ray);
      if (!(distance > 0 && distance < 15) && !projection.camera().IsPerspective()) {
        --i;  // looks away from the plane
        continue;
      }
      pairs.x_in_img.col(i) = x_in_img;
      pairs.x_in_scan.col(i) = cam_from_scan.Inverse() * Eigen::Vector3d(distance * ray);
    }
    return pairs;
  }

  std::mt19937 random_;
};

}  // namespace roomtex
