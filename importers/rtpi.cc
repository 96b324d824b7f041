#include "importers/rtpi.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "core/output_file.h"
#include "importers/file_reader.h"

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the bytes of samples are read in place");
static_assert(sizeof(roomtex::RtpiSample) == 16, "samples are read in place");

namespace roomtex {
namespace {

uint32_t SwapIfBig(uint32_t bits, ByteOrder order) {
  return order == ByteOrder::kBig ? __builtin_bswap32(bits) : bits;
}

// Big-endian samples in place, from or to the order of this machine. Colours are single bytes.
void SwapSamples(RtpiSample* samples, int64_t num_samples, bool has_color) {
  for (int64_t i = 0; i < num_samples; ++i) {
    uint32_t words[4];
    std::memcpy(words, &samples[i], sizeof(words));
    for (int k = 0; k < (has_color ? 3 : 4); ++k) words[k] = __builtin_bswap32(words[k]);
    std::memcpy(&samples[i], words, sizeof(words));
  }
}

// What following the column counts through the file in one byte order gave.
struct Walk {
  std::vector<int32_t> counts;  // of the columns that were fine
  bool complete = false;        // all columns fine and the file ends behind them
  bool saw_samples = false;     // some count was not 0
  int64_t position = 0;         // where it went wrong
  std::string finding, remedy;
};

Walk WalkColumns(const FileReader& file, const RtpiLayout& layout, ByteOrder order) {
  constexpr int64_t kWindow = 4096;
  const std::string kCutOff = "The file is cut off or damaged: copy it again";
  const int64_t limit = std::min<int64_t>(
      layout.header.max_samples_per_column.value_or(std::numeric_limits<int32_t>::max()),
      std::numeric_limits<int32_t>::max());
  Walk walk;
  walk.position = layout.body_offset;
  std::string window;
  int64_t window_offset = 0;
  for (int64_t column = 0; column < layout.num_columns; ++column) {
    const std::string where = "column " + std::to_string(column);
    const int64_t left = file.size() - walk.position;
    if (left < 4) {
      walk.finding = "the file ends before the sample count of " + where + " of " +
                     std::to_string(layout.num_columns);
      walk.remedy = kCutOff;
      return walk;
    }
    if (window.empty() || walk.position < window_offset ||
        walk.position + 4 > window_offset + static_cast<int64_t>(window.size())) {
      window_offset = walk.position;
      window = file.ReadSome(window_offset, kWindow);
    }
    uint32_t bits = 0;
    std::memcpy(&bits, window.data() + (walk.position - window_offset), 4);
    const auto count = static_cast<int32_t>(SwapIfBig(bits, order));
    if (count < 0 || count > limit) {
      walk.finding = where + " has " + std::to_string(count) + " samples, expected 0 to " +
                     std::to_string(limit);
      walk.remedy = "The file is damaged";
      return walk;
    }
    if ((left - 4) / 16 < count) {
      walk.finding = where + " has " + std::to_string(count) +
                     " samples of 16 bytes, but the file " + "ends after " +
                     std::to_string(left - 4) + " bytes";
      walk.remedy = kCutOff;
      return walk;
    }
    walk.counts.push_back(count);
    walk.saw_samples |= count != 0;
    walk.position += 4 + 16 * static_cast<int64_t>(count);
  }
  walk.complete = walk.position == file.size();
  if (!walk.complete) {
    walk.finding = std::to_string(file.size() - walk.position) + " bytes follow the last of " +
                   std::to_string(layout.num_columns) + " columns, expected the end of the file";
    walk.remedy = "The file is damaged, or num_columns in its header is wrong";
  }
  return walk;
}

// The order in which the counts make sense; throws what is wrong when they do in neither.
Walk FindByteOrder(const FileReader& file, const RtpiLayout& layout, ByteOrder* order) {
  Walk little = WalkColumns(file, layout, ByteOrder::kLittle);
  *order = ByteOrder::kLittle;
  if (little.complete) return little;
  Walk big = WalkColumns(file, layout, ByteOrder::kBig);
  if (big.complete) {
    *order = ByteOrder::kBig;
    return big;
  }
  if (!little.saw_samples && !big.saw_samples && little.counts.size() == big.counts.size() &&
      little.counts.size() < static_cast<size_t>(layout.num_columns) &&
      little.finding != big.finding) {
    throw InputError(
        file.path(), BytePosition(little.position),
        "in little-endian order " + little.finding + "; in big-endian order " + big.finding,
        "The file is damaged");
  }
  // The order in which more of the file makes sense has the better explanation.
  const bool is_big = big.saw_samples != little.saw_samples
                          ? big.saw_samples
                          : big.counts.size() > little.counts.size();
  const Walk& best = is_big ? big : little;
  throw InputError(file.path(), BytePosition(best.position), best.finding, best.remedy);
}

void CheckNumColumns(const FileReader& file, const RtpiLayout& layout) {
  const int64_t left = file.size() - layout.body_offset;
  if (layout.num_columns <= left / 4) return;
  throw InputError(file.path(), LinePosition(layout.num_columns_line),
                   "says " + std::to_string(layout.num_columns) + " columns, but only " +
                       std::to_string(left) + " bytes follow the header",
                   "The file is cut off or its header damaged");
}

}  // namespace

RtpiFile ReadRtpi(const std::string& path) {
  const FileReader reader(path);
  RtpiLayout layout = ReadRtpiHeader(reader);
  CheckNumColumns(reader, layout);
  RtpiFile file;
  file.path = path;
  const Walk walk = FindByteOrder(reader, layout, &file.byte_order);
  file.header = std::move(layout.header);
  file.body_offset = layout.body_offset;
  file.column_begin.reserve(walk.counts.size() + 1);
  for (const int32_t count : walk.counts) {
    file.column_begin.push_back(file.column_begin.back() + count);
  }
  file.samples.resize(static_cast<size_t>(file.column_begin.back()));
  // Column by column straight into place: real columns are some 30 kilobytes.
  int64_t offset = layout.body_offset;
  for (size_t c = 0; c < walk.counts.size(); ++c) {
    const int64_t num_bytes = 16 * static_cast<int64_t>(walk.counts[c]);
    reader.Read(offset + 4, file.samples.data() + file.column_begin[c], num_bytes);
    offset += 4 + num_bytes;
  }
  if (file.byte_order == ByteOrder::kBig) {
    SwapSamples(file.samples.data(), file.column_begin.back(), file.header.has_color);
  }
  return file;
}

void WriteRtpi(const RtpiFile& file, const std::string& path) {
  RtpiHeader header = file.header;
  int64_t largest = header.max_samples_per_column.value_or(0);
  for (int c = 0; c < file.NumColumns(); ++c) {
    largest = std::max(largest, file.column_begin[c + 1] - file.column_begin[c]);
  }
  OutputFile output(path);
  header.max_samples_per_column = largest;
  output.stream() << RtpiHeaderText(header, file.NumColumns());
  std::vector<RtpiSample> column;
  for (int c = 0; c < file.NumColumns(); ++c) {
    column.assign(file.samples.begin() + file.column_begin[c],
                  file.samples.begin() + file.column_begin[c + 1]);
    const uint32_t count = SwapIfBig(static_cast<uint32_t>(column.size()), file.byte_order);
    if (file.byte_order == ByteOrder::kBig) {
      SwapSamples(column.data(), static_cast<int64_t>(column.size()), file.header.has_color);
    }
    output.stream().write(reinterpret_cast<const char*>(&count), sizeof(count));
    output.stream().write(reinterpret_cast<const char*>(column.data()),
                          static_cast<std::streamsize>(16 * column.size()));
  }
  output.Commit();
}

}  // namespace roomtex
