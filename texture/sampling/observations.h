#pragma once
// What the photos say about each sample, in eight bytes a photo: photos are decoded once, and
// exposure, blend and detail are found afterwards from what was kept.

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

#include <Eigen/Core>

namespace roomtex {

// Linear light 0..1 in 32 bits: square roots (about even to the eye, as sRGB is) in 11, 11 and 10
// bits, red, green, blue. Finer than the photos' bytes.
inline uint32_t PackColor(const Eigen::Vector3f& linear) {
  const auto code = [](float value, float steps) {
    return static_cast<uint32_t>(std::sqrt(std::clamp(value, 0.0f, 1.0f)) * steps + 0.5f);
  };
  return code(linear[0], 2047) | code(linear[1], 2047) << 11 | code(linear[2], 1023) << 22;
}
inline Eigen::Vector3f UnpackColor(uint32_t packed) {
  const Eigen::Vector3f root(static_cast<float>(packed & 2047u) / 2047,
                             static_cast<float>(packed >> 11 & 2047u) / 2047,
                             static_cast<float>(packed >> 22) / 1023);
  return root.cwiseProduct(root);
}

// A weight > 0 to three digits in 16 bits; a larger weight has a larger code.
inline uint16_t PackWeight(float weight) {
  uint32_t bits;
  std::memcpy(&bits, &weight, sizeof bits);
  return static_cast<uint16_t>(std::max<uint32_t>(bits >> 15, 1u) & 0xffffu);
}
inline float UnpackWeight(uint16_t code) {
  const uint32_t bits = static_cast<uint32_t>(code) << 15;
  float weight;
  std::memcpy(&weight, &bits, sizeof weight);
  return weight;
}

struct Observation {
  Observation() : photo(0), at_boundary(0), in_doubt(0) {}
  uint32_t color = 0;   // PackColor, as photographed
  uint16_t weight = 0;  // PackWeight; 0 = empty
  uint16_t photo : 14;  // number of the photo
  // Near a depth boundary of what the photo sees, Sight::kBoundary or less: the colour may be that
  // of another surface.
  uint16_t at_boundary : 1;
  uint16_t in_doubt : 1;  // something unseen may stand in front: Sight::kShadow or kFringe
};
inline constexpr int kMaxPhotos = 1 << 14;
static_assert(sizeof(Observation) == 8, "memory per sample is counted on this");

// The best observations of every sample: of more than `capacity` photos those with the largest
// weights (of equal weights the photo that comes first), so that memory is bounded by the scan.
// What is in doubt comes last.
class ObservationStore {
 public:
  ObservationStore(size_t num_samples, int capacity)
      : capacity_(capacity), kept_(num_samples * capacity), counts_(num_samples) {}

  // Not for the same sample from two threads; the order of adding does not change the set that is
  // kept.
  void Add(size_t sample, const Observation& observation) {
    Counts& counts = counts_[sample];
    uint8_t& count = observation.in_doubt != 0 ? counts.in_doubt : counts.clear;
    if (count < UINT8_MAX) ++count;
    Observation* const first = &kept_[sample * capacity_];
    // Kept in order, best first.
    int place = capacity_;
    while (place > 0 && IsBetter(observation, first[place - 1])) --place;
    if (place == capacity_) return;
    for (int i = capacity_ - 1; i > place; --i) first[i] = first[i - 1];
    first[place] = observation;
  }

  // To correct colours in place; the weights stay.
  Observation* MutableBegin(size_t sample) { return &kept_[sample * capacity_]; }
  // Best first; Count() of them.
  const Observation* Begin(size_t sample) const { return &kept_[sample * capacity_]; }
  int Count(size_t sample) const {
    return std::min(counts_[sample].clear + counts_[sample].in_doubt, capacity_);
  }
  // The photos that see the sample, also those that were not kept, at most 255: those in doubt only
  // where all are.
  int NumViews(size_t sample) const {
    return counts_[sample].clear > 0 ? counts_[sample].clear : counts_[sample].in_doubt;
  }
  size_t num_samples() const { return counts_.size(); }

 private:
  static bool IsBetter(const Observation& a, const Observation& b) {
    if (b.weight == 0) return true;  // an empty place
    if (a.in_doubt != b.in_doubt) return a.in_doubt < b.in_doubt;
    return a.weight != b.weight ? a.weight > b.weight : a.photo < b.photo;
  }

  struct Counts {
    uint8_t clear = 0, in_doubt = 0;
  };

  int capacity_;  // at most 255, which is all that is counted
  std::vector<Observation> kept_;
  std::vector<Counts> counts_;
};

}  // namespace roomtex
