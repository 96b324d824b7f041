#include "importers/e57_records.h"

#include <algorithm>
#include <cstring>

#include "core/error.h"

namespace roomtex {
namespace {

constexpr int64_t kSectionHeaderSize = 32;  // bytes
constexpr char kPointSection = 1;
constexpr int64_t kSmallestPacket = 4;  // bytes
constexpr char kIndexPacket = 0, kDataPacket = 1, kEmptyPacket = 2;
constexpr size_t kDataHeaderSize = 6;  // bytes of a data packet before the lengths of its streams
constexpr size_t kSlack = 16;          // bytes behind a stream that may be read, not used

// The bits from `bit` on, at most 64, least significant first.
uint64_t BitsAt(const char* bytes, size_t bit, int num_bits, uint64_t mask) {
  const char* at = bytes + bit / 8;
  const int shift = static_cast<int>(bit % 8);
  uint64_t value = LittleEndian<uint64_t>(at) >> shift;
  if (num_bits + shift > 64) {
    value |= static_cast<uint64_t>(static_cast<unsigned char>(at[8])) << (64 - shift);
  }
  return value & mask;
}

template <typename Real, typename Bits>
void DecodeReals(const char* at, int64_t count, double* values) {
  for (int64_t i = 0; i < count; ++i, at += sizeof(Real)) {
    const Bits bits = LittleEndian<Bits>(at);
    Real value;
    std::memcpy(&value, &bits, sizeof(Real));
    values[i] = static_cast<double>(value);
  }
}

void DecodeIntegers(const char* bytes, size_t bit, const E57Field& field, int64_t count,
                    double* values) {
  const int num_bits = field.num_bits;
  const uint64_t mask = num_bits == 0 ? 0 : ~uint64_t{0} >> (64 - num_bits);
  const auto minimum = static_cast<uint64_t>(field.minimum);
  for (int64_t i = 0; i < count; ++i, bit += static_cast<size_t>(num_bits)) {
    const uint64_t raw = num_bits == 0 ? 0 : BitsAt(bytes, bit, num_bits, mask);
    values[i] =
        static_cast<double>(static_cast<int64_t>(raw + minimum)) * field.scale + field.offset;
  }
}

}  // namespace

int64_t E57Records::Stream::NumAvailable(int64_t at_most) const {
  if (field->num_bits == 0) return at_most;
  return std::min(at_most,
                  static_cast<int64_t>((end * 8 - begin) / static_cast<size_t>(field->num_bits)));
}

// Moves what is left to the front, where it does not cost a copy per value.
void E57Records::Stream::Append(const char* from, size_t count) {
  const size_t used = begin / 8;
  if (used > 0 && (used >= end - used || bytes.size() < end + count + kSlack)) {
    std::memmove(bytes.data(), bytes.data() + used, end - used);
    begin -= used * 8;
    end -= used;
  }
  if (bytes.size() < end + count + kSlack) bytes.resize(2 * (end + count) + kSlack);
  std::memcpy(bytes.data() + end, from, count);
  end += count;
}

void E57Records::Stream::Decode(int64_t count) {
  if (bytes.empty()) bytes.resize(kSlack);
  const char* const at = bytes.data() + begin / 8;
  if (field->type == E57Field::Type::kSingle) {
    DecodeReals<float, uint32_t>(at, count, values.data());
  } else if (field->type == E57Field::Type::kDouble) {
    DecodeReals<double, uint64_t>(at, count, values.data());
  } else {
    DecodeIntegers(bytes.data(), begin, *field, count, values.data());
  }
  begin += static_cast<size_t>(count) * static_cast<size_t>(field->num_bits);
}

E57Records::E57Records(const E57Pages& pages, const E57Points& points,
                       const std::vector<int>& fields)
    : pages_(pages), points_(points), num_records_(points.num_records) {
  for (const int field : fields) {
    Stream stream{&points.fields[static_cast<size_t>(field)],
                  static_cast<size_t>(field),
                  {},
                  0,
                  0,
                  std::vector<double>(static_cast<size_t>(std::min(kBlock, num_records_)))};
    streams_.push_back(std::move(stream));
  }
  if (num_records_ == 0) return;
  ReadSectionHeader();
  CheckRecordCount();
  const auto takes_bits = [](const E57Field& field) { return field.num_bits > 0; };
  if (std::none_of(points.fields.begin(), points.fields.end(), takes_bits)) num_records_ = 1;
}

InputError E57Records::Error(int64_t offset, const std::string& finding) const {
  return InputError(pages_.path(), pages_.Position(offset), finding, kDamaged);
}

void E57Records::ReadSectionHeader() {
  const int64_t section = points_.section;
  char header[kSectionHeaderSize];
  pages_.Read(section, header, kSectionHeaderSize);
  if (header[0] != kPointSection) {
    throw Error(section, "begins with " + std::to_string(static_cast<unsigned char>(header[0])) +
                             ", expected a section of points (1)");
  }
  const auto size = LittleEndian<uint64_t>(header + 8);
  if (size < static_cast<uint64_t>(kSectionHeaderSize) ||
      size > static_cast<uint64_t>(pages_.logical_size() - section)) {
    throw Error(section + 8, "says a section of " + std::to_string(size) + " bytes, but " +
                                 std::to_string(pages_.logical_size() - section) +
                                 " bytes are left");
  }
  section_end_ = section + static_cast<int64_t>(size);
  next_packet_ =
      pages_.LogicalFromPhysical(LittleEndian<uint64_t>(header + 16), "the data of a section");
  if (next_packet_ < section + kSectionHeaderSize || next_packet_ > section_end_) {
    throw Error(section + 16, "the data of a section do not lie in it");
  }
}

// A declared count is believed only after comparing it with the bytes.
void E57Records::CheckRecordCount() const {
  double bits = 0;
  for (const E57Field& field : points_.fields) bits += field.num_bits;
  const double bytes = static_cast<double>(section_end_ - next_packet_);
  if (bits > 0 && static_cast<double>(num_records_) * bits > 8 * bytes) {
    throw Error(points_.section,
                "the scan says " + std::to_string(num_records_) + " points, but the " +
                    std::to_string(section_end_ - next_packet_) + " bytes here hold at most " +
                    std::to_string(static_cast<int64_t>(8 * bytes / bits)));
  }
}

int64_t E57Records::Next() {
  const int64_t left = std::min(kBlock, num_records_ - num_given_);
  if (left == 0) return 0;
  while (true) {
    int64_t count = left;
    for (const Stream& stream : streams_) count = stream.NumAvailable(count);
    if (count > 0) {
      for (Stream& stream : streams_) stream.Decode(count);
      num_given_ += count;
      return count;
    }
    ReadPacket();
  }
}

void E57Records::ReadPacket() {
  const int64_t left = section_end_ - next_packet_;
  if (left < kSmallestPacket) {
    throw Error(next_packet_, "the points end here, after " + std::to_string(num_given_) + " of " +
                                  std::to_string(num_records_));
  }
  char header[kSmallestPacket];
  pages_.Read(next_packet_, header, kSmallestPacket);
  const int64_t size = LittleEndian<uint16_t>(header + 2) + 1;
  if (header[0] != kDataPacket && header[0] != kIndexPacket && header[0] != kEmptyPacket) {
    throw Error(next_packet_, "is a packet of type " +
                                  std::to_string(static_cast<unsigned char>(header[0])) +
                                  ", expected 0, 1 or 2");
  }
  if (size % 4 != 0 || size > left) {
    throw Error(next_packet_ + 2, "says a packet of " + std::to_string(size) + " bytes, " +
                                      std::to_string(left) + " are left in the section");
  }
  if (header[0] == kDataPacket) {
    packet_.resize(static_cast<size_t>(size));
    pages_.Read(next_packet_, packet_.data(), size);
    TakeStreams(packet_);
  }
  next_packet_ += size;
}

void E57Records::TakeStreams(const std::vector<char>& packet) {
  const size_t num_streams =
      packet.size() < kDataHeaderSize ? 0 : LittleEndian<uint16_t>(packet.data() + 4);
  if (num_streams == 0) return;  // how some write that there are no records
  const size_t num_fields = points_.fields.size();
  if (num_streams != num_fields || packet.size() < kDataHeaderSize + 2 * num_fields) {
    throw Error(next_packet_ + 4, "says " + std::to_string(num_streams) +
                                      " streams in a packet of " + std::to_string(packet.size()) +
                                      " bytes, expected " + std::to_string(num_fields));
  }
  std::vector<size_t> begin(num_fields + 1, kDataHeaderSize + 2 * num_fields);
  for (size_t i = 0; i < num_fields; ++i) {
    begin[i + 1] = begin[i] + LittleEndian<uint16_t>(packet.data() + kDataHeaderSize + 2 * i);
  }
  if (begin.back() > packet.size()) {
    throw Error(next_packet_, "the streams of a packet of " + std::to_string(packet.size()) +
                                  " bytes are said to end at its byte " +
                                  std::to_string(begin.back()));
  }
  for (Stream& stream : streams_) {
    const size_t at = begin[stream.number];
    stream.Append(packet.data() + at, begin[stream.number + 1] - at);
  }
}

}  // namespace roomtex
