#pragma once
// COLMAP's camera models 0-10 (names, ids, parameter order and formulas as in COLMAP's
// camera_models.h, documented at colmap.github.io/cameras.html).

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace roomtex {

enum class CameraModel {
  kSimplePinhole = 0,        // f, cx, cy
  kPinhole = 1,              // fx, fy, cx, cy
  kSimpleRadial = 2,         // f, cx, cy, k
  kRadial = 3,               // f, cx, cy, k1, k2
  kOpenCv = 4,               // fx, fy, cx, cy, k1, k2, p1, p2
  kOpenCvFisheye = 5,        // fx, fy, cx, cy, k1, k2, k3, k4
  kFullOpenCv = 6,           // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
  kFov = 7,                  // fx, fy, cx, cy, omega
  kSimpleRadialFisheye = 8,  // f, cx, cy, k
  kRadialFisheye = 9,        // f, cx, cy, k1, k2
  kThinPrismFisheye = 10,    // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1
};
inline constexpr int kNumCameraModels = 11;
inline constexpr int kMaxCameraParams = 12;  // that any of them has

// Number of parameters; model ids outside 0..10 give -1.
int NumCameraParams(int model_id);
// "SIMPLE_RADIAL" and so on.
const char* CameraModelName(CameraModel model);
std::optional<CameraModel> CameraModelFromName(const std::string& name);

struct Camera {
  uint32_t camera_id = 0;
  CameraModel model = CameraModel::kPinhole;
  int width = 0;   // pixels
  int height = 0;  // pixels
  std::vector<double> params;
  bool has_prior_focal_length = false;  // known from the database only

  double MeanFocalLength() const;  // pixels
  // Everything that keeps this camera from being used: a wrong number of parameters, one that is
  // not finite, a focal length that is not positive ...
  std::vector<std::string> Problems() const;
};

// Projection and unprojection of one camera, with the limits of its distortion found once.
class CameraProjection {
 public:
  // camera must have no Problems().
  explicit CameraProjection(const Camera& camera);

  // Position in `img`, for a point in `cam`. None if the point is not in front (z <= 0) or lies
  // where the distortion polynomial no longer is one-to-one (it would fold back into the picture).
  // The result may lie outside the image: see InImage().
  std::optional<Eigen::Vector2d> ImgFromCam(const Eigen::Vector3d& x_in_cam) const;

  // (x/z, y/z) of the viewing ray in `cam` through a position in `img`; inverse of ImgFromCam.
  // None if no ray of the valid field reaches this position.
  std::optional<Eigen::Vector2d> CamFromImg(const Eigen::Vector2d& x_in_img) const;

  bool InImage(const Eigen::Vector2d& x_in_img) const {
    return x_in_img.x() >= 0 && x_in_img.y() >= 0 && x_in_img.x() <= camera_.width &&
           x_in_img.y() <= camera_.height;
  }
  const Camera& camera() const { return camera_; }
  // Largest sqrt((x/z)^2 + (y/z)^2) that ImgFromCam accepts; infinity for models that never fold.
  double max_radius() const { return max_radius_; }

 private:
  Camera camera_;
  double max_radius_;
};

}  // namespace roomtex
