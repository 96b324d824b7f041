#pragma once
// How the bytes of a photo become linear light: response curve and vignetting. A photo without a
// tone is sRGB, without vignetting.

#include <algorithm>
#include <array>
#include <string>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/camera_model.h"

namespace roomtex {

// Linear light of every byte value, non-decreasing, 1 for 255; red, green, blue.
class ResponseCurve {
 public:
  static constexpr int kLevels = 256;
  using Table = std::array<std::array<float, 3>, kLevels>;

  ResponseCurve();  // sRGB
  // Scales the table so that 255 is 1 and no level is lighter; a level that is darker than the one
  // before it is set to that.
  explicit ResponseCurve(Table table);

  // A text file: one line per level 0..255 with the linear light at any scale, one number or three
  // (red, green, blue), by blanks or commas; # starts a comment. Throws InputError.
  static ResponseCurve Read(const std::string& path);
  void Write(const std::string& path) const;

  bool is_srgb() const { return is_srgb_; }
  // level: 0..255, between the levels too. channel: 0 = red.
  float Linear(float level, int channel) const;
  // Of light that was taken for sRGB: the light that it is.
  float LinearFromSrgbLinear(float linear, int channel) const;
  // Turns a photo (8-bit BGR) into sRGB.
  void ToSrgb(cv::Mat* photo) const;

 private:
  Table table_;
  bool is_srgb_ = false;
};

// Brightening towards the corners, shared by all photos of a lens: the factor is
// exp(a1 r^2 + a2 r^4 + a3 r^6), r = 1 at half the photo's diagonal from the principal point.
struct Vignetting {
  Eigen::Vector3d a = Eigen::Vector3d::Zero();
  // Up to this r^2 the polynomial holds; beyond, its logarithm goes on straight in r^2, to at most
  // twice its value there.
  double largest_radius2 = 1;

  double LogFactor(double radius2) const {
    const double r2 = radius2 < largest_radius2 ? radius2 : largest_radius2;
    const double slope = a[0] + r2 * (2 * a[1] + r2 * 3 * a[2]);
    const double value = r2 * (a[0] + r2 * (a[1] + r2 * a[2]));
    return value + std::clamp(slope * (radius2 - r2), 0.0, std::max(value, 0.0));
  }
  bool is_none() const { return a.isZero(); }
};

// Squared distances of a photo's positions from its principal point; 1 = half its diagonal.
class LensRadius {
 public:
  explicit LensRadius(const CameraProjection& camera);
  float Squared(float x_in_img, float y_in_img) const {
    const float dx = x_in_img - centre_.x(), dy = y_in_img - centre_.y();
    return (dx * dx + dy * dy) * scale_;
  }

 private:
  Eigen::Vector2f centre_;
  float scale_;
};

// The factor of a vignetting at positions in `img`, from a table.
class VignettingFactor {
 public:
  VignettingFactor(const Vignetting& vignetting, const CameraProjection& camera);
  float At(float x_in_img, float y_in_img) const;

 private:
  static constexpr int kSteps = 256;
  LensRadius radius_;
  std::array<float, kSteps + 2> table_;
};

struct PhotoTone {
  ResponseCurve response;
  Vignetting vignetting;
};

}  // namespace roomtex
