#include "importers/ply_values.h"

#include <algorithm>
#include <cstring>
#include <string_view>

#include "core/error.h"

namespace roomtex {
namespace {

class AsciiSource : public PlyValues {
 public:
  AsciiSource(const FileReader& file, const PlyHeader& header)
      : path_(file.path()), lines_(file, header.body_offset), header_lines_(header.num_lines) {}

  void BeginEntry() override {
    do {
      if (!lines_.Next(&rest_)) {
        throw InputError(path_, LinePosition(header_lines_ + lines_.line_number() + 1),
                         "the file ends, expected another line of numbers",
                         "The file is cut off: copy it again");
      }
      line_ = rest_;
      SkipBlanks();
    } while (rest_.empty());
  }
  double Next(PlyType) override {
    SkipBlanks();
    const size_t size = std::min(rest_.find_first_of(" \t"), rest_.size());
    double value = 0;
    if (!ParseReal(rest_.substr(0, size), &value)) {
      throw InputError(path_, Position(),
                       "is " + Quoted(line_) + ", which lacks a number or holds something else",
                       RemedyForLine(line_));
    }
    rest_.remove_prefix(size);
    return value;
  }
  void EndEntry() override {
    SkipBlanks();
    if (!rest_.empty()) {
      throw InputError(path_, Position(),
                       "is " + Quoted(line_) +
                           ", which has more numbers than the "
                           "header says",
                       kDamaged);
    }
  }
  void EndFile() override {
    std::string_view line;
    while (lines_.Next(&line)) {
      if (line.find_first_not_of(" \t") != std::string_view::npos) {
        throw InputError(path_, Position(), "is " + Quoted(line) + ", expected the end of the file",
                         kDamaged);
      }
    }
  }
  int64_t BytesLeft() const override {
    return lines_.BytesLeft() + static_cast<int64_t>(rest_.size());
  }
  std::string Position() const override {
    return LinePosition(header_lines_ + lines_.line_number());
  }

 private:
  void SkipBlanks() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t"), rest_.size())); }

  std::string path_;
  LineReader lines_;
  long header_lines_;
  std::string_view line_, rest_;
};

class BinarySource : public PlyValues {
 public:
  BinarySource(const FileReader& file, const PlyHeader& header)
      : file_(file), swap_(header.format == "big"), block_offset_(header.body_offset) {}

  void BeginEntry() override { entry_offset_ = Offset(); }
  double Next(PlyType type) override {
    const size_t size = static_cast<size_t>(PlyTypeSize(type));
    if (end_ - begin_ < size) Refill(size);
    char bytes[8];
    std::memcpy(bytes, block_.data() + begin_, size);
    if (swap_) std::reverse(bytes, bytes + size);
    begin_ += size;
    const auto as = [&bytes](auto value) {
      std::memcpy(&value, bytes, sizeof(value));
      return static_cast<double>(value);
    };
    switch (type) {
      case PlyType::kInt8:
        return as(int8_t{});
      case PlyType::kUint8:
        return as(uint8_t{});
      case PlyType::kInt16:
        return as(int16_t{});
      case PlyType::kUint16:
        return as(uint16_t{});
      case PlyType::kInt32:
        return as(int32_t{});
      case PlyType::kUint32:
        return as(uint32_t{});
      case PlyType::kFloat:
        return as(float{});
      default:
        return as(double{});
    }
  }
  void EndEntry() override {}
  void EndFile() override {
    if (BytesLeft() == 0) return;
    throw InputError(file_.path(), BytePosition(Offset()),
                     std::to_string(BytesLeft()) +
                         " bytes follow the last element, expected the end "
                         "of the file",
                     kDamaged);
  }
  int64_t BytesLeft() const override { return file_.size() - Offset(); }
  std::string Position() const override { return BytePosition(entry_offset_); }

 private:
  int64_t Offset() const { return block_offset_ + static_cast<int64_t>(begin_); }
  void Refill(size_t wanted) {
    const int64_t offset = Offset();
    if (BytesLeft() < static_cast<int64_t>(wanted)) {
      throw InputError(file_.path(), BytePosition(file_.size()), "the file ends within the data",
                       "The file is cut off: copy it again");
    }
    block_ = file_.ReadSome(offset, 1 << 20);
    block_offset_ = offset;
    begin_ = 0;
    end_ = block_.size();
  }

  const FileReader& file_;
  bool swap_;
  std::string block_;
  size_t begin_ = 0, end_ = 0;
  int64_t block_offset_ = 0, entry_offset_ = 0;
};

}  // namespace

std::unique_ptr<PlyValues> ReadPlyValues(const FileReader& file, const PlyHeader& header) {
  if (header.format == "ascii") return std::make_unique<AsciiSource>(file, header);
  return std::make_unique<BinarySource>(file, header);
}

}  // namespace roomtex
