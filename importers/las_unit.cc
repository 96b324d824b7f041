#include "importers/las_unit.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <string_view>

#include "core/text.h"
#include "importers/file_reader.h"
#include "importers/length_unit.h"

namespace roomtex {
namespace {

constexpr int64_t kMaxRecord = 1 << 20;  // bytes; coordinate systems are much shorter
constexpr int64_t kMaxRecords = 1000;

template <typename T>
T ValueAt(std::string_view bytes, size_t at) {  // little-endian, as this machine; 0 beyond the end
  T value{};
  if (at + sizeof value <= bytes.size()) std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

// EPSG's numbers of units.
std::string NameOfEpsgUnit(int number) {
  switch (number) {
    case 9001:
      return "meters";
    case 9002:
      return "feet";
    case 9003:
      return "us_survey_feet";
    default:
      return "";
  }
}

// GeoKeyDirectoryTag (OGC GeoTIFF 1.1, 7.1): after four numbers, of which the last counts them,
// keys of four numbers: id, where the value stands (0 = here), how many, value.
void TakeGeoKeys(std::string_view record, LasUnits* units) {
  constexpr int kModelType = 1024, kProjected = 1, kGeographic = 2, kHorizontalUnit = 3076,
                kVerticalUnit = 4099;
  const size_t count = std::min<size_t>(ValueAt<uint16_t>(record, 6), record.size() / 8);
  for (size_t i = 1; i <= count; ++i) {
    if (ValueAt<uint16_t>(record, 8 * i + 2) != 0) continue;
    const int key = ValueAt<uint16_t>(record, 8 * i), value = ValueAt<uint16_t>(record, 8 * i + 6);
    if (key == kModelType && value == kGeographic) units->degrees = true;
    if (key == kModelType && value == kProjected) units->projected = true;
    if (key == kHorizontalUnit) units->horizontal = NameOfEpsgUnit(value);
    if (key == kVerticalUnit) units->vertical = NameOfEpsgUnit(value);
  }
}

// The unit of the coordinate system that begins at `at`: NAME[... UNIT["name",metres] ...] (WKT 1,
// OGC 01-009), LENGTHUNIT there or in its first AXIS[...] (WKT 2, OGC 18-010); not those of other
// parts of it.
std::string UnitOfSystem(std::string_view wkt, size_t at) {
  int depth = 0;
  bool quoted = false, in_axis = false;
  for (size_t i = at; i < wkt.size(); ++i) {
    if (wkt[i] == '"') quoted = !quoted;
    if (quoted) continue;
    if (wkt[i] == '[' && ++depth == 2) in_axis = i >= 4 && wkt.substr(i - 4, 4) == "AXIS";
    if (wkt[i] == ']' && --depth == 0) return "";
    if (!(depth == 1 || (depth == 2 && in_axis)) || wkt.substr(i, 6) != "UNIT[\"") continue;
    const size_t comma = wkt.find("\",", i + 6);
    if (comma == std::string_view::npos) return "";
    const std::string_view number = TrimmedView(wkt.substr(comma + 2));
    double meters = 0;
    std::from_chars(number.data(), number.data() + number.size(), meters);
    for (const std::string& name : LengthUnitNames()) {
      if (std::abs(meters / *MetersPerUnit(name) - 1) < 1e-7) return name;
    }
    return "";
  }
  return "";
}

size_t FirstOf(std::string_view text, std::initializer_list<std::string_view> words) {
  size_t first = std::string_view::npos;
  for (const std::string_view word : words) first = std::min(first, text.find(word));
  return first;
}

void TakeWkt(std::string_view wkt, LasUnits* units) {
  // WKT 1 (OGC 01-009) and WKT 2 (OGC 18-010).
  const size_t projected = FirstOf(wkt, {"PROJCS[", "PROJCRS["});
  const size_t vertical = FirstOf(wkt, {"VERT_CS[", "VERTCRS["});
  constexpr size_t kNone = std::string_view::npos;
  if (projected != kNone) units->horizontal = UnitOfSystem(wkt, projected);
  if (vertical != kNone) units->vertical = UnitOfSystem(wkt, vertical);
  units->projected = projected != kNone;
  units->degrees = projected == kNone && FirstOf(wkt, {"GEOGCS[", "GEOGCRS["}) != kNone;
  units->wkt = wkt.substr(0, wkt.find('\0'));
}

struct RecordList {
  int64_t begin = 0, end = 0, count = 0, header = 0;  // header: bytes before each record
};

void TakeRecords(const FileReader& file, const RecordList& list, LasUnits* units) {
  constexpr int kGeoKeys = 34735, kWkt = 2112;
  int64_t at = list.begin;
  for (int64_t i = 0; i < std::min(list.count, kMaxRecords) && at + list.header <= list.end; ++i) {
    const std::string head = file.ReadSome(at, list.header);
    const bool is_long = list.header == 60;
    const uint64_t length = is_long ? ValueAt<uint64_t>(head, 20) : ValueAt<uint16_t>(head, 20);
    at += list.header;
    if (length > static_cast<uint64_t>(list.end - at)) return;
    const int id = ValueAt<uint16_t>(head, 18);
    const bool is_system = std::strncmp(head.c_str() + 2, "LASF_Projection", 16) == 0;
    if (is_system && (id == kGeoKeys || id == kWkt) && length <= kMaxRecord) {
      const std::string record = file.ReadSome(at, static_cast<int64_t>(length));
      id == kWkt ? TakeWkt(record, units) : TakeGeoKeys(record, units);
    }
    at += static_cast<int64_t>(length);
  }
}

}  // namespace

LasUnits ReadLasUnits(const std::string& path) {
  const FileReader file(path);
  const std::string header = file.ReadSome(0, 375);
  LasUnits units;
  TakeRecords(
      file,
      {ValueAt<uint16_t>(header, 94), std::min<int64_t>(ValueAt<uint32_t>(header, 96), file.size()),
       ValueAt<uint32_t>(header, 100), 54},
      &units);
  const auto behind = ValueAt<uint64_t>(header, 235);
  if (ValueAt<uint8_t>(header, 25) == 4 && behind < static_cast<uint64_t>(file.size())) {
    TakeRecords(file,
                {static_cast<int64_t>(behind), file.size(), ValueAt<uint32_t>(header, 243), 60},
                &units);
  }
  return units;
}

}  // namespace roomtex
