#pragma once
// The body of a PLY file (ply.h), value by value: text or binary of either byte order.

#include <cstdint>
#include <memory>
#include <string>

#include "importers/file_reader.h"
#include "importers/ply_header.h"

namespace roomtex {

// Throw InputError with the line or byte where the file ends too early or holds something else.
class PlyValues {
 public:
  virtual ~PlyValues() = default;
  virtual void BeginEntry() = 0;
  virtual double Next(PlyType type) = 0;
  virtual void EndEntry() = 0;
  virtual void EndFile() = 0;
  virtual int64_t BytesLeft() const = 0;
  virtual std::string Position() const = 0;  // of the entry read last
};

// The file and its header must outlive it.
std::unique_ptr<PlyValues> ReadPlyValues(const FileReader& file, const PlyHeader& header);

}  // namespace roomtex
