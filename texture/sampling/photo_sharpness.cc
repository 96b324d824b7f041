#include "texture/sampling/photo_sharpness.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/random_stream.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr size_t kMostProbed = 200000;         // samples
constexpr size_t kProbeBytes = 24'000'000;     // of all photos
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
constexpr double kSharpEnough = 0.75, kPower = 6;

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
  std::vector<int64_t> counted(photos->size(), -1);  // the last sample
  const auto count = [&](const Entry& entry) {
    if (counted[entry.photo] == entry.sample) return;
    counted[entry.photo] = entry.sample;
    ++(*photos)[entry.photo].num_samples;
  };
  for (size_t i = 0; i < entries.size(); ++i) {
    const Entry& a = entries[i];
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
      count(a);
      count(b);
    }
  }
  return pairs;
}

// Log contrast of each photo at the same surface, as least squares have it, together with how it
// grows with the width of the pixels: as that, where edges are seen. By sweeps (Jacobi, damped).
std::vector<double> SolvePairs(const Pairs& pairs, size_t num_photos) {
  constexpr int kSweeps = 300;
  constexpr double kHold = 50;  // samples that say "as the others"
  constexpr double kGrowth = 1, kHoldGrowth = 50;
  std::vector<double> logs(num_photos, 0.0);
  double growth = kGrowth;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    std::vector<double> sums(num_photos, 0.0), counts(num_photos, kHold);
    double width_square = kHoldGrowth, width_left = kHoldGrowth * kGrowth;
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

size_t SharpnessStride(size_t num_slots) { return num_slots / kMostProbed + 1; }

void KeepSomeProbes(size_t num_photos, std::vector<SharpnessProbe>* probes) {
  const size_t most = kProbeBytes / sizeof(SharpnessProbe) / std::max<size_t>(1, num_photos);
  if (probes->size() > most) {
    // By a lot that is the sample's, so that photos keep the same ones.
    const auto lot = [](const SharpnessProbe& probe) { return MixBits(561, probe.sample); };
    std::nth_element(
        probes->begin(), probes->begin() + static_cast<std::ptrdiff_t>(most), probes->end(),
        [&](const SharpnessProbe& a, const SharpnessProbe& b) { return lot(a) < lot(b); });
    probes->resize(most);
    std::sort(probes->begin(), probes->end(),
              [](const SharpnessProbe& a, const SharpnessProbe& b) { return a.sample < b.sample; });
  }
  probes->shrink_to_fit();
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
