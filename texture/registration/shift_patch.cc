#include "texture/registration/shift_patch.h"

#include <cmath>

#include <Eigen/LU>

namespace roomtex {
namespace {

constexpr int kFewestPixels = 40;
// Below, noise looks alike.
constexpr float kLeastContrast = 3;  // grey levels, standard deviation
constexpr float kLeastLikeness = 0.5f;

struct Likeness {
  float correlation = -1, gain = 1, mean = 0, mean_expected = 0, variance = 0;
};

Likeness Compare(const cv::Mat1b& grey, const std::vector<ExpectedPixel>& expected,
                 const Eigen::Vector2f& shift) {
  double count = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
  for (const ExpectedPixel& pixel : expected) {
    const float value = GreyAt(grey, pixel.place + shift);
    if (value < 0) continue;
    ++count;
    a += value;
    b += pixel.grey;
    aa += value * value;
    bb += pixel.grey * pixel.grey;
    ab += value * pixel.grey;
  }
  Likeness result;
  if (count < kFewestPixels || count < 0.7 * static_cast<double>(expected.size())) return result;
  a /= count;
  b /= count;
  const double var_a = aa / count - a * a, var_b = bb / count - b * b, cov = ab / count - a * b;
  if (var_a < kLeastContrast * kLeastContrast || var_b < kLeastContrast * kLeastContrast) {
    return result;
  }
  result.correlation = static_cast<float>(cov / std::sqrt(var_a * var_b));
  result.gain = static_cast<float>(cov / var_b);
  result.mean = static_cast<float>(a);
  result.mean_expected = static_cast<float>(b);
  result.variance = static_cast<float>(var_a * (1 - result.correlation * result.correlation));
  return result;
}

// Normal equations of a small step of the shift.
struct ShiftStep {
  Eigen::Matrix2f normal = Eigen::Matrix2f::Zero();
  Eigen::Vector2f right = Eigen::Vector2f::Zero();
};

ShiftStep Linearise(const cv::Mat1b& grey, const std::vector<ExpectedPixel>& expected,
                    const Eigen::Vector2f& shift, const Likeness& at) {
  ShiftStep step;
  const Eigen::Vector2f dx(0.5f, 0), dy(0, 0.5f);
  for (const ExpectedPixel& pixel : expected) {
    const Eigen::Vector2f place = pixel.place + shift;
    const float value = GreyAt(grey, place);
    const float left = GreyAt(grey, place - dx), right = GreyAt(grey, place + dx);
    const float above = GreyAt(grey, place - dy), below = GreyAt(grey, place + dy);
    if (std::min({value, left, right, above, below}) < 0) continue;
    const Eigen::Vector2f gradient(right - left, below - above);
    const float residual = at.gain * (pixel.grey - at.mean_expected) - (value - at.mean);
    step.normal += gradient * gradient.transpose();
    step.right += gradient * residual;
  }
  return step;
}

}  // namespace

float GreyAt(const cv::Mat1b& grey, const Eigen::Vector2f& place) {
  const float x = place.x() - 0.5f, y = place.y() - 0.5f;
  if (!(x >= 0 && y >= 0)) return -1;
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  if (column + 1 >= grey.cols || row + 1 >= grey.rows) return -1;
  const float s = x - static_cast<float>(column), t = y - static_cast<float>(row);
  const uint8_t *above = grey[row] + column, *below = grey[row + 1] + column;
  const float upper = static_cast<float>(above[0]) + s * static_cast<float>(above[1] - above[0]);
  const float lower = static_cast<float>(below[0]) + s * static_cast<float>(below[1] - below[0]);
  return upper + t * (lower - upper);
}

std::optional<float> PatchLikeness(const cv::Mat1b& grey,
                                   const std::vector<ExpectedPixel>& expected) {
  const Likeness here = Compare(grey, expected, Eigen::Vector2f::Zero());
  if (!(here.correlation > -1)) return std::nullopt;
  return here.correlation;
}

PatchShift FindPatchShift(const cv::Mat1b& grey, const std::vector<ExpectedPixel>& expected,
                          int radius) {
  PatchShift result;
  if (static_cast<int>(expected.size()) < kFewestPixels) return result;
  Likeness best;
  for (int y = -radius; y <= radius; ++y) {
    for (int x = -radius; x <= radius; ++x) {
      const Eigen::Vector2f shift(static_cast<float>(x), static_cast<float>(y));
      const Likeness here = Compare(grey, expected, shift);
      if (here.correlation <= best.correlation) continue;
      best = here;
      result.shift = shift;
    }
  }
  if (best.correlation < kLeastLikeness) return {};
  const Eigen::Vector2f whole = result.shift;
  ShiftStep step;
  for (int round = 0; round < 4; ++round) {
    step = Linearise(grey, expected, result.shift, best);
    // Held a little, so that nothing moves along an edge.
    Eigen::Matrix2f held = step.normal;
    held.diagonal().array() += 0.02f * step.normal.trace() + 1;
    const Eigen::Vector2f next = result.shift + held.inverse() * step.right;
    if ((next - whole).cwiseAbs().maxCoeff() > 1) break;
    const Likeness here = Compare(grey, expected, next);
    if (here.correlation < best.correlation) break;
    best = here;
    result.shift = next;
  }
  result.likeness = best.correlation;
  // Neighbouring pixels err alike: a patch knows no more than some of them.
  constexpr float kIndependent = 0.25f, kNoise = 2;
  result.information = step.normal * (kIndependent / (best.variance + kNoise * kNoise));
  return result;
}

}  // namespace roomtex
