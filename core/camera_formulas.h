#pragma once
// The formulas of COLMAP's camera models as templates, so that Ceres can differentiate them.
// Use camera_model.h everywhere else: these do not check where a distortion is valid.
//
// A ray is first flattened to a plane by a closed form, then distorted in that plane by
// polynomials, then scaled to pixels. Sources: OpenCV's documentation (calib3d, fisheye), Devernay
// and Faugeras 2001 (FOV), Weng et al. 1992 (thin prism), Kannala and Brandt 2006 (fisheye),
// Fitzgibbon 2001 (division), Khomutenko, Garcia and Martinet 2016 (EUCM), the documentation of
// Project Aria's Fisheye624 (RAD_TAN_THIN_PRISM_FISHEYE).

#include <cmath>
#include <type_traits>

#include <Eigen/Core>

#include "core/camera_model.h"
#include "core/frames.h"

namespace roomtex {
namespace camera_formulas {

// The plane that a ray is flattened to.
enum class Flattening {
  kPerspective,  // (x/z, y/z), z > 0
  kEquidistant,  // the angle from the optical axis, away from it
  kDivision,     // Fitzgibbon's
  kUnified,      // EUCM's
  kLatLong,      // a panorama: no plane, pixels at once
};
constexpr Flattening FlatteningOf(CameraModel model) {
  switch (model) {
    case CameraModel::kSimplePinhole:
    case CameraModel::kPinhole:
    case CameraModel::kSimpleRadial:
    case CameraModel::kRadial:
    case CameraModel::kOpenCv:
    case CameraModel::kFullOpenCv:
    case CameraModel::kFov:
      return Flattening::kPerspective;
    case CameraModel::kOpenCvFisheye:
    case CameraModel::kSimpleRadialFisheye:
    case CameraModel::kRadialFisheye:
    case CameraModel::kThinPrismFisheye:
    case CameraModel::kRadTanThinPrismFisheye:
    case CameraModel::kSimpleFisheye:
    case CameraModel::kFisheye:
      return Flattening::kEquidistant;
    case CameraModel::kSimpleDivision:
    case CameraModel::kDivision:
      return Flattening::kDivision;
    case CameraModel::kEucm:
      return Flattening::kUnified;
    case CameraModel::kEquirectangular:
      return Flattening::kLatLong;
  }
  return Flattening::kPerspective;
}
// Sees points with z > 0 only, and works on (x/z, y/z); the others on whole rays.
constexpr bool IsPerspective(CameraModel model) {
  return FlatteningOf(model) == Flattening::kPerspective;
}

// f, f, cx, cy for the models with one focal length; fx, fy, cx, cy for the others; width and
// height alone for a panorama.
constexpr bool HasOneFocalLength(CameraModel model) {
  return model == CameraModel::kSimplePinhole || model == CameraModel::kSimpleRadial ||
         model == CameraModel::kRadial || model == CameraModel::kSimpleRadialFisheye ||
         model == CameraModel::kRadialFisheye || model == CameraModel::kSimpleDivision ||
         model == CameraModel::kSimpleFisheye;
}
constexpr int NumLinearParams(CameraModel model) {
  if (model == CameraModel::kEquirectangular) return 2;
  return HasOneFocalLength(model) ? 3 : 4;
}

// The angle between a ray and the optical axis over the distance from it, smooth on the axis. The
// ray that points exactly backwards has no direction in the plane; it gets 0 there.
template <typename T>
T AngleOverDistance(const T& x, const T& y, const T& z) {
  using std::atan2;
  using std::sqrt;
  const T r2 = x * x + y * y;
  if (z > T(0) && r2 < T(1e-8) * z * z) return (T(1) - r2 / (T(3) * z * z)) / z;
  if (r2 == T(0)) return T(0);
  const T r = sqrt(r2);
  return atan2(r, z) / r;
}

// atan(r) / r of the squared radius, smooth at 0.
template <typename T>
T AngleOverRadius(const T& r2) {
  using std::atan;
  using std::sqrt;
  if (r2 < T(1e-8)) return T(1) - r2 / T(3);
  const T r = sqrt(r2);
  return atan(r) / r;
}

// (u, v) of the ray (x, y, z). k: the parameters that follow cx, cy.
template <typename T>
void Flatten(CameraModel model, const T* k, const T& x, const T& y, const T& z, T* u, T* v) {
  using std::sqrt;
  T factor(1);
  switch (FlatteningOf(model)) {
    case Flattening::kPerspective:
      *u = x / z;
      *v = y / z;
      return;
    case Flattening::kEquidistant:
      factor = AngleOverDistance(x, y, z);
      break;
    case Flattening::kDivision:
      // Fitzgibbon 2001: the ray of (u, v) is (u, v, 1 + k (u^2 + v^2)). Solved for the smaller
      // root.
      factor = T(2) / (z + sqrt(z * z - T(4) * k[0] * (x * x + y * y)));
      break;
    case Flattening::kUnified:
      // Khomutenko et al. 2016, (3).
      factor = T(1) / (k[0] * sqrt(k[1] * (x * x + y * y) + z * z) + (T(1) - k[0]) * z);
      break;
    case Flattening::kLatLong:
      break;
  }
  *u = x * factor;
  *v = y * factor;
}

// Distorted coordinates (ud, vd) of undistorted ones (u, v), in the plane of Flatten(). k: the
// parameters that follow cx, cy.
template <typename T>
void Distort(CameraModel model, const T* k, const T& u, const T& v, T* ud, T* vd) {
  using std::tan;
  const T r2 = u * u + v * v;  // of a fisheye: the squared angle from the optical axis
  switch (model) {
    case CameraModel::kSimplePinhole:
    case CameraModel::kPinhole:
    case CameraModel::kSimpleFisheye:
    case CameraModel::kFisheye:
    case CameraModel::kSimpleDivision:
    case CameraModel::kDivision:
    case CameraModel::kEucm:
    case CameraModel::kEquirectangular:
      *ud = u;
      *vd = v;
      return;
    case CameraModel::kSimpleRadial:
    case CameraModel::kRadial: {
      T radial = T(1) + k[0] * r2;
      if (model == CameraModel::kRadial) radial += k[1] * r2 * r2;
      *ud = u * radial;
      *vd = v * radial;
      return;
    }
    case CameraModel::kOpenCv:
    case CameraModel::kFullOpenCv: {
      T radial = T(1) + r2 * (k[0] + r2 * k[1]);
      if (model == CameraModel::kFullOpenCv) {
        radial = (radial + k[4] * r2 * r2 * r2) / (T(1) + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
      }
      *ud = u * radial + T(2) * k[2] * u * v + k[3] * (r2 + T(2) * u * u);
      *vd = v * radial + T(2) * k[3] * u * v + k[2] * (r2 + T(2) * v * v);
      return;
    }
    case CameraModel::kFov: {
      const T omega = k[0];
      T factor;
      if (omega * omega < T(1e-8)) {
        factor = T(1) + omega * omega * (r2 / T(-3) + T(1) / T(12));
      } else {
        const T slope = T(2) * tan(omega / T(2));
        factor = AngleOverRadius(T(slope * slope * r2)) * slope / omega;
      }
      *ud = u * factor;
      *vd = v * factor;
      return;
    }
    case CameraModel::kThinPrismFisheye: {
      const T radial = T(1) + r2 * (k[0] + r2 * (k[1] + r2 * (k[4] + r2 * k[5])));
      *ud = u * radial + T(2) * k[2] * u * v + k[3] * (r2 + T(2) * u * u) + k[6] * r2;
      *vd = v * radial + T(2) * k[3] * u * v + k[2] * (r2 + T(2) * v * v) + k[7] * r2;
      return;
    }
    case CameraModel::kRadTanThinPrismFisheye: {
      // Tangential and thin-prism terms act on the point that is radially distorted already; the
      // first tangential one belongs to u, unlike OpenCV's.
      const T radial =
          T(1) + r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * (k[3] + r2 * (k[4] + r2 * k[5])))));
      const T ur = u * radial, vr = v * radial;
      const T rr2 = ur * ur + vr * vr;
      *ud = ur + k[6] * (rr2 + T(2) * ur * ur) + T(2) * k[7] * ur * vr + rr2 * (k[8] + k[9] * rr2);
      *vd =
          vr + k[7] * (rr2 + T(2) * vr * vr) + T(2) * k[6] * ur * vr + rr2 * (k[10] + k[11] * rr2);
      return;
    }
    case CameraModel::kOpenCvFisheye:
    case CameraModel::kSimpleRadialFisheye:
    case CameraModel::kRadialFisheye: {
      T radial = T(1) + r2 * k[0];
      if (model != CameraModel::kSimpleRadialFisheye) radial += r2 * r2 * k[1];
      if (model == CameraModel::kOpenCvFisheye) radial += r2 * r2 * r2 * (k[2] + r2 * k[3]);
      *ud = u * radial;
      *vd = v * radial;
      return;
    }
  }
}

// Longitude and latitude of a panorama: x = (atan2(X, Z) / 2 pi + 1/2) width, y = (1/2 - atan2(-Y,
// sqrt(X^2 + Z^2)) / pi) height; params: width, height.
template <typename T>
void ProjectToPanorama(const T* params, const T& x, const T& y, const T& z, T* img_x, T* img_y) {
  using std::atan2;
  using std::sqrt;
  *img_x = (atan2(x, z) / T(2 * kPi) + T(0.5)) * params[0];
  *img_y = (atan2(y, sqrt(x * x + z * z)) / T(kPi) + T(0.5)) * params[1];
}

// Position in `img` of the viewing ray (x, y, z) in `cam`.
template <typename T>
void Project(CameraModel model, const T* params, const T& x, const T& y, const T& z, T* img_x,
             T* img_y) {
  if (model == CameraModel::kEquirectangular) {
    ProjectToPanorama(params, x, y, z, img_x, img_y);
    return;
  }
  const bool one_focal_length = HasOneFocalLength(model);
  const T* const k = params + (one_focal_length ? 3 : 4);
  T u = x, v = y;
  Flatten(model, k, x, y, z, &u, &v);
  T ud = u, vd = v;
  Distort(model, k, u, v, &ud, &vd);
  if (one_focal_length) {
    *img_x = params[0] * ud + params[1];
    *img_y = params[0] * vd + params[2];
  } else {
    *img_x = params[0] * ud + params[2];
    *img_y = params[1] * vd + params[3];
  }
}

// The same for the ray (x, y, 1).
template <typename T>
void Project(CameraModel model, const T* params, const T& x, const T& y, T* img_x, T* img_y) {
  Project(model, params, x, y, T(1), img_x, img_y);
}

// Rows: right and down in a panorama, and the direction itself, at a position in its `img`.
inline Eigen::Matrix3d PanoramaFrame(double width, double height, const Eigen::Vector2d& x_in_img) {
  const double longitude = 2 * kPi * (x_in_img.x() / width - 0.5);
  const double down = kPi * (x_in_img.y() / height - 0.5);
  const double sl = std::sin(longitude), cl = std::cos(longitude);
  const double sd = std::sin(down), cd = std::cos(down);
  Eigen::Matrix3d frame;
  frame << cl, 0, -sl, -sd * sl, cd, -sd * cl, cd * sl, sd, cd * cl;
  return frame;
}

// Position of the ray (x, y, z) minus x_in_img, as CameraProjection::ImgError.
template <typename T>
void ImgError(CameraModel model, const T* params, const T& x, const T& y, const T& z,
              const Eigen::Vector2d& x_in_img, T* error_x, T* error_y) {
  if (model != CameraModel::kEquirectangular) {
    Project(model, params, x, y, z, error_x, error_y);
    *error_x -= T(x_in_img.x());
    *error_y -= T(x_in_img.y());
    return;
  }
  // Seen in the direction x_in_img, a panorama is an equidistant fisheye. (Its size is known: jets
  // of params are not followed.)
  const auto number = [](const auto& value) {
    if constexpr (std::is_floating_point_v<T>) {
      return static_cast<double>(value);
    } else {
      return static_cast<double>(value.a);
    }
  };
  const double width = number(params[0]);
  const Eigen::Matrix3d f = PanoramaFrame(width, number(params[1]), x_in_img);
  const T right = T(f(0, 0)) * x + T(f(0, 1)) * y + T(f(0, 2)) * z;
  const T down = T(f(1, 0)) * x + T(f(1, 1)) * y + T(f(1, 2)) * z;
  const T ahead = T(f(2, 0)) * x + T(f(2, 1)) * y + T(f(2, 2)) * z;
  const T factor = AngleOverDistance(right, down, ahead) * T(width / (2 * kPi));
  *error_x = right * factor;
  *error_y = down * factor;
}

}  // namespace camera_formulas
}  // namespace roomtex
