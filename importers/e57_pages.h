#pragma once
// The lowest layer of an E57 file (ASTM E2807): pages with checksums, and what lies in them as one
// sequence of bytes.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "importers/file_reader.h"

namespace roomtex {

// CRC-32C (Castagnoli) of the bytes, as RFC 3720 B.4 has it; E57 stores it with the highest byte
// first.
uint32_t Crc32c(std::string_view bytes);

// The file is a row of pages that end with four bytes of checksum each. Physical offsets count
// these bytes, logical ones do not. Errors are InputErrors with the physical byte.
class E57Pages {
 public:
  static constexpr int64_t kHeaderSize = 48;   // bytes
  static constexpr int64_t kChecksumSize = 4;  // bytes at the end of a page

  // Reads the header. check: compare the checksum of every page of the file.
  E57Pages(const std::string& path, bool check);

  const std::string& path() const { return file_.path(); }
  int64_t logical_size() const { return logical_size_; }
  int64_t xml_offset() const { return xml_offset_; }  // logical
  int64_t xml_size() const { return xml_size_; }

  // what: of the thing that is said to lie there, for the message. Throws when the offset lies
  // behind the end or in a checksum.
  int64_t LogicalFromPhysical(uint64_t offset, const std::string& what) const;
  int64_t PhysicalFromLogical(int64_t offset) const;

  // Exactly num_bytes from a logical offset on. Fast when one call continues the other.
  void Read(int64_t offset, void* target, int64_t num_bytes) const;
  // "byte N" of a logical offset.
  std::string Position(int64_t offset) const;

 private:
  void ReadHeader();
  void CheckPages() const;
  void LoadBlock(int64_t first_page) const;
  InputError Error(int64_t byte, const std::string& finding) const;

  FileReader file_;
  int64_t page_size_ = 0, payload_ = 0, num_pages_ = 0;
  int64_t logical_size_ = 0, xml_offset_ = 0, xml_size_ = 0;
  // The pages read last, without their checksums.
  mutable std::vector<char> block_;
  mutable int64_t block_offset_ = 0, block_size_ = 0;  // logical
};

// A little-endian number at `bytes`.
template <typename Number>
Number LittleEndian(const void* bytes) {
  const auto* at = static_cast<const unsigned char*>(bytes);
  Number number = 0;
  for (size_t i = sizeof(Number); i-- > 0;) number = static_cast<Number>(number << 8 | at[i]);
  return number;
}

// The start of a file is that of an E57.
bool LooksLikeE57(std::string_view start);

}  // namespace roomtex
