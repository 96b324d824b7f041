#include "importers/las_writer.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "core/option_fields.h"
#include "core/output_file.h"

namespace roomtex {
namespace {

constexpr double kFinestScale = 1e-4;    // metres
constexpr size_t kLasWritten = 1 << 20;  // bytes written at once, about
constexpr size_t kRecordHead = 54;       // bytes before a record of variable length
constexpr size_t kLongRecordHead = 60;   // and before one behind the points
constexpr size_t kLongestSystem = std::numeric_limits<uint16_t>::max() - 1;  // before the points

// Where a version and its points have what.
struct LasLayout {
  uint8_t minor = 2;
  uint16_t header_size = 227;
  uint8_t format = 0, colored_format = 2;
  uint16_t record_size = 20;  // without colours, which come last
  char returns = 1 | 1 << 3;  // return 1 of 1

  uint16_t SizeOfPoint(bool has_colors) const {
    return static_cast<uint16_t>(record_size + (has_colors ? 6 : 0));
  }
};

LasLayout LayoutOf(const std::string& version) {
  if (version == "1.3") return {3, 235, 0, 2, 20, 1 | 1 << 3};
  if (version == "1.4") return {4, 375, 6, 7, 30, 1 | 1 << 4};
  return {};
}

// What all points together are.
struct LasContent {
  uint64_t count = 0;
  Bounds bounds;
  // Intensities of measured points become factor * (intensity - offset).
  float offset = 0, factor = 1;
  bool has_colors = false;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  double scale = kFinestScale;
};

// Whole numbers that 16 bits hold stay as they are, 0 to 1 becomes 0 to 65535, and so does the
// range of all others: reflectances below 0, or what is hardly above 1.
void SetIntensityRule(const std::vector<const Scan*>& scans, LasContent* content) {
  constexpr float kMost = 65535;
  float low = 0, high = 0;
  bool are_whole = true;
  for (const Scan* scan : scans) {
    for (size_t i = 0; i < scan->intensity.size(); ++i) {
      const float value = scan->intensity[i];
      if (!std::isfinite(value) || scan->IsMissing(static_cast<int>(i))) continue;
      low = std::min(low, value);
      high = std::max(high, value);
      are_whole = are_whole && value == std::round(value);
    }
  }
  if (low == high || (are_whole && low >= 0 && high > 1 && high <= kMost)) return;
  content->offset = low;
  content->factor = low >= 0 && high <= 1 ? kMost : kMost / (high - low);
}

LasContent ContentOf(const std::vector<const Scan*>& scans) {
  LasContent content;
  Bounds& all = content.bounds;
  for (const Scan* scan : scans) {
    content.has_colors = content.has_colors || !scan->colors.empty();
    content.count += scan->points.size() - static_cast<size_t>(scan->NumMissing());
    const Bounds bounds = FindBounds(*scan);
    all.min = all.min.cwiseMin(bounds.min);
    all.max = all.max.cwiseMax(bounds.max);
  }
  SetIntensityRule(scans, &content);
  if (content.count == 0) all.min = all.max = Eigen::Vector3d::Zero();
  content.shift = (0.5 * (all.min + all.max)).array().round();
  while ((all.max - all.min).maxCoeff() / content.scale > 4e9) content.scale *= 10;
  return content;
}

uint16_t LasIntensity(float value, const LasContent& content) {
  const float scaled = content.factor * (value - content.offset);
  if (!(scaled > 0)) return 0;  // also NaN
  return static_cast<uint16_t>(std::lround(std::min(65535.0f, scaled)));
}

template <typename T>
void PutAt(size_t at, T value, std::string* bytes) {  // little-endian, as this machine
  std::memcpy(bytes->data() + at, &value, sizeof value);
}

// The record of a coordinate system (R15, 2.7, 3.3 and 4.2); one behind the points may be longer.
std::string SystemRecord(const std::string& coordinate_system, bool is_behind) {
  const size_t length = coordinate_system.size() + 1;  // with a zero behind it
  std::string record(is_behind ? kLongRecordHead : kRecordHead, '\0');
  std::memcpy(record.data() + 2, "LASF_Projection", 15);
  PutAt<uint16_t>(18, 2112, &record);
  if (is_behind) {
    PutAt<uint64_t>(20, length, &record);
  } else {
    PutAt(20, static_cast<uint16_t>(length), &record);
  }
  std::memcpy(record.data() + record.size() - 32, "OGC WKT", 7);  // what it is, at the end of both
  return record + coordinate_system + '\0';
}

// Where the coordinate system stands.
enum class LasSystem { kNone, kBefore, kBehind };

std::string HeaderOf(const LasContent& content, const LasLayout& layout, size_t begin,
                     LasSystem system) {
  std::string header(layout.header_size, '\0');
  std::memcpy(header.data(), "LASF", 4);
  // The coordinate system is WKT: what the formats from 6 on ask for, also where there is none.
  constexpr uint16_t kIsWkt = 1 << 4;
  if (layout.minor == 4) PutAt(6, kIsWkt, &header);
  header[24] = 1;
  header[25] = static_cast<char>(layout.minor);
  std::memcpy(header.data() + 58, "roomtex", 7);
  PutAt(94, layout.header_size, &header);
  PutAt(96, static_cast<uint32_t>(begin), &header);
  PutAt<uint32_t>(100, system == LasSystem::kBefore ? 1 : 0, &header);
  header[104] = static_cast<char>(content.has_colors ? layout.colored_format : layout.format);
  PutAt(105, layout.SizeOfPoint(content.has_colors), &header);
  for (size_t k = 0; k < 3; ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    PutAt(131 + 8 * k, content.scale, &header);
    PutAt(155 + 8 * k, content.shift[axis], &header);
    PutAt(179 + 16 * k, content.bounds.max[axis], &header);
    PutAt(187 + 16 * k, content.bounds.min[axis], &header);
  }
  if (system == LasSystem::kBehind) {
    PutAt(235, begin + content.count * layout.SizeOfPoint(content.has_colors), &header);
    PutAt<uint32_t>(243, 1, &header);
  }
  // All are first returns. Of the formats from 6 on the counts of 32 bits are 0.
  if (layout.minor == 4) {
    PutAt(247, content.count, &header);
    PutAt(255, content.count, &header);
  } else {
    PutAt(107, static_cast<uint32_t>(content.count), &header);
    PutAt(111, static_cast<uint32_t>(content.count), &header);
  }
  return header;
}

// The point `i`, which is measured.
std::string RecordOf(const Scan& scan, size_t i, const LasContent& content,
                     const LasLayout& layout) {
  std::string record(layout.SizeOfPoint(content.has_colors), '\0');
  for (size_t k = 0; k < 3; ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    const double steps = (scan.points[i][axis] - content.shift[axis]) / content.scale;
    PutAt(4 * k, static_cast<int32_t>(std::lround(steps)), &record);
  }
  PutAt(12, LasIntensity(scan.intensity[i], content), &record);
  record[14] = layout.returns;
  for (size_t k = 0; k < 3 && !scan.colors.empty(); ++k) {
    PutAt(layout.record_size + 2 * k, static_cast<uint16_t>(257 * scan.colors[i][k]), &record);
  }
  return record;
}

}  // namespace

void LasWriterOptions::Declare(OptionFields* fields) {
  fields->Choice("Las.version", &version, {"1.2", "1.3", "1.4"},
                 "Of a .las that is written: 1.2 is read by all programs; 1.4 (point formats 6 and "
                 "7) holds more than 4294967295 points, and the coordinate system where the input "
                 "is a LAS that says it as WKT.");
}

std::vector<std::string> LasWriterOptions::Problems() const { return ProblemsOf(*this); }

void WriteLas(const std::vector<const Scan*>& scans, const std::string& path,
              const LasWriterOptions& options, const std::string& coordinate_system) {
  ThrowIfProblems(options.Problems());
  const LasLayout layout = LayoutOf(options.version);
  const LasContent content = ContentOf(scans);
  if (layout.minor < 4 && content.count > std::numeric_limits<uint32_t>::max()) {
    throw InputError(path, "", "would hold more than 4294967295 points",
                     "Write .e57 or .ply, or LAS 1.4 (--Las.version 1.4)");
  }
  const LasSystem place = layout.minor < 4 || coordinate_system.empty() ? LasSystem::kNone
                          : coordinate_system.size() <= kLongestSystem  ? LasSystem::kBefore
                                                                        : LasSystem::kBehind;
  const std::string system =
      place == LasSystem::kNone ? "" : SystemRecord(coordinate_system, place == LasSystem::kBehind);
  const std::string before = place == LasSystem::kBehind ? "" : system;
  OutputFile output(path);
  output.stream() << HeaderOf(content, layout, layout.header_size + before.size(), place) << before;
  std::string block;
  for (const Scan* scan : scans) {
    for (size_t i = 0; i < scan->points.size(); ++i) {
      if (scan->IsMissing(static_cast<int>(i))) continue;
      block += RecordOf(*scan, i, content, layout);
      if (block.size() < kLasWritten) continue;
      output.stream() << block;
      block.clear();
    }
  }
  output.stream() << block;
  if (place == LasSystem::kBehind) output.stream() << system;
  output.Commit();
}

}  // namespace roomtex
