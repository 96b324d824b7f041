#pragma once
// The formulas of COLMAP's camera models as templates, so that Ceres can differentiate them.
// Use camera_model.h everywhere else: these do not check where a distortion is valid.

#include <cmath>

#include "core/camera_model.h"

namespace roomtex {
namespace camera_formulas {

// f, f, cx, cy for the models with one focal length; fx, fy, cx, cy for the others.
inline bool HasOneFocalLength(CameraModel model) {
  return model == CameraModel::kSimplePinhole || model == CameraModel::kSimpleRadial ||
         model == CameraModel::kRadial || model == CameraModel::kSimpleRadialFisheye ||
         model == CameraModel::kRadialFisheye;
}
inline int NumLinearParams(CameraModel model) { return HasOneFocalLength(model) ? 3 : 4; }

// atan(r) / r of the squared radius, smooth at 0.
template <typename T>
T AngleOverRadius(const T& r2) {
  using std::atan;
  using std::sqrt;
  if (r2 < T(1e-8)) return T(1) - r2 / T(3);
  const T r = sqrt(r2);
  return atan(r) / r;
}

// Distorted normalised coordinates (xd, yd) of undistorted ones (x, y). k: the parameters that
// follow cx, cy.
template <typename T>
void Distort(CameraModel model, const T* k, const T& x, const T& y, T* xd, T* yd) {
  using std::atan;
  using std::sqrt;
  using std::tan;
  const T r2 = x * x + y * y;
  switch (model) {
    case CameraModel::kSimplePinhole:
    case CameraModel::kPinhole:
      *xd = x;
      *yd = y;
      return;
    case CameraModel::kSimpleRadial:
    case CameraModel::kRadial: {
      T radial = T(1) + k[0] * r2;
      if (model == CameraModel::kRadial) radial += k[1] * r2 * r2;
      *xd = x * radial;
      *yd = y * radial;
      return;
    }
    case CameraModel::kOpenCv:
    case CameraModel::kFullOpenCv: {
      T radial = T(1) + r2 * (k[0] + r2 * k[1]);
      if (model == CameraModel::kFullOpenCv) {
        radial = (radial + k[4] * r2 * r2 * r2) / (T(1) + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
      }
      *xd = x * radial + T(2) * k[2] * x * y + k[3] * (r2 + T(2) * x * x);
      *yd = y * radial + T(2) * k[3] * x * y + k[2] * (r2 + T(2) * y * y);
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
      *xd = x * factor;
      *yd = y * factor;
      return;
    }
    case CameraModel::kOpenCvFisheye:
    case CameraModel::kSimpleRadialFisheye:
    case CameraModel::kRadialFisheye:
    case CameraModel::kThinPrismFisheye: {
      const T angle_over_radius = AngleOverRadius(r2);
      const T u = x * angle_over_radius;
      const T v = y * angle_over_radius;
      const T t2 = u * u + v * v;  // squared angle from the optical axis
      if (model == CameraModel::kThinPrismFisheye) {
        const T radial = T(1) + t2 * (k[0] + t2 * (k[1] + t2 * (k[4] + t2 * k[5])));
        *xd = u * radial + T(2) * k[2] * u * v + k[3] * (t2 + T(2) * u * u) + k[6] * t2;
        *yd = v * radial + T(2) * k[3] * u * v + k[2] * (t2 + T(2) * v * v) + k[7] * t2;
        return;
      }
      T radial = T(1) + t2 * k[0];
      if (model != CameraModel::kSimpleRadialFisheye) radial += t2 * t2 * k[1];
      if (model == CameraModel::kOpenCvFisheye) radial += t2 * t2 * t2 * (k[2] + t2 * k[3]);
      *xd = u * radial;
      *yd = v * radial;
      return;
    }
  }
}

// Position in `img` of the viewing ray (x, y, 1) in `cam`.
template <typename T>
void Project(CameraModel model, const T* params, const T& x, const T& y, T* img_x, T* img_y) {
  const bool one_focal_length = HasOneFocalLength(model);
  T xd = x, yd = y;
  Distort(model, params + (one_focal_length ? 3 : 4), x, y, &xd, &yd);
  if (one_focal_length) {
    *img_x = params[0] * xd + params[1];
    *img_y = params[0] * yd + params[2];
  } else {
    *img_x = params[0] * xd + params[2];
    *img_y = params[1] * yd + params[3];
  }
}

}  // namespace camera_formulas
}  // namespace roomtex
