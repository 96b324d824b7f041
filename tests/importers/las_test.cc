#include "importers/las.h"

#include <cstring>

#include <gmock/gmock.h>

#include "importers/scan_reader.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::HasSubstr;

constexpr int kSizes[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};

// A file of three points at (1, 2, 3), (4, 5, 6) and (7, 8, 9) about an origin in UTM.
struct LasBytes {
  int format = 0, minor = 2, extra = 0;  // extra: bytes behind what the format says
  int vlr = 0;                           // bytes between header and points
  uint16_t intensity = 700;
  std::string bytes;

  template <typename T>
  void Put(size_t at, T value) {
    std::memcpy(&bytes[at], &value, sizeof value);
  }
  std::string Make() {
    const size_t header = minor == 4 ? 375 : 227, begin = header + static_cast<size_t>(vlr);
    const auto size = static_cast<size_t>(kSizes[format] + extra);
    bytes.assign(begin + 3 * size, '\0');
    std::memcpy(bytes.data(), "LASF", 4);
    Put<uint8_t>(24, 1);
    Put<uint8_t>(25, static_cast<uint8_t>(minor));
    Put<uint16_t>(94, static_cast<uint16_t>(header));
    Put<uint32_t>(96, static_cast<uint32_t>(begin));
    Put<uint32_t>(100, vlr > 0 ? 1 : 0);
    Put<uint8_t>(104, static_cast<uint8_t>(format));
    Put<uint16_t>(105, static_cast<uint16_t>(size));
    if (minor < 4) Put<uint32_t>(107, 3);
    if (minor == 4) Put<uint64_t>(247, 3);
    const double origin[3] = {412000, 5654000, 100};
    for (size_t k = 0; k < 3; ++k) {
      Put(131 + 8 * k, 0.001);
      Put(155 + 8 * k, origin[k]);
    }
    for (size_t i = 0; i < 3; ++i) {
      const size_t at = begin + i * size;
      for (size_t k = 0; k < 3; ++k) Put(at + 4 * k, static_cast<int32_t>(1000 * (3 * i + k + 1)));
      Put(at + 12, intensity);
      const int colors = format == 2 ? 20 : format == 3 || format == 5 ? 28 : 30;
      const bool has = format == 2 || format == 3 || format == 5 || format >= 7;
      for (int k = 0; k < 3 && has && format != 9; ++k) {
        Put(at + static_cast<size_t>(colors + 2 * k), uint16_t{40000});
      }
    }
    return bytes;
  }
};

class Las : public testing::Test {
 protected:
  std::string Write(const std::string& bytes) {
    WriteBytes(folder_ / "a.las", bytes);
    return folder_ / "a.las";
  }
  TempFolder folder_;
};

TEST_F(Las, ReadsEveryPointFormat) {
  for (int format = 0; format <= 10; ++format) {
    LasBytes file;
    file.format = format;
    file.minor = format >= 6 ? 4 : 2;
    file.extra = format % 3;
    file.vlr = 100 * (format % 2);
    const Scan scan = ReadScan(Write(file.Make()), {});
    EXPECT_EQ(scan.kind(), Scan::Kind::kCloud);
    ASSERT_EQ(scan.points.size(), 3u) << format;
    EXPECT_LT((scan.points[2] - Eigen::Vector3d(412007, 5654008, 109)).norm(), 1e-6);
    EXPECT_EQ(scan.intensity[1], 700);
    file.intensity = 0;
    const Scan grey = ReadScan(Write(file.Make()), {});
    const bool colored =
        format == 2 || format == 3 || format == 5 || format == 7 || format == 8 || format == 10;
    EXPECT_NEAR(grey.intensity[1], colored ? 40000 : 0, 0.1) << format;
  }
}

TEST_F(Las, AScaleMayBeNegative) {
  LasBytes file;
  file.Make();
  file.Put(131 + 8, -0.001);
  const Scan scan = ReadLas(Write(file.bytes), {});
  EXPECT_LT((scan.points[2] - Eigen::Vector3d(412007, 5653992, 109)).norm(), 1e-6);
  file.Put(131 + 8, 0.0);
  EXPECT_INPUT_ERROR(ReadLas(Write(file.bytes), {}), "byte 139: the scale is 0");
}

TEST_F(Las, WithheldPointsAreLeftOut) {
  LasBytes old;
  old.Make();
  old.bytes[227 + 15] = static_cast<char>(0x82);
  EXPECT_EQ(ReadLas(Write(old.bytes), {}).points.size(), 2u);
  LasBytes recent;
  recent.format = 6;
  recent.minor = 4;
  recent.Make();
  recent.bytes[375 + 15] = 4;
  EXPECT_EQ(ReadLas(Write(recent.bytes), {}).points.size(), 2u);
}

// One record of a coordinate system before the points, as LasBytes leaves room for it.
std::string WithSystem(uint16_t id, const std::string& system) {
  LasBytes file;
  file.vlr = static_cast<int>(54 + system.size());
  file.Make();
  std::memcpy(&file.bytes[227 + 2], "LASF_Projection", 15);
  file.Put(227 + 18, id);
  file.Put(227 + 20, static_cast<uint16_t>(system.size()));
  std::memcpy(&file.bytes[227 + 54], system.data(), system.size());
  return file.bytes;
}

std::string GeoKeys(const std::vector<std::pair<uint16_t, uint16_t>>& keys) {
  std::vector<uint16_t> numbers = {1, 1, 0, static_cast<uint16_t>(keys.size())};
  for (const auto& [key, value] : keys) numbers.insert(numbers.end(), {key, 0, 1, value});
  return {reinterpret_cast<const char*>(numbers.data()), 2 * numbers.size()};
}

const char kStatePlane[] =
    "PROJCS[\"NAD83 / Texas Central (ftUS)\",GEOGCS[\"NAD83\",DATUM[\"D\",SPHEROID[\"GRS 1980\","
    "6378137,298.257]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],"
    "PROJECTION[\"Lambert\"],PARAMETER[\"false_easting\",2296583.333],"
    "UNIT[\"US survey foot [ftUS]\",0.3048006096012192],AXIS[\"X\",EAST]]";

// WKT 2: lengths of other parts are no unit of the coordinates.
const char kStatePlane2[] =
    "PROJCRS[\"NAD83 / Texas Central (ftUS)\",BASEGEOGCRS[\"NAD83\",DATUM[\"D\",ELLIPSOID["
    "\"GRS 1980\",6378137,298.257,LENGTHUNIT[\"metre\",1]]]],CONVERSION[\"c\",METHOD[\"Lambert\"],"
    "PARAMETER[\"False "
    "easting\",700000,LENGTHUNIT[\"metre\",1]]],CS[Cartesian,2],AXIS[\"(X)\",east,"
    "ORDER[1],LENGTHUNIT[\"US survey foot\",0.304800609601219]]]";
const char kUtm2[] =
    "PROJCRS[\"UTM\",BASEGEOGCRS[\"WGS 84\"],CS[Cartesian,2],AXIS[\"e\",east],AXIS[\"n\",north],"
    "LENGTHUNIT[\"metre\",1]]";

TEST_F(Las, UnitsOfTheCoordinateSystemCount) {
  const auto metres = [this](const std::string& bytes, const std::string& note = "") {
    const ScanFile file = ReadScanFile(Write(bytes), {});
    const bool is_said = file.meters_per_unit != 1 || !note.empty();
    EXPECT_EQ(file.notes.size(), is_said ? 1u : 0u);
    if (is_said && file.notes.size() == 1) {
      EXPECT_THAT(file.notes[0], HasSubstr(note));
    }
    EXPECT_NEAR(file.scans[0].points[0].x(), 412001 * file.meters_per_unit, 1e-6);
    return file.meters_per_unit;
  };
  EXPECT_EQ(metres(LasBytes().Make()), 1);
  EXPECT_EQ(metres(WithSystem(34735, GeoKeys({{1024, 1}, {3076, 9001}}))), 1);
  EXPECT_EQ(metres(WithSystem(34735, GeoKeys({{1024, 1}, {3076, 9002}}))), 0.3048);
  EXPECT_EQ(metres(WithSystem(34735, GeoKeys({{1024, 1}, {3076, 9003}}))), 1200.0 / 3937);
  EXPECT_EQ(metres(WithSystem(34735, GeoKeys({{3076, 9036}}))), 1);  // not known
  EXPECT_EQ(metres(WithSystem(2112, kStatePlane)), 1200.0 / 3937);
  EXPECT_EQ(metres(WithSystem(2112, std::string("COMPD_CS[\"both\",") + kStatePlane + "]")),
            1200.0 / 3937);
  const std::string whole = kStatePlane;
  EXPECT_EQ(metres(WithSystem(2112, whole.substr(0, whole.find("US survey") + 5)),  // cut
                   "does not say its unit in a way that is known"),
            1);
  // The unit follows from the number of the system alone.
  EXPECT_EQ(metres(WithSystem(34735, GeoKeys({{1024, 1}, {3072, 2263}, {4099, 9003}})),
                   "(of its heights: us_survey_feet)"),
            1);
  EXPECT_EQ(metres(WithSystem(2112, kStatePlane2)), 1200.0 / 3937);
  EXPECT_EQ(metres(WithSystem(2112, kUtm2)), 1);
  EXPECT_EQ(metres(WithSystem(34735, GeoKeys({{3076, 9003}}).substr(0, 15))), 1);
  // The option counts more.
  ScanReaderOptions options;
  options.units = "meters";
  EXPECT_EQ(ReadScanFile(Write(WithSystem(2112, kStatePlane)), options).meters_per_unit, 1);
}

TEST_F(Las, HeightsInAnotherUnitAreSaid) {
  const ScanFile file =
      ReadScanFile(Write(WithSystem(34735, GeoKeys({{3076, 9003}, {4099, 9001}}))), {});
  ASSERT_EQ(file.notes.size(), 2u);
  EXPECT_THAT(file.notes[0],
              testing::HasSubstr("its heights are in meters, the rest in us_survey"));
}

TEST_F(Las, DegreesAreRefused) {
  EXPECT_INPUT_ERROR(ReadScan(Write(WithSystem(34735, GeoKeys({{1024, 2}}))), {}),
                     "has coordinates of longitude and latitude");
  const std::string wkt = "GEOGCS[\"WGS 84\",UNIT[\"degree\",0.0174532925199433]]";
  EXPECT_INPUT_ERROR(ReadScan(Write(WithSystem(2112, wkt)), {}), "longitude and latitude");
}

// LAS 1.4 may have its coordinate system behind the points.
TEST_F(Las, TheCoordinateSystemMayStandBehindThePoints) {
  LasBytes file;
  file.minor = 4;
  file.format = 6;
  file.Make();
  const size_t end = file.bytes.size();
  file.bytes.resize(end + 60 + sizeof kStatePlane);
  file.Put(235, static_cast<uint64_t>(end));
  file.Put(243, uint32_t{1});
  std::memcpy(&file.bytes[end + 2], "LASF_Projection", 15);
  file.Put(end + 18, uint16_t{2112});
  file.Put(end + 20, static_cast<uint64_t>(sizeof kStatePlane));
  std::memcpy(&file.bytes[end + 60], kStatePlane, sizeof kStatePlane);
  EXPECT_EQ(ReadScanFile(Write(file.bytes), {}).meters_per_unit, 1200.0 / 3937);
  file.Put(end + 20, ~uint64_t{0});
  EXPECT_EQ(ReadScanFile(Write(file.bytes), {}).meters_per_unit, 1);
}

TEST_F(Las, BrokenFilesGetASentence) {
  const auto expect = [this](LasBytes file, size_t at, uint8_t value, const std::string& text) {
    file.Make();
    file.bytes[at] = static_cast<char>(value);
    EXPECT_INPUT_ERROR(ReadScan(Write(file.bytes), {}), text);
  };
  expect({}, 24, 2, "is LAS 2.2, expected 1.0 to 1.4");
  expect({}, 25, 5, "is LAS 1.5");
  expect({}, 104, 0x80, "is compressed (LAZ)");
  expect({}, 104, 11, "format 11, expected 0 to 10");
  expect({}, 105, 19, "a point has 19 bytes, expected at least 20");
  expect({}, 96, 9, "the points begin at byte 9");
  expect({}, 98, 9, "the points begin at byte");
  expect({}, 107, 4, "says 4 points, the rest of the file holds 3");
  expect({}, 110, 255, "the rest of the file holds 3");
  expect({}, 107, 0, "holds no point");
  expect({}, 138, 0x7f, "byte 131: the scale is 1.797");
  expect({}, 162, 0x7f, "the offset is no number");
  const std::string whole = LasBytes().Make();
  for (size_t size = 0; size < whole.size(); size += 7) {
    EXPECT_ANY_THROW(ReadScan(Write(whole.substr(0, size)), {})) << size;
  }
}

}  // namespace
}  // namespace roomtex
