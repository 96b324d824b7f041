#include "importers/las.h"

#include <cstring>

#include <gmock/gmock.h>

#include "importers/scan_reader.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

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

TEST_F(Las, WrittenFilesReadTheSame) {
  Scan scan;
  scan.organised = false;
  scan.points = {{412345.12345, 5654321.5, 99}, Scan::MissingPoint(), {412350, 5654300, -3.25}};
  scan.intensity = {0.25f, 0, 1};
  WriteLas({&scan, &scan}, folder_ / "b.las");
  const Scan again = ReadLas(folder_ / "b.las", {});
  ASSERT_EQ(again.points.size(), 4u);
  EXPECT_LT((again.points[0] - scan.points[0]).norm(), 6e-5);
  EXPECT_LT((again.points[3] - scan.points[2]).norm(), 6e-5);
  EXPECT_EQ(again.intensity[0], 16384);
  EXPECT_EQ(again.intensity[1], 65535);
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
  expect({}, 138, 0xbf, "the scale is no positive number");
  expect({}, 162, 0x7f, "the offset is no number");
  const std::string whole = LasBytes().Make();
  for (size_t size = 0; size < whole.size(); size += 7) {
    EXPECT_ANY_THROW(ReadScan(Write(whole.substr(0, size)), {})) << size;
  }
}

}  // namespace
}  // namespace roomtex
