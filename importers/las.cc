#include "importers/las.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "core/resource_limits.h"
#include "core/text.h"
#include "importers/file_reader.h"
#include "importers/mesh_scan.h"

namespace roomtex {
namespace {

constexpr int64_t kLeastHeader = 227, kHeader14 = 375;
constexpr char kLasDamaged[] = "The file is damaged: export it again";
constexpr int64_t kLasBlock = 1 << 20;  // bytes read at once, about

struct LasPointFormat {
  int size;    // bytes, at least
  int colors;  // where red, green, blue begin; -1 = none
};
constexpr LasPointFormat kPointFormats[] = {{20, -1}, {28, -1}, {26, 20}, {34, 28},
                                            {57, -1}, {63, 28}, {30, -1}, {36, 30},
                                            {38, 30}, {59, -1}, {67, 30}};
constexpr int kFirstOfLas14 = 6;  // from here on flags have a byte of their own

template <typename T>
T ValueAt(const char* bytes) {  // little-endian, as this machine
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

struct LasHeader {
  int format = 0;
  int64_t record_size = 0, offset = 0, count = 0;
  Eigen::Vector3d scale, shift, middle;
};

LasHeader ReadLasHeader(const FileReader& file) {
  const auto fail = [&file](int64_t at, const std::string& finding,
                            const std::string& remedy = kLasDamaged) {
    throw InputError(file.path(), BytePosition(at), finding, remedy);
  };
  std::string bytes = file.ReadSome(0, kHeader14);
  if (static_cast<int64_t>(bytes.size()) < kLeastHeader) {
    fail(file.size(), "the file ends within the header", "The file is cut off: copy it again");
  }
  bytes.resize(kHeader14, '\0');
  const auto byte = [&bytes](size_t at) { return static_cast<uint8_t>(bytes[at]); };
  const int major = byte(24), minor = byte(25);
  if (major != 1 || minor > 4) {
    fail(24,
         "is LAS " + std::to_string(major) + "." + std::to_string(minor) + ", expected 1.0 to 1.4",
         "Export it as LAS 1.4 or 1.2");
  }
  LasHeader header;
  if ((byte(104) & 0xc0) != 0) {
    throw InputError(file.path(), "", "is compressed (LAZ)",
                     "Decompress it: laszip -i IN.laz -o OUT.las, pdal translate IN.laz OUT.las, "
                     "or save it as .las with CloudCompare as it comes from its makers (Debian 12 "
                     "has no package that can)");
  }
  header.format = byte(104);
  if (header.format > 10) {
    fail(104, "the points are of format " + std::to_string(header.format) + ", expected 0 to 10",
         "Export it as LAS 1.4 or 1.2");
  }
  header.record_size = ValueAt<uint16_t>(&bytes[105]);
  const int least = kPointFormats[header.format].size;
  if (header.record_size < least) {
    fail(105, "a point has " + std::to_string(header.record_size) + " bytes, expected at least " +
                  std::to_string(least) + " of format " + std::to_string(header.format));
  }
  header.offset = ValueAt<uint32_t>(&bytes[96]);
  if (header.offset < kLeastHeader || header.offset > file.size()) {
    fail(96, "the points begin at byte " + std::to_string(header.offset) + " of " +
                 std::to_string(file.size()));
  }
  uint64_t count = ValueAt<uint32_t>(&bytes[107]);
  if (minor == 4 && ValueAt<uint16_t>(&bytes[94]) >= kHeader14) {
    const auto long_count = ValueAt<uint64_t>(&bytes[247]);
    if (long_count > 0) count = long_count;
  }
  const auto fitting = static_cast<uint64_t>((file.size() - header.offset) / header.record_size);
  if (count > fitting) {
    fail(107,
         "says " + std::to_string(count) + " points, the rest of the file holds " +
             std::to_string(fitting),
         "The file is cut off: copy it again");
  }
  if (count > static_cast<uint64_t>(std::numeric_limits<int>::max())) {
    fail(107, "says " + std::to_string(count) + " points",
         "More than 2147483647 are not read: thin it out");
  }
  header.count = static_cast<int64_t>(count);
  for (int k = 0; k < 3; ++k) {
    header.scale[k] = ValueAt<double>(&bytes[131 + 8 * static_cast<size_t>(k)]);
    header.shift[k] = ValueAt<double>(&bytes[155 + 8 * static_cast<size_t>(k)]);
    const double high = ValueAt<double>(&bytes[179 + 16 * static_cast<size_t>(k)]);
    const double low = ValueAt<double>(&bytes[187 + 16 * static_cast<size_t>(k)]);
    header.middle[k] = 0.5 * (low + high);
    // A negative one is unusual, but the format has only the product.
    if (header.scale[k] == 0 || !(std::abs(header.scale[k]) < 1e6)) {
      fail(131 + 8 * k, "the scale is " + Exact(header.scale[k]));
    }
    if (!(std::abs(header.shift[k]) < 1e12)) fail(155 + 8 * k, "the offset is no number");
  }
  return header;
}

}  // namespace

bool LooksLikeLas(std::string_view start) { return start.substr(0, 4) == "LASF"; }

Scan ReadLas(const std::string& path, const LasOptions& options) {
  const FileReader file(path);
  const LasHeader header = ReadLasHeader(file);
  RequireMemoryForSamples(path, static_cast<double>(header.count));
  Scan scan;
  scan.path = path;
  scan.organised = false;
  scan.up = Eigen::Vector3d::UnitZ();
  scan.up_is_assumed = true;
  scan.station_is_assumed = true;
  scan.points.reserve(static_cast<size_t>(header.count));
  scan.intensity.reserve(static_cast<size_t>(header.count));
  std::vector<float> greys;
  const int colors = kPointFormats[header.format].colors;
  const bool keeps_colors = options.colors && colors >= 0;
  ColorScale color_scale(255);  // some programs write bytes
  if (keeps_colors) scan.colors.reserve(static_cast<size_t>(header.count));
  const char withheld = static_cast<char>(header.format < kFirstOfLas14 ? 0x80 : 0x04);
  const int64_t per_block = std::max<int64_t>(1, kLasBlock / header.record_size);
  std::string block;
  bool has_intensity = false;
  for (int64_t first = 0; first < header.count; first += per_block) {
    const int64_t count = std::min(per_block, header.count - first);
    block.resize(static_cast<size_t>(count * header.record_size));
    file.Read(header.offset + first * header.record_size, block.data(),
              static_cast<int64_t>(block.size()));
    for (int64_t i = 0; i < count; ++i) {
      const char* const record = block.data() + i * header.record_size;
      if ((record[15] & withheld) != 0) {
        ++scan.num_left_out;
        continue;
      }
      Eigen::Vector3d point;
      for (int k = 0; k < 3; ++k) {
        point[k] = header.shift[k] + header.scale[k] * ValueAt<int32_t>(record + 4 * k);
      }
      if (options.max_range > 0 &&
          !(options.meters_per_unit * (point - header.middle).norm() <= options.max_range)) {
        ++scan.num_left_out;
        continue;
      }
      scan.points.push_back(options.meters_per_unit * point);
      const auto intensity = ValueAt<uint16_t>(record + 12);
      has_intensity = has_intensity || intensity > 0;
      scan.intensity.push_back(intensity);
      if (colors < 0 || (has_intensity && !keeps_colors)) continue;
      const char* const at = record + colors;
      const Eigen::Vector3d color(ValueAt<uint16_t>(at), ValueAt<uint16_t>(at + 2),
                                  ValueAt<uint16_t>(at + 4));
      if (keeps_colors) scan.colors.push_back(color_scale.Bytes(color, &scan.colors));
      if (has_intensity) continue;
      greys.resize(scan.points.size() - 1, 0.0f);
      greys.push_back(static_cast<float>(GreyOf(color)));
    }
  }
  if (scan.points.empty()) {
    throw InputError(path, "", "holds no point",
                     options.max_range > 0 ? "Give a larger --max_range" : "Give another file");
  }
  if (!has_intensity && greys.size() == scan.points.size()) scan.intensity = std::move(greys);
  scan.num_columns = static_cast<int>(scan.points.size());
  scan.num_rows = 1;
  return scan;
}

}  // namespace roomtex
