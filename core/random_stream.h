#pragma once
// Random numbers that are the same on every machine and for every number of threads: the standard
// library fixes its generators but not its distributions, and a shared generator would depend on
// the order of work.

#include <cmath>
#include <cstdint>

#include "core/frames.h"

namespace roomtex {

// One well mixed 64-bit number per input (the finaliser of SplitMix64, Steele et al. 2014).
inline uint64_t MixBits(uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}
inline uint64_t MixBits(uint64_t a, uint64_t b) { return MixBits(MixBits(a) ^ b); }
inline uint64_t MixBits(uint64_t a, uint64_t b, uint64_t c) { return MixBits(MixBits(a, b) ^ c); }

// A stream per purpose: RandomStream(MixBits(seed, purpose, index)).
class RandomStream {
 public:
  explicit RandomStream(uint64_t seed) : state_(MixBits(seed)) {}

  uint64_t Bits() { return MixBits(state_++); }
  // [0, 1)
  double Uniform() { return static_cast<double>(Bits() >> 11) * 0x1.0p-53; }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  // 0 .. count - 1
  int Index(int count) { return static_cast<int>(Uniform() * count); }
  // Mean 0, standard deviation 1 (Box and Muller 1958; the second value is not kept, so that the
  // stream has no state but its counter).
  double Gaussian() {
    const double radius = std::sqrt(-2 * std::log(1 - Uniform()));
    return radius * std::cos(2 * kPi * Uniform());
  }

 private:
  uint64_t state_;
};

}  // namespace roomtex
