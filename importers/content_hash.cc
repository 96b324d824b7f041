#include "importers/content_hash.h"

#include <algorithm>
#include <cstring>

#include <fmt/core.h>

#include "importers/file_reader.h"

namespace roomtex {
namespace {

// The primes of the specification.
constexpr uint64_t kPrime1 = 0x9e3779b185ebca87ULL, kPrime2 = 0xc2b2ae3d27d4eb4fULL,
                   kPrime3 = 0x165667b19e3779f9ULL, kPrime4 = 0x85ebca77c2b2ae63ULL,
                   kPrime5 = 0x27d4eb2f165667c5ULL;
constexpr int64_t kBlock = 1 << 20;  // bytes that are read at once

uint64_t Rotated(uint64_t value, int bits) { return value << bits | value >> (64 - bits); }

// Little-endian, whatever the machine is.
template <typename Word>
uint64_t WordAt(const char* bytes) {
  uint64_t value = 0;
  for (size_t i = 0; i < sizeof(Word); ++i) {
    value |= static_cast<uint64_t>(static_cast<unsigned char>(bytes[i])) << (8 * i);
  }
  return value;
}

uint64_t Round(uint64_t lane, uint64_t word) {
  return Rotated(lane + word * kPrime2, 31) * kPrime1;
}

uint64_t Finished(uint64_t hash, const char* rest, size_t num_rest) {
  while (num_rest >= 8) {
    hash = Rotated(hash ^ Round(0, WordAt<uint64_t>(rest)), 27) * kPrime1 + kPrime4;
    rest += 8;
    num_rest -= 8;
  }
  if (num_rest >= 4) {
    hash = Rotated(hash ^ (WordAt<uint32_t>(rest) * kPrime1), 23) * kPrime2 + kPrime3;
    rest += 4;
    num_rest -= 4;
  }
  for (; num_rest > 0; --num_rest, ++rest) {
    hash = Rotated(hash ^ (WordAt<uint8_t>(rest) * kPrime5), 11) * kPrime1;
  }
  hash = (hash ^ hash >> 33) * kPrime2;
  hash = (hash ^ hash >> 29) * kPrime3;
  return hash ^ hash >> 32;
}

}  // namespace

void ContentHash::AddStripe(const char* bytes) {
  for (int i = 0; i < kLanes; ++i) {
    lanes_[i] = Round(lanes_[i], WordAt<uint64_t>(bytes + static_cast<size_t>(8) * i));
  }
}

void ContentHash::Add(std::string_view bytes) {
  num_bytes_ += bytes.size();
  while (!bytes.empty()) {
    if (num_rest_ == 0 && bytes.size() >= kStripe) {
      AddStripe(bytes.data());
      bytes.remove_prefix(kStripe);
      continue;
    }
    const size_t taken = std::min(kStripe - num_rest_, bytes.size());
    std::memcpy(rest_ + num_rest_, bytes.data(), taken);
    num_rest_ += taken;
    bytes.remove_prefix(taken);
    if (num_rest_ < kStripe) continue;
    AddStripe(rest_);
    num_rest_ = 0;
  }
}

uint64_t ContentHash::Value() const {
  uint64_t hash = kPrime5;
  if (num_bytes_ >= kStripe) {
    hash = Rotated(lanes_[0], 1) + Rotated(lanes_[1], 7) + Rotated(lanes_[2], 12) +
           Rotated(lanes_[3], 18);
    for (const uint64_t lane : lanes_) hash = (hash ^ Round(0, lane)) * kPrime1 + kPrime4;
  }
  return Finished(hash + num_bytes_, rest_, num_rest_);
}

std::string HashOfFile(const std::string& path) {
  const FileReader file(path);
  ContentHash hash;
  for (int64_t at = 0; at < file.size(); at += kBlock) hash.Add(file.ReadSome(at, kBlock));
  return fmt::format("xxh64:{:016x}", hash.Value());
}

}  // namespace roomtex
