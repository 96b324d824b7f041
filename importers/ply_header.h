#pragma once
// The ASCII header of a PLY file (ply.h).

#include <cstdint>
#include <string>
#include <vector>

#include "importers/file_reader.h"

namespace roomtex {

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };
int PlyTypeSize(PlyType type);  // bytes

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat;  // of the value, or of the items of a list
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;
};

struct PlyElement {
  std::string name;
  int64_t count = 0;
  long line = 0;  // of the header
  std::vector<PlyProperty> properties;

  // Index of the property with one of the names, -1 if there is none.
  int Find(const std::vector<std::string>& names) const;
};

struct PlyHeader {
  std::string format;  // "ascii", "little" or "big"
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  // without the word "comment"
  int64_t body_offset = 0;
  long num_lines = 0;
};

// Throws InputError with the line. Every element's count is compared with the bytes that follow.
PlyHeader ReadPlyHeader(const FileReader& file);

}  // namespace roomtex
