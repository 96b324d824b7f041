#pragma once
// COLMAP's camera models 0-17 (names, ids, parameter order and formulas as in COLMAP 4.1,
// documented at colmap.github.io/cameras.html). COLMAP 3.8 knows 0-10.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace roomtex {

enum class CameraModel {
  kSimplePinhole = 0,            // f, cx, cy
  kPinhole = 1,                  // fx, fy, cx, cy
  kSimpleRadial = 2,             // f, cx, cy, k
  kRadial = 3,                   // f, cx, cy, k1, k2
  kOpenCv = 4,                   // fx, fy, cx, cy, k1, k2, p1, p2
  kOpenCvFisheye = 5,            // fx, fy, cx, cy, k1, k2, k3, k4
  kFullOpenCv = 6,               // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
  kFov = 7,                      // fx, fy, cx, cy, omega
  kSimpleRadialFisheye = 8,      // f, cx, cy, k
  kRadialFisheye = 9,            // f, cx, cy, k1, k2
  kThinPrismFisheye = 10,        // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1
  kRadTanThinPrismFisheye = 11,  // fx, fy, cx, cy, k0 ... k5, p0, p1, s0 ... s3
  kSimpleDivision = 12,          // f, cx, cy, k
  kDivision = 13,                // fx, fy, cx, cy, k
  kSimpleFisheye = 14,           // f, cx, cy
  kFisheye = 15,                 // fx, fy, cx, cy
  kEucm = 16,                    // fx, fy, cx, cy, alpha, beta
  kEquirectangular = 17,         // width, height: a panorama all around
};
inline constexpr int kNumCameraModels = 18;
inline constexpr int kMaxCameraParams = 16;  // that any of them has

// Number of parameters; model ids outside 0..17 give -1.
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

  // Pixels; pixels per radian in the middle of the picture. Of a panorama: on its horizon.
  double MeanFocalLength() const;
  // Sees all around: no optical axis, no border at the left and right.
  bool IsPanorama() const { return model == CameraModel::kEquirectangular; }
  // Works on (x/z, y/z) and sees points with z > 0 only; what it says of depth is z. Fisheyes and
  // the like, and panoramas, see rays of any direction; what they say of depth is the distance.
  bool IsPerspective() const;
  // The same camera for the same photo in another size.
  void Resize(int new_width, int new_height);
  // Everything that keeps this camera from being used: a wrong number of parameters, one that is
  // not finite, a focal length that is not positive ...
  std::vector<std::string> Problems() const;
};

// Projection and unprojection of one camera, with the limits of its distortion found once.
class CameraProjection {
 public:
  // camera must have no Problems().
  explicit CameraProjection(const Camera& camera);

  // Position in `img`, for a point in `cam`. None if the point is not in front (perspective models:
  // z <= 0) or lies where the distortion polynomial no longer is one-to-one (it would fold back
  // into the picture). The result may lie outside the image: see InImage().
  std::optional<Eigen::Vector2d> ImgFromCam(const Eigen::Vector3d& x_in_cam) const;

  // The viewing ray in `cam` through a position in `img`; inverse of ImgFromCam. (x, y, 1) of a
  // perspective camera, else of length 1 and any direction. None if no ray of the valid field
  // reaches this position.
  std::optional<Eigen::Vector3d> RayFromImg(const Eigen::Vector2d& x_in_img) const;

  // The same as (x/z, y/z); none, too, for rays that do not point forward. For what needs a picture
  // plane.
  std::optional<Eigen::Vector2d> CamFromImg(const Eigen::Vector2d& x_in_img) const;

  // ImgFromCam minus a position, pixels. Of a panorama: the angle between the two rays in pixels of
  // its horizon, in the sphere's tangent plane at x_in_img (right, down), so that neither the seam
  // nor the poles turn a small error into a large one.
  std::optional<Eigen::Vector2d> ImgError(const Eigen::Vector3d& x_in_cam,
                                          const Eigen::Vector2d& x_in_img) const;

  // Depth of a point in `cam`, metres: see Camera::IsPerspective().
  double Depth(const Eigen::Vector3d& x_in_cam) const {
    return is_perspective_ ? x_in_cam.z() : x_in_cam.norm();
  }

  bool InImage(const Eigen::Vector2d& x_in_img) const {
    return x_in_img.x() >= 0 && x_in_img.y() >= 0 && x_in_img.x() <= camera_.width &&
           x_in_img.y() <= camera_.height;
  }
  const Camera& camera() const { return camera_; }
  // Largest sqrt((x/z)^2 + (y/z)^2) that ImgFromCam accepts; infinity for models that never fold
  // or see farther than 90 degrees off the axis.
  double max_radius() const { return max_radius_; }
  // Largest angle from the optical axis that ImgFromCam accepts, radians.
  double max_angle() const { return max_angle_; }

 private:
  // Undistorted (u, v) in a plane where the distortion is one-to-one within `limit`.
  std::optional<Eigen::Vector2d> Undistort(const Eigen::Vector2d& distorted, double limit) const;

  Camera camera_;
  bool is_perspective_;
  double max_radius_, max_angle_;
};

}  // namespace roomtex
