#pragma once
// What keeps a photo from being sRGB of the light that falls in: response curve, vignetting, white
// balance.

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace roomtex {

// Byte value 0..255, not rounded, of linear light; light outside 0..1 is clipped.
// "srgb": IEC 61966-2-1. "film": a gamma of 1.8 with a toe and a shoulder.
class ResponseTable {
 public:
  // Names of curves, for options.
  static const std::vector<std::string>& Names();
  // The curve itself: linear light 0..1 to 0..1.
  static double Encode(const std::string& name, double linear);

  // The linear light of every byte value.
  static std::array<float, 256> LinearFromByte(const std::string& name);

  explicit ResponseTable(const std::string& name);
  float Grey(float linear) const;

 private:
  std::vector<float> grey_;
};

// Share of the light that is left at a distance from the principal point, 1 = half the photo's
// diagonal; `loss` is lost there.
inline double VignettingAt(double radius2, double loss) {
  return 1 - loss * (0.6 * radius2 + 0.4 * radius2 * radius2);
}

// Factors on red, green, blue of a photo: red and blue vary by up to +-range_ev.
Eigen::Vector3f WhiteBalanceOf(int photo, int random_seed, double range_ev);

}  // namespace roomtex
