#include "texture/sampling/photo_sharpness.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr double kProbeBytes = 24e6;
constexpr double kShareSeen = 0.25;  // of the samples, by a photo; more only takes more room
constexpr size_t kMostProbes = 100000;
constexpr int kDarkest = 24, kLightest = 235;  // grey levels, in the mean
// Contrasts: noise has about this, and from here on there is texture.
constexpr double kNoiseContrast = 5e-4, kTextured = 4e-3;
constexpr double kAsLarge = 1.5;   // ratio of pixel widths
constexpr size_t kNeighbours = 4;  // of a photo at a sample, the next ones by pixel width
constexpr size_t kFewest = 200;    // samples that say something
// Beside which photos the others are blurred: those with this rank. So many may be blurred.
constexpr double kSharp = 0.8;
// From here on a photo is as sharp as others, lens and focus being what they are. Below, its weight
// falls with this power.
constexpr double kSharpEnough = 0.85, kPower = 6;

struct Pair {
  double count = 0, log_contrast = 0, log_width = 0;  // sums, of the first over the second
};
using Pairs = std::map<std::pair<int, int>, Pair>;

struct Entry {
  uint32_t sample;
  int photo;
  float contrast, pixel_width;

  bool operator<(const Entry& other) const {
    if (sample != other.sample) return sample < other.sample;
    if (pixel_width != other.pixel_width) return pixel_width < other.pixel_width;
    return photo < other.photo;
  }
};

std::vector<Entry> BySample(const std::vector<std::vector<SharpnessProbe>>& probes) {
  std::vector<Entry> entries;
  for (size_t photo = 0; photo < probes.size(); ++photo) {
    for (const SharpnessProbe& probe : probes[photo]) {
      entries.push_back({probe.sample, static_cast<int>(photo), probe.contrast, probe.pixel_width});
    }
  }
  std::sort(entries.begin(), entries.end());
  return entries;
}

Pairs FindPairs(const std::vector<Entry>& entries, std::vector<PhotoSharpness>* photos) {
  Pairs pairs;
  for (size_t i = 0; i < entries.size(); ++i) {
    const Entry& a = entries[i];
    bool compared = false;
    for (size_t k = i + 1; k < entries.size() && k <= i + kNeighbours; ++k) {
      const Entry& b = entries[k];
      if (b.sample != a.sample || b.pixel_width > kAsLarge * a.pixel_width) break;
      if ((a.contrast + b.contrast) / 2 < kTextured) continue;
      const bool in_order = a.photo < b.photo;
      Pair& pair =
          pairs[in_order ? std::make_pair(a.photo, b.photo) : std::make_pair(b.photo, a.photo)];
      const double sign = in_order ? 1 : -1;
      pair.count += 1;
      pair.log_contrast +=
          sign * std::log((a.contrast + kNoiseContrast) / (b.contrast + kNoiseContrast));
      pair.log_width += sign * std::log(a.pixel_width / b.pixel_width);
      compared = true;
    }
    if (compared) ++(*photos)[a.photo].num_samples;
  }
  return pairs;
}

// Log contrast of each photo at the same surface, as least squares have it, together with how it
// grows with the width of the pixels. By sweeps (Gauss and Seidel).
std::vector<double> SolvePairs(const Pairs& pairs, size_t num_photos) {
  constexpr int kSweeps = 100;
  constexpr double kHold = 50;  // samples that say "as the others"
  std::vector<double> logs(num_photos, 0.0);
  double growth = 0;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    std::vector<double> sums(num_photos, 0.0), counts(num_photos, kHold);
    double width_square = 1, width_left = 0;
    for (const auto& [photos, pair] : pairs) {
      const auto [a, b] = photos;
      const double explained = growth * pair.log_width;
      sums[a] += pair.log_contrast - explained + pair.count * logs[b];
      sums[b] -= pair.log_contrast - explained - pair.count * logs[a];
      counts[a] += pair.count;
      counts[b] += pair.count;
      width_square += pair.log_width * pair.log_width / pair.count;
      width_left += pair.log_width * (pair.log_contrast / pair.count - logs[a] + logs[b]);
    }
    // Half way: two photos that are compared with nothing but each other would swing for ever.
    for (size_t i = 0; i < num_photos; ++i) logs[i] = (logs[i] + sums[i] / counts[i]) / 2;
    growth = width_left / width_square;
  }
  return logs;
}

}  // namespace

size_t SharpnessStride(size_t num_slots, size_t num_photos) {
  const double of_photo = kShareSeen * sizeof(SharpnessProbe);
  const double most =
      std::min<double>(kMostProbes, kProbeBytes / (of_photo * std::max<size_t>(1, num_photos)));
  return static_cast<size_t>(static_cast<double>(num_slots) / most) + 1;
}

float ContrastAt(const cv::Mat& photo, float x_in_img, float y_in_img) {
  constexpr int kReach = 2;
  const int column = static_cast<int>(x_in_img), row = static_cast<int>(y_in_img);
  if (column < kReach || row < kReach || column + kReach >= photo.cols ||
      row + kReach >= photo.rows) {
    return -1;
  }
  int grey[2 * kReach + 1][2 * kReach + 1];  // four times
  int sum = 0;
  for (int j = -kReach; j <= kReach; ++j) {
    const uint8_t* at = photo.ptr<uint8_t>(row + j) + 3 * (column - kReach);
    for (int i = 0; i <= 2 * kReach; ++i, at += 3) {
      grey[j + kReach][i] = at[0] + 2 * at[1] + at[2];
      sum += grey[j + kReach][i];
    }
  }
  const double mean = sum / (4 * 25.0);
  if (mean < kDarkest || mean > kLightest) return -1;
  int energy = 0;
  for (int j = 1; j < 2 * kReach; ++j) {
    for (int i = 1; i < 2 * kReach; ++i) {
      const int dx = grey[j][i + 1] - grey[j][i - 1], dy = grey[j + 1][i] - grey[j - 1][i];
      energy += dx * dx + dy * dy;
    }
  }
  return static_cast<float>(energy / (9 * 16.0) / (mean * mean));
}

std::vector<PhotoSharpness> CompareSharpness(
    const std::vector<std::vector<SharpnessProbe>>& probes) {
  std::vector<PhotoSharpness> photos(probes.size());
  const Pairs pairs = FindPairs(BySample(probes), &photos);
  const std::vector<double> logs = SolvePairs(pairs, probes.size());
  std::vector<double> compared;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (photos[i].num_samples >= kFewest) compared.push_back(logs[i]);
  }
  const double sharp = Quantile(&compared, kSharp);
  for (size_t i = 0; i < photos.size(); ++i) {
    if (photos[i].num_samples < kFewest) continue;
    // Of the gradient, not its energy.
    photos[i].sharpness = std::min(1.0, std::exp((logs[i] - sharp) / 2));
    photos[i].weight = std::pow(std::min(1.0, photos[i].sharpness / kSharpEnough), kPower);
  }
  return photos;
}

}  // namespace roomtex
