#pragma once
// Numbers in the binary part of a glTF file, and the files that it links to.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "importers/file_reader.h"

namespace roomtex {

// The numbers of one accessor as floats or indices, to be read from the first to the last.
struct GltfElements {
  const FileReader* file = nullptr;
  int64_t begin = 0;  // in the file
  size_t count = 0, stride = 0, size = 0;
  int type = 0, components = 0;
  bool normalized = false;
  // What is in memory of it.
  mutable std::vector<char> block;
  mutable size_t first = 0, end = 0;

  const char* At(size_t i) const;
  template <typename T>
  T As(size_t i, int k) const {
    T value;
    std::memcpy(&value, At(i) + static_cast<size_t>(k) * sizeof(T), sizeof(T));
    return value;
  }
  float Float(size_t i, int k) const;
  uint32_t Index(size_t i) const;
};

// The path that a link names (RFC 3986): "my%20room/model.glb" is "my room/model.glb".
std::string PathOfLink(const std::string& link);

}  // namespace roomtex
