#pragma once
// Tells whether two files hold the same bytes, whatever they are called.

#include <cstdint>
#include <string>
#include <string_view>

namespace roomtex {

// XXH64 with seed 0 (https://github.com/Cyan4973/xxHash, doc/xxhash_spec.md): as fast as the file
// is read, and what the program xxh64sum prints. Against accidents, not against forgers.
class ContentHash {
 public:
  void Add(std::string_view bytes);
  uint64_t Value() const;

 private:
  static constexpr int kLanes = 4;
  static constexpr size_t kStripe = 32;  // bytes
  void AddStripe(const char* bytes);

  uint64_t lanes_[kLanes] = {0x60ea27eeadc0b5d6ULL, 0xc2b2ae3d27d4eb4fULL, 0,
                             0x61c8864e7a143579ULL};  // as the specification starts them
  uint64_t num_bytes_ = 0;
  char rest_[kStripe] = {};  // bytes that fill no stripe yet
  size_t num_rest_ = 0;
};

// "xxh64:" and 16 hexadecimal digits, read in blocks. Throws InputError.
std::string HashOfFile(const std::string& path);

}  // namespace roomtex
