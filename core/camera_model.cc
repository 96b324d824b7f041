#include "core/camera_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/camera_formulas.h"
#include "core/frames.h"
#include "core/text.h"

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
                                                               {"THIN_PRISM_FISHEYE", 12},
                                                               {"RAD_TAN_THIN_PRISM_FISHEYE", 16},
                                                               {"SIMPLE_DIVISION", 4},
                                                               {"DIVISION", 5},
                                                               {"SIMPLE_FISHEYE", 3},
                                                               {"FISHEYE", 4},
                                                               {"EUCM", 6},
                                                               {"EQUIRECTANGULAR", 2}}};

const double* DistortionParams(const Camera& camera) {
  return camera.params.data() + camera_formulas::NumLinearParams(camera.model);
}

// The ray of a position in the equidistant plane: as far from (0, 0) as its angle from the optical
// axis.
Eigen::Vector3d RayFromAngles(const Eigen::Vector2d& angles) {
  const double angle = angles.norm();
  const double sine_over_angle = angle > 1e-9 ? std::sin(angle) / angle : 1.0;
  return {angles.x() * sine_over_angle, angles.y() * sine_over_angle, std::cos(angle)};
}

// From the plane where a model's field is searched and inverted, which is (x/z, y/z) for a
// perspective camera and the equidistant one for the others, to distorted coordinates.
Eigen::Vector2d DistortPoint(const Camera& camera, const Eigen::Vector2d& x) {
  const double* const k = DistortionParams(camera);
  Eigen::Vector2d flat = x, xd;
  if (camera_formulas::FlatteningOf(camera.model) == camera_formulas::Flattening::kDivision ||
      camera_formulas::FlatteningOf(camera.model) == camera_formulas::Flattening::kUnified) {
    const Eigen::Vector3d ray = RayFromAngles(x);
    camera_formulas::Flatten(camera.model, k, ray.x(), ray.y(), ray.z(), &flat.x(), &flat.y());
  }
  camera_formulas::Distort(camera.model, k, flat.x(), flat.y(), &xd.x(), &xd.y());
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

// The steps of angle and the directions in which the distortion is looked at.
constexpr int kNumDirections = 16;
int NumSteps(const Camera& camera) { return camera.IsPerspective() ? 900 : 1800; }
double AngleOfStep(const Camera& camera, int step) {
  return RadFromDeg(camera.IsPerspective() ? 89.5 : 179) * step / NumSteps(camera);
}

// Whether the Jacobian of the distortion is positive definite enough to be inverted there.
bool IsOneToOne(const Camera& camera, int direction, int step) {
  const double turn = 2 * kPi * direction / kNumDirections;
  const Eigen::Vector2d unit(std::cos(turn), std::sin(turn));
  const double angle = AngleOfStep(camera, step);
  const double radius = camera.IsPerspective() ? std::tan(angle) : angle;
  const double by_angle = camera.IsPerspective() ? 1 + radius * radius : 1;
  const Eigen::Matrix2d jacobian = DistortionJacobian(camera, radius * unit);
  const double radial_gain = unit.dot(jacobian * unit) * by_angle;
  // Beyond a pole of the formula (EUCM) positions come back from the other side.
  const bool outward = unit.dot(DistortPoint(camera, radius * unit)) > 0;
  return jacobian.determinant() > 0 && radial_gain > 0.02 && outward;
}

bool FoldsInTheMiddle(const Camera& camera) {
  if (camera.IsPanorama() || !IsDistorted(camera.model)) return false;
  for (int direction = 0; direction < kNumDirections; ++direction) {
    if (!IsOneToOne(camera, direction, 1)) return true;
  }
  return false;
}

// The angle from the optical axis up to which the distortion is one-to-one, the smallest over the
// directions: of a perspective camera up to 89.5 degrees, else up to 179.
double MaxAngle(const Camera& camera) {
  int last_valid = NumSteps(camera);
  for (int direction = 0; direction < kNumDirections; ++direction) {
    for (int step = 1; step <= last_valid; ++step) {
      if (!IsOneToOne(camera, direction, step)) last_valid = step - 1;
    }
  }
  return AngleOfStep(camera, last_valid);
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

bool Camera::IsPerspective() const { return camera_formulas::IsPerspective(model); }

double Camera::MeanFocalLength() const {
  if (IsPanorama()) return params[0] / (2 * kPi);
  return camera_formulas::HasOneFocalLength(model) ? params[0] : 0.5 * (params[0] + params[1]);
}

void Camera::Resize(int new_width, int new_height) {
  const double scale_x = static_cast<double>(new_width) / width;
  const double scale_y = static_cast<double>(new_height) / height;
  if (IsPanorama()) {
    params = {params[0] * scale_x, params[1] * scale_y};
  } else if (camera_formulas::HasOneFocalLength(model)) {
    params[0] *= 0.5 * (scale_x + scale_y);
    params[1] *= scale_x;
    params[2] *= scale_y;
  } else {
    params[0] *= scale_x;
    params[1] *= scale_y;
    params[2] *= scale_x;
    params[3] *= scale_y;
  }
  width = new_width;
  height = new_height;
}

// Shares of the longer side of the image. The narrowest lens there is sees about 0.1 degrees; work
// grows with what lies beyond.
constexpr double kMinFocalShare = 0.001, kMaxFocalShare = 1000, kMaxPrincipalShare = 100;

std::vector<std::string> Camera::Problems() const {
  const std::string who = "camera " + std::to_string(camera_id);
  std::vector<std::string> problems;
  const int expected = NumCameraParams(static_cast<int>(model));
  if (expected < 0) {
    return {who + " has model id " + std::to_string(static_cast<int>(model)) + ", expected 0 to " +
            std::to_string(kNumCameraModels - 1)};
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
    problems.push_back(who + (IsPanorama() ? " has a width or height that is not positive"
                                           : " has a focal length that is not positive"));
  }
  if (problems.empty() && !IsPanorama()) {
    const double side = std::max(width, height);
    const auto is_sound = [side](double f) {
      return f >= kMinFocalShare * side && f <= kMaxFocalShare * side;
    };
    if (!is_sound(params[0]) || (!one_focal_length && !is_sound(params[1]))) {
      problems.push_back(who + " has a focal length of " + Significant(params[0], 3) +
                         " pixels, expected 0.001 to 1000 times the longer side of the image");
    }
    const size_t centre = one_focal_length ? 1 : 2;
    if (std::max(std::abs(params[centre]), std::abs(params[centre + 1])) >
        kMaxPrincipalShare * side) {
      problems.push_back(who + " has its principal point at " + Significant(params[centre], 3) +
                         ", " + Significant(params[centre + 1], 3) +
                         ", expected within 100 times the longer side of the image");
    }
  }
  if (model == CameraModel::kEucm && !(params[4] >= 0 && params[4] <= 1 && params[5] > 0)) {
    problems.push_back(who + " (EUCM) has alpha " + std::to_string(params[4]) + " and beta " +
                       std::to_string(params[5]) + ", expected 0 <= alpha <= 1 and beta > 0");
  }
  if (problems.empty() && FoldsInTheMiddle(*this)) {
    problems.push_back(who + " (" + CameraModelName(model) +
                       ") has distortion parameters that fold the picture over in its middle, "
                       "expected those of a lens");
  }
  return problems;
}

CameraProjection::CameraProjection(const Camera& camera)
    : camera_(camera),
      is_perspective_(camera.IsPerspective()),
      max_radius_(std::numeric_limits<double>::infinity()),
      max_angle_(kPi) {
  if (camera.IsPanorama() || !IsDistorted(camera.model)) {
    if (is_perspective_) max_angle_ = kPi / 2;
    return;
  }
  max_angle_ = MaxAngle(camera);
  if (max_angle_ < kPi / 2) max_radius_ = std::tan(max_angle_);
}

std::optional<Eigen::Vector2d> CameraProjection::ImgFromCam(const Eigen::Vector3d& x_in_cam) const {
  if (!x_in_cam.allFinite()) return std::nullopt;
  Eigen::Vector2d x_in_img;
  const double* const params = camera_.params.data();
  if (is_perspective_) {
    if (!(x_in_cam.z() > 1e-12)) return std::nullopt;
    const double x = x_in_cam.x() / x_in_cam.z();
    const double y = x_in_cam.y() / x_in_cam.z();
    if (x * x + y * y > max_radius_ * max_radius_) return std::nullopt;
    camera_formulas::Project(camera_.model, params, x, y, &x_in_img.x(), &x_in_img.y());
    return x_in_img;
  }
  const double distance = x_in_cam.norm();
  if (!(distance > 1e-12)) return std::nullopt;
  const Eigen::Vector3d ray = x_in_cam / distance;
  if (!(std::atan2(ray.head<2>().norm(), ray.z()) <= max_angle_)) return std::nullopt;
  camera_formulas::Project(camera_.model, params, ray.x(), ray.y(), ray.z(), &x_in_img.x(),
                           &x_in_img.y());
  return x_in_img;
}

std::optional<Eigen::Vector2d> CameraProjection::ImgError(const Eigen::Vector3d& x_in_cam,
                                                          const Eigen::Vector2d& x_in_img) const {
  const auto seen = ImgFromCam(x_in_cam);
  if (!seen || !camera_.IsPanorama()) {
    return seen ? std::optional<Eigen::Vector2d>(*seen - x_in_img) : std::nullopt;
  }
  Eigen::Vector2d error;
  camera_formulas::ImgError(camera_.model, camera_.params.data(), x_in_cam.x(), x_in_cam.y(),
                            x_in_cam.z(), x_in_img, &error.x(), &error.y());
  return error;
}

std::optional<Eigen::Vector3d> CameraProjection::RayFromImg(const Eigen::Vector2d& x_in_img) const {
  if (!x_in_img.allFinite()) return std::nullopt;
  const std::vector<double>& p = camera_.params;
  if (camera_.IsPanorama()) {
    if (!(x_in_img.y() >= 0 && x_in_img.y() <= p[1])) return std::nullopt;
    return Eigen::Vector3d(camera_formulas::PanoramaFrame(p[0], p[1], x_in_img).row(2));
  }
  const Eigen::Vector2d distorted =
      camera_formulas::HasOneFocalLength(camera_.model)
          ? Eigen::Vector2d((x_in_img.x() - p[1]) / p[0], (x_in_img.y() - p[2]) / p[0])
          : Eigen::Vector2d((x_in_img.x() - p[2]) / p[0], (x_in_img.y() - p[3]) / p[1]);
  if (!IsDistorted(camera_.model)) return distorted.homogeneous();
  const auto x = Undistort(distorted, is_perspective_ ? max_radius_ : max_angle_);
  if (!x) return std::nullopt;
  return is_perspective_ ? Eigen::Vector3d(x->homogeneous()) : RayFromAngles(*x);
}

std::optional<Eigen::Vector2d> CameraProjection::CamFromImg(const Eigen::Vector2d& x_in_img) const {
  const auto ray = RayFromImg(x_in_img);
  if (!ray || !(ray->z() > 1e-6)) return std::nullopt;
  return ray->hnormalized();
}

// Newton with steps halved while they do not help: the distortion is one-to-one within the limit.
std::optional<Eigen::Vector2d> CameraProjection::Undistort(const Eigen::Vector2d& distorted,
                                                           double limit) const {
  Eigen::Vector2d x = distorted;
  if (x.norm() > limit) x *= 0.99 * limit / x.norm();
  Eigen::Vector2d error = DistortPoint(camera_, x) - distorted;
  for (int iteration = 0; iteration < 60 && error.norm() > 1e-13; ++iteration) {
    const Eigen::Vector2d step = DistortionJacobian(camera_, x).partialPivLu().solve(error);
    double fraction = 1.0;
    bool better = false;
    for (int halving = 0; halving < 12; ++halving, fraction *= 0.5) {
      const Eigen::Vector2d candidate = x - fraction * step;
      if (!(candidate.norm() <= limit)) continue;
      const Eigen::Vector2d candidate_error = DistortPoint(camera_, candidate) - distorted;
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
