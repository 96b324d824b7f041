#include "core/camera_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/camera_formulas.h"
#include "core/frames.h"

namespace roomtex {
namespace {

struct ModelEntry {
  const char* name;
  int num_params;
};
constexpr std::array<ModelEntry, kNumCameraModels> kModels = {{{"SIMPLE_PINHOLE", 3},
                                                               {"PINHOLE", 4},
                                                               {"SIMPLE_RADIAL", 4},
                                                               {"RADIAL", 5},
                                                               {"OPENCV", 8},
                                                               {"OPENCV_FISHEYE", 8},
                                                               {"FULL_OPENCV", 12},
                                                               {"FOV", 5},
                                                               {"SIMPLE_RADIAL_FISHEYE", 4},
                                                               {"RADIAL_FISHEYE", 5},
                                                               {"THIN_PRISM_FISHEYE", 12}}};

const double* DistortionParams(const Camera& camera) {
  return camera.params.data() + camera_formulas::NumLinearParams(camera.model);
}

Eigen::Vector2d DistortPoint(const Camera& camera, const Eigen::Vector2d& x) {
  Eigen::Vector2d xd;
  camera_formulas::Distort(camera.model, DistortionParams(camera), x.x(), x.y(), &xd.x(), &xd.y());
  return xd;
}

// Jacobian of the distortion by central differences.
Eigen::Matrix2d DistortionJacobian(const Camera& camera, const Eigen::Vector2d& x) {
  const double step = 1e-6 * std::max(1.0, x.norm());
  Eigen::Matrix2d jacobian;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector2d offset = step * Eigen::Vector2d::Unit(i);
    jacobian.col(i) =
        (DistortPoint(camera, x + offset) - DistortPoint(camera, x - offset)) / (2 * step);
  }
  return jacobian;
}

bool IsDistorted(CameraModel model) {
  return model != CameraModel::kSimplePinhole && model != CameraModel::kPinhole;
}

// The radius up to which the distortion is one-to-one: along each of 16 directions the first one
// where its Jacobian is no longer positive definite enough to be inverted; the smallest over the
// directions. Steps are equal in angle, up to 89.5 degrees off the optical axis.
double MaxRadius(const Camera& camera) {
  if (!IsDistorted(camera.model)) return std::numeric_limits<double>::infinity();
  constexpr int kNumDirections = 16, kNumSteps = 900;
  const double max_angle = RadFromDeg(89.5);
  int last_valid = kNumSteps;
  for (int d = 0; d < kNumDirections; ++d) {
    const double direction = 2 * kPi * d / kNumDirections;
    const Eigen::Vector2d unit(std::cos(direction), std::sin(direction));
    for (int step = 1; step <= last_valid; ++step) {
      const double radius = std::tan(max_angle * step / kNumSteps);
      const Eigen::Matrix2d jacobian = DistortionJacobian(camera, radius * unit);
      const double radial_gain = unit.dot(jacobian * unit) * (1 + radius * radius);
      if (!(jacobian.determinant() > 0) || !(radial_gain > 0.02)) {
        last_valid = step - 1;
        break;
      }
    }
  }
  return std::tan(max_angle * last_valid / kNumSteps);
}

}  // namespace

int NumCameraParams(int model_id) {
  if (model_id < 0 || model_id >= kNumCameraModels) return -1;
  return kModels[model_id].num_params;
}

const char* CameraModelName(CameraModel model) { return kModels[static_cast<int>(model)].name; }

std::optional<CameraModel> CameraModelFromName(const std::string& name) {
  for (int i = 0; i < kNumCameraModels; ++i) {
    if (name == kModels[i].name) return static_cast<CameraModel>(i);
  }
  return std::nullopt;
}

double Camera::MeanFocalLength() const {
  return camera_formulas::HasOneFocalLength(model) ? params[0] : 0.5 * (params[0] + params[1]);
}

std::vector<std::string> Camera::Problems() const {
  const std::string who = "camera " + std::to_string(camera_id);
  std::vector<std::string> problems;
  const int expected = NumCameraParams(static_cast<int>(model));
  if (expected < 0) {
    return {who + " has model id " + std::to_string(static_cast<int>(model)) +
            ", expected 0 to 10"};
  }
  if (static_cast<int>(params.size()) != expected) {
    return {who + " (" + CameraModelName(model) + ") has " + std::to_string(params.size()) +
            " parameters, expected " + std::to_string(expected)};
  }
  if (width <= 0 || height <= 0) {
    problems.push_back(who + " has the image size " + std::to_string(width) + " x " +
                       std::to_string(height));
  }
  if (!std::all_of(params.begin(), params.end(), [](double p) { return std::isfinite(p); })) {
    problems.push_back(who + " has a parameter that is not a finite number");
  }
  const bool one_focal_length = camera_formulas::HasOneFocalLength(model);
  if (!(params[0] > 0) || (!one_focal_length && !(params[1] > 0))) {
    problems.push_back(who + " has a focal length that is not positive");
  }
  return problems;
}

CameraProjection::CameraProjection(const Camera& camera)
    : camera_(camera), max_radius_(MaxRadius(camera)) {}

std::optional<Eigen::Vector2d> CameraProjection::ImgFromCam(const Eigen::Vector3d& x_in_cam) const {
  if (!(x_in_cam.z() > 1e-12) || !x_in_cam.allFinite()) return std::nullopt;
  const double x = x_in_cam.x() / x_in_cam.z();
  const double y = x_in_cam.y() / x_in_cam.z();
  if (x * x + y * y > max_radius_ * max_radius_) return std::nullopt;
  Eigen::Vector2d x_in_img;
  camera_formulas::Project(camera_.model, camera_.params.data(), x, y, &x_in_img.x(),
                           &x_in_img.y());
  return x_in_img;
}

std::optional<Eigen::Vector2d> CameraProjection::CamFromImg(const Eigen::Vector2d& x_in_img) const {
  if (!x_in_img.allFinite()) return std::nullopt;
  const std::vector<double>& p = camera_.params;
  const Eigen::Vector2d target =
      camera_formulas::HasOneFocalLength(camera_.model)
          ? Eigen::Vector2d((x_in_img.x() - p[1]) / p[0], (x_in_img.y() - p[2]) / p[0])
          : Eigen::Vector2d((x_in_img.x() - p[2]) / p[0], (x_in_img.y() - p[3]) / p[1]);
  if (!IsDistorted(camera_.model)) return target;

  // Newton with steps halved while they do not help: the distortion is one-to-one within
  // max_radius_.
  Eigen::Vector2d x = target;
  if (x.norm() > max_radius_) x *= 0.99 * max_radius_ / x.norm();
  Eigen::Vector2d error = DistortPoint(camera_, x) - target;
  for (int iteration = 0; iteration < 60 && error.norm() > 1e-13; ++iteration) {
    const Eigen::Vector2d step = DistortionJacobian(camera_, x).partialPivLu().solve(error);
    double fraction = 1.0;
    bool better = false;
    for (int halving = 0; halving < 12; ++halving, fraction *= 0.5) {
      const Eigen::Vector2d candidate = x - fraction * step;
      if (!(candidate.norm() <= max_radius_)) continue;
      const Eigen::Vector2d candidate_error = DistortPoint(camera_, candidate) - target;
      if (candidate_error.norm() < error.norm()) {
        x = candidate;
        error = candidate_error;
        better = true;
        break;
      }
    }
    if (!better) break;
  }
  if (!(error.norm() < 1e-9)) return std::nullopt;
  return x;
}

}  // namespace roomtex
