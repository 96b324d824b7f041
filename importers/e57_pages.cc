#include "importers/e57_pages.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace roomtex {
namespace {

constexpr char kE57Magic[] = "ASTM-E57";
constexpr int64_t kE57MagicSize = 8;
// The standard knows 1024 only.
constexpr uint64_t kSmallestPage = 64, kLargestPage = 1 << 20;
constexpr int64_t kReadAtOnce = 1 << 20;  // bytes that are read at once
constexpr int64_t kLargestXml = 50 << 20;

// Eight tables, so that eight bytes are taken at once ("slicing by 8", Kounavis and Berry 2005).
using CrcTables = std::array<std::array<uint32_t, 256>, 8>;

constexpr CrcTables MakeCrcTables() {
  CrcTables tables{};
  for (uint32_t byte = 0; byte < 256; ++byte) {
    uint32_t crc = byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0x82f63b78u : 0u);
    tables[0][byte] = crc;
  }
  for (uint32_t byte = 0; byte < 256; ++byte) {
    for (size_t k = 1; k < 8; ++k) {
      const uint32_t crc = tables[k - 1][byte];
      tables[k][byte] = (crc >> 8) ^ tables[0][crc & 0xff];
    }
  }
  return tables;
}

constexpr CrcTables kCrc = MakeCrcTables();

uint32_t BigEndian32(const char* bytes) {
  const auto* at = reinterpret_cast<const unsigned char*>(bytes);
  return static_cast<uint32_t>(at[0]) << 24 | static_cast<uint32_t>(at[1]) << 16 |
         static_cast<uint32_t>(at[2]) << 8 | at[3];
}

}  // namespace

uint32_t Crc32c(std::string_view bytes) {
  uint32_t crc = 0xffffffffu;
  const char* at = bytes.data();
  size_t left = bytes.size();
  for (; left >= 8; at += 8, left -= 8) {
    const uint32_t low = LittleEndian<uint32_t>(at) ^ crc;
    const uint32_t high = LittleEndian<uint32_t>(at + 4);
    crc = kCrc[7][low & 0xff] ^ kCrc[6][(low >> 8) & 0xff] ^ kCrc[5][(low >> 16) & 0xff] ^
          kCrc[4][low >> 24] ^ kCrc[3][high & 0xff] ^ kCrc[2][(high >> 8) & 0xff] ^
          kCrc[1][(high >> 16) & 0xff] ^ kCrc[0][high >> 24];
  }
  for (; left > 0; ++at, --left) {
    crc = (crc >> 8) ^ kCrc[0][(crc ^ static_cast<unsigned char>(*at)) & 0xff];
  }
  return ~crc;
}

bool LooksLikeE57(std::string_view start) {
  return start.substr(0, kE57MagicSize) == std::string_view(kE57Magic, kE57MagicSize);
}

E57Pages::E57Pages(const std::string& path, bool check) : file_(path) {
  ReadHeader();
  if (check) CheckPages();
}

InputError E57Pages::Error(int64_t byte, const std::string& finding) const {
  return InputError(path(), BytePosition(byte), finding, kDamaged);
}

void E57Pages::ReadHeader() {
  const std::string header = file_.ReadSome(0, kHeaderSize);
  if (!LooksLikeE57(header)) throw Error(0, "begins with " + Quoted(header) + ", not ASTM-E57");
  if (static_cast<int64_t>(header.size()) < kHeaderSize) {
    throw Error(static_cast<int64_t>(header.size()), "the file ends in its header of 48 bytes");
  }
  const auto number = [&](size_t at) { return LittleEndian<uint64_t>(&header[at]); };
  const auto major = LittleEndian<uint32_t>(&header[8]);
  if (major != 1) throw Error(8, "says version " + std::to_string(major) + ", expected 1");
  const uint64_t size = number(16), page_size = number(40);
  if (page_size < kSmallestPage || page_size > kLargestPage || page_size % 4 != 0) {
    throw Error(40, "says pages of " + std::to_string(page_size) + " bytes, expected 1024");
  }
  if (size > static_cast<uint64_t>(file_.size())) {
    throw InputError(path(), BytePosition(16),
                     "says that the file has " + std::to_string(size) + " bytes, but it has " +
                         std::to_string(file_.size()),
                     "The file is cut off: copy it again");
  }
  if (size < page_size || size % page_size != 0) {
    throw Error(16, "says that the file has " + std::to_string(size) +
                        " bytes, expected pages of " + std::to_string(page_size));
  }
  page_size_ = static_cast<int64_t>(page_size);
  payload_ = page_size_ - kChecksumSize;
  num_pages_ = static_cast<int64_t>(size) / page_size_;
  logical_size_ = num_pages_ * payload_;
  xml_offset_ = LogicalFromPhysical(number(24), "the XML");
  const uint64_t xml_size = number(32);
  if (xml_size > static_cast<uint64_t>(logical_size_ - xml_offset_)) {
    throw Error(32, "says that the XML has " + std::to_string(xml_size) + " bytes, but only " +
                        std::to_string(logical_size_ - xml_offset_) + " follow its beginning");
  }
  if (xml_size > static_cast<uint64_t>(kLargestXml)) {
    throw InputError(path(), BytePosition(32),
                     "says that the XML has " + std::to_string(xml_size) + " bytes",
                     "More than 50 MB are not read: write the scans to several files");
  }
  xml_size_ = static_cast<int64_t>(xml_size);
}

void E57Pages::CheckPages() const {
  const int64_t pages_at_once = std::max<int64_t>(1, kReadAtOnce / page_size_);
  std::vector<char> bytes(static_cast<size_t>(std::min(pages_at_once, num_pages_) * page_size_));
  for (int64_t first = 0; first < num_pages_; first += pages_at_once) {
    const int64_t count = std::min(pages_at_once, num_pages_ - first);
    file_.Read(first * page_size_, bytes.data(), count * page_size_);
    for (int64_t k = 0; k < count; ++k) {
      const char* page = bytes.data() + k * page_size_;
      if (Crc32c({page, static_cast<size_t>(payload_)}) == BigEndian32(page + payload_)) continue;
      throw InputError(path(), BytePosition((first + k) * page_size_),
                       "the checksum of page " + std::to_string(first + k) + " (of " +
                           std::to_string(num_pages_) + ", from 0) is wrong",
                       "The file is damaged: copy it again, or read it as it is with "
                       "--E57.check 0");
    }
  }
}

int64_t E57Pages::LogicalFromPhysical(uint64_t offset, const std::string& what) const {
  const auto page_size = static_cast<uint64_t>(page_size_);
  if (offset / page_size >= static_cast<uint64_t>(num_pages_)) {
    throw Error(0, what + " is said to lie at byte " + std::to_string(offset) +
                       ", behind the end of the file");
  }
  if (offset % page_size >= static_cast<uint64_t>(payload_)) {
    throw Error(static_cast<int64_t>(offset), what + " is said to lie in a checksum");
  }
  return static_cast<int64_t>(offset / page_size) * payload_ +
         static_cast<int64_t>(offset % page_size);
}

int64_t E57Pages::PhysicalFromLogical(int64_t offset) const {
  return offset / payload_ * page_size_ + offset % payload_;
}

std::string E57Pages::Position(int64_t offset) const {
  return BytePosition(PhysicalFromLogical(offset));
}

void E57Pages::LoadBlock(int64_t first_page) const {
  const int64_t pages_at_once = std::max<int64_t>(1, kReadAtOnce / page_size_);
  const int64_t count = std::min(pages_at_once, num_pages_ - first_page);
  block_.resize(static_cast<size_t>(count * page_size_));
  file_.Read(first_page * page_size_, block_.data(), count * page_size_);
  for (int64_t k = 1; k < count; ++k) {
    std::memmove(block_.data() + k * payload_, block_.data() + k * page_size_,
                 static_cast<size_t>(payload_));
  }
  block_offset_ = first_page * payload_;
  block_size_ = count * payload_;
}

void E57Pages::Read(int64_t offset, void* target, int64_t num_bytes) const {
  if (offset < 0 || num_bytes < 0 || num_bytes > logical_size_ - offset) {
    throw Error(PhysicalFromLogical(logical_size_),
                "the file ends, expected " + std::to_string(num_bytes) + " bytes from byte " +
                    std::to_string(PhysicalFromLogical(offset)));
  }
  char* bytes = static_cast<char*>(target);
  while (num_bytes > 0) {
    if (offset < block_offset_ || offset >= block_offset_ + block_size_) {
      LoadBlock(offset / payload_);
    }
    const int64_t at = offset - block_offset_;
    const int64_t count = std::min(num_bytes, block_size_ - at);
    std::memcpy(bytes, block_.data() + at, static_cast<size_t>(count));
    bytes += count, offset += count, num_bytes -= count;
  }
}

}  // namespace roomtex
