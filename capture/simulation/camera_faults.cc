#include "capture/simulation/camera_faults.h"

#include <algorithm>
#include <cmath>

#include "core/frames.h"
#include "core/photo.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

constexpr int kNodes = 4096;

}  // namespace

const std::vector<std::string>& ResponseTable::Names() {
  static const std::vector<std::string> names = {"srgb", "film"};
  return names;
}

double ResponseTable::Encode(const std::string& name, double linear) {
  if (name != "film") return SrgbFromLinear(linear);
  constexpr double kGamma = 1.8, kBend = 0.3;  // slopes 0.7 at the ends, 1.3 in the middle
  const double power = std::pow(linear, 1 / kGamma);
  return power - kBend * std::sin(2 * kPi * power) / (2 * kPi);
}

std::array<float, 256> ResponseTable::LinearFromByte(const std::string& name) {
  if (name != "film") return LinearFromSrgbByte();
  std::array<float, 256> table{};
  for (size_t byte = 0; byte < table.size(); ++byte) {
    double low = 0, high = 1;  // the curve grows all along: halved to the last bit
    for (int i = 0; i < 50; ++i) {
      const double middle = (low + high) / 2;
      (255 * Encode(name, middle) < static_cast<double>(byte) ? low : high) = middle;
    }
    table[byte] = static_cast<float>(high);
  }
  return table;
}

// Over the square root, where such curves are nearly straight.
ResponseTable::ResponseTable(const std::string& name) {
  for (int i = 0; i < kNodes + 2; ++i) {
    const double root = std::min(1.0, static_cast<double>(i) / kNodes);
    grey_.push_back(static_cast<float>(255 * Encode(name, root * root)));
  }
}

float ResponseTable::Grey(float linear) const {
  const float x = kNodes * std::sqrt(std::clamp(linear, 0.0f, 1.0f));
  const int node = static_cast<int>(x);
  return grey_[node] + (x - static_cast<float>(node)) * (grey_[node + 1] - grey_[node]);
}

Eigen::Vector3f WhiteBalanceOf(int photo, int random_seed, double range_ev) {
  RandomStream random(MixBits(static_cast<uint64_t>(random_seed), 507, photo));
  const double red = random.Uniform(-range_ev, range_ev);
  const double blue = random.Uniform(-range_ev, range_ev);
  return {static_cast<float>(std::exp2(red)), 1.0f, static_cast<float>(std::exp2(blue))};
}

}  // namespace roomtex
