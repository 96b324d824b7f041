#include "texture/tone/exposure_overlaps.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

#include "core/statistics.h"

namespace roomtex {
namespace {

struct LogRatio {
  uint32_t pair;  // photo_a * num_photos + photo_b
  float trust;
  Eigen::Vector4f value;
};

Overlap SummariseOverlap(const std::vector<LogRatio>& ratios, int num_photos) {
  Overlap overlap;
  overlap.photo_a = static_cast<int>(ratios[0].pair) / num_photos;
  overlap.photo_b = static_cast<int>(ratios[0].pair) % num_photos;
  for (const LogRatio& ratio : ratios) overlap.num_samples += ratio.trust;
  std::vector<std::pair<float, float>> values(ratios.size());
  for (int channel = 0; channel < 4; ++channel) {
    for (size_t i = 0; i < ratios.size(); ++i)
      values[i] = {ratios[i].value[channel], ratios[i].trust};
    overlap.log_ratio[channel] = WeightedMedian(&values);
  }
  for (auto& [value, trust] : values) value = std::abs(value - overlap.log_ratio[3]);
  overlap.spread = static_cast<float>(kSigmaPerMad) * WeightedMedian(&values);
  return overlap;
}

Eigen::Vector4f LogsOf(const Eigen::Vector3f& light) {
  Eigen::Vector4f logs;
  logs << light.array().log().matrix(), std::log(light.sum());
  return logs;
}

// Calls visit(a, b) for the views of every sample in pairs of photos, a.photo < b.photo.
template <typename Visit>
void ForPairs(const ExposureSamples& samples, size_t k, const Visit& visit) {
  for (size_t i = samples.begin[k]; i < samples.begin[k + 1]; ++i) {
    for (size_t j = samples.begin[k]; j < samples.begin[k + 1]; ++j) {
      if (samples.views[i].photo < samples.views[j].photo) visit(i, j);
    }
  }
}

// Ends of ranges of first photos whose pairs are few enough to be held at once: of samples that 64
// photos see they are thousands each.
std::vector<int> RangesOfPhotos(const ExposureSamples& samples) {
  constexpr size_t kMostPairs = 8000000;  // of 32 bytes
  std::vector<size_t> num_pairs(samples.num_photos, 0);
  for (size_t k = 0; k < samples.size(); ++k) {
    ForPairs(samples, k, [&](size_t i, size_t) { ++num_pairs[samples.views[i].photo]; });
  }
  std::vector<int> ends;
  size_t held = 0;
  for (int photo = 0; photo < samples.num_photos; ++photo) {
    if (held > 0 && held + num_pairs[photo] > kMostPairs) {
      ends.push_back(photo);
      held = 0;
    }
    held += num_pairs[photo];
  }
  ends.push_back(samples.num_photos);
  return ends;
}

// Of pairs whose first photo is one of [first, end).
std::vector<LogRatio> ListRatios(const ExposureSamples& samples, int first, int end_photo) {
  std::vector<LogRatio> ratios;
  std::vector<Eigen::Vector4f> logs;
  for (size_t k = 0; k < samples.size(); ++k) {
    const size_t begin = samples.begin[k], end = samples.begin[k + 1];
    logs.clear();
    for (size_t i = begin; i < end; ++i) logs.push_back(LogsOf(samples.views[i].light));
    ForPairs(samples, k, [&](size_t i, size_t j) {
      const ExposureView &a = samples.views[i], &b = samples.views[j];
      if (a.photo < first || a.photo >= end_photo) return;
      const auto pair = static_cast<uint32_t>(a.photo * samples.num_photos + b.photo);
      ratios.push_back({pair, std::min(a.trust, b.trust), logs[i - begin] - logs[j - begin]});
    });
  }
  return ratios;
}

void AddOverlaps(const std::vector<LogRatio>& ratios, int num_photos, double min_samples,
                 std::vector<Overlap>* overlaps) {
  std::vector<uint32_t> order(ratios.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return ratios[a].pair != ratios[b].pair ? ratios[a].pair < ratios[b].pair : a < b;
  });
  std::vector<LogRatio> of_pair;
  for (size_t begin = 0; begin < order.size();) {
    of_pair.clear();
    size_t end = begin;
    while (end < order.size() && ratios[order[end]].pair == ratios[order[begin]].pair) {
      of_pair.push_back(ratios[order[end++]]);
    }
    const Overlap overlap = SummariseOverlap(of_pair, num_photos);
    if (overlap.num_samples >= min_samples) overlaps->push_back(overlap);
    begin = end;
  }
}

}  // namespace

std::vector<Overlap> FindOverlaps(const ExposureSamples& samples, double min_samples) {
  std::vector<Overlap> overlaps;
  int first = 0;
  for (const int end : RangesOfPhotos(samples)) {
    AddOverlaps(ListRatios(samples, first, end), samples.num_photos, min_samples, &overlaps);
    first = end;
  }
  return overlaps;
}

}  // namespace roomtex
