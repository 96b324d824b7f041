// Scan to RTPI and back, and colouring (rtpi.h).

#include <random>

#include <gmock/gmock.h>

#include "core/decompositions.h"
#include "core/error.h"
#include "importers/rtpi.h"
#include "tests/importers/rtpi_bytes.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::Contains;
using testing::HasSubstr;

// A grid seen from `scan_from_station`, some samples missing, top and bottom row all missing.
Scan MakeScan(bool is_rtpi, const Eigen::Vector3d& up, const Rigid& scan_from_station) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> range(1, 9), uniform(0, 1);
  Scan scan;
  scan.is_rtpi = is_rtpi;
  scan.num_columns = 37;
  scan.num_rows = 29;
  scan.scan_from_station = scan_from_station;
  scan.up = scan_from_station.rotation * up;
  const Eigen::Quaterniond station_from_y_up = RotationBetween(Eigen::Vector3d::UnitY(), up);
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      const double phi = (40 - 2.5 * row) * kDegree, theta = (-170 + 9 * column) * kDegree;
      const bool missing = row == 0 || row + 1 == scan.num_rows || uniform(random) < 0.1;
      const Eigen::Vector3d y_up(std::sin(theta) * std::cos(phi), std::sin(phi),
                                 -std::cos(theta) * std::cos(phi));
      scan.points.push_back(missing
                                ? Scan::MissingPoint()
                                : scan_from_station * (range(random) * (station_from_y_up * y_up)));
      scan.intensity.push_back(
          missing ? 0 : static_cast<float>(is_rtpi ? random() % 4096 : uniform(random)));
    }
  }
  return scan;
}

void ExpectSameGrid(const Scan& a, const Scan& b, const Rigid& b_from_a, double tolerance) {
  ASSERT_EQ(a.num_columns, b.num_columns);
  ASSERT_EQ(a.num_rows, b.num_rows);
  for (int i = 0; i < static_cast<int>(a.points.size()); ++i) {
    ASSERT_EQ(a.IsMissing(i), b.IsMissing(i)) << i;
    if (!a.IsMissing(i)) {
      EXPECT_THAT(b_from_a * a.points[i], IsNearMatrix(b.points[i], tolerance));
    }
  }
}

class RtpiFromScanTest : public testing::TestWithParam<bool> {
 protected:
  TempFolder folder_;
};

TEST_P(RtpiFromScanTest, ReadingTheFileGivesTheSameGridAndIntensities) {
  const Scan scan = MakeScan(true, Eigen::Vector3d::UnitY(), {});
  WriteRtpi(RtpiFromScan(scan, GetParam()), folder_ / "scan.rtpi");
  RtpiScanOptions options;
  options.counterclockwise = GetParam();
  const Scan again = ScanFromRtpi(ReadRtpi(folder_ / "scan.rtpi"), options);
  ExpectSameGrid(scan, again, {}, 2e-6);
  EXPECT_EQ(scan.intensity, again.intensity);
}

TEST_P(RtpiFromScanTest, AScanWithAPoseAndZUpIsTurnedIntoTheScannersFrame) {
  const Rigid pose{
      Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.1, -0.2, 1).normalized())),
      {400000.5, -3, 70}};
  const Scan scan = MakeScan(false, Eigen::Vector3d::UnitZ(), pose);
  const RtpiFile file = RtpiFromScan(scan, GetParam());
  WriteRtpi(file, folder_ / "scan.rtpi");
  RtpiScanOptions options;
  options.counterclockwise = GetParam();
  const Scan again = ScanFromRtpi(ReadRtpi(folder_ / "scan.rtpi"), options);
  const Rigid y_from_z{
      Eigen::Quaterniond(Eigen::AngleAxisd(-kDegree * 90, Eigen::Vector3d::UnitX())),
      Eigen::Vector3d::Zero()};
  ExpectSameGrid(scan, again, y_from_z * pose.Inverse(), 2e-6);
  EXPECT_THAT(file.header.comments, Contains(HasSubstr("65535")));
  for (size_t i = 0; i < scan.intensity.size(); ++i) {
    EXPECT_NEAR(again.intensity[i] / 65535, scan.intensity[i], 0.51 / 65535);
  }
}

INSTANTIATE_TEST_SUITE_P(BothSenses, RtpiFromScanTest, testing::Bool());

class RtpiColor : public testing::Test {
 protected:
  // Jitter, missing samples with and without an entry, and a sample that has lost its cell.
  RawColumns Columns(uint32_t value_factor) {
    RawColumns columns = MakeColumns(9, 12);
    columns[2][3].range = 0;
    columns[2][4].phi = std::numeric_limits<float>::quiet_NaN();
    columns[2][4].range = -1;
    columns[4].erase(columns[4].begin() + 6);
    columns[5].insert(columns[5].begin() + 2, columns[5][2]);
    columns[5][2].phi += 1e-4f;
    for (auto& column : columns) {
      for (RawSample& sample : column) sample.value = sample.value % 256 * value_factor;
    }
    return columns;
  }
  // The colour of a cell tells its column and row.
  std::vector<Eigen::Matrix<uint8_t, 3, 1>> ColorsByCell(const Scan& scan) {
    std::vector<Eigen::Matrix<uint8_t, 3, 1>> colors(scan.points.size());
    for (int row = 0; row < scan.num_rows; ++row) {
      for (int column = 0; column < scan.num_columns; ++column) {
        colors[scan.Index(column, row)] = Eigen::Matrix<uint8_t, 3, 1>(
            static_cast<uint8_t>(column + 1), static_cast<uint8_t>(row + 1), 200);
      }
    }
    return colors;
  }
  TempFolder folder_;
};

TEST_F(RtpiColor, EverySampleGetsTheColourOfTheCellItHasInTheScan) {
  const RawColumns columns = Columns(1);
  for (const bool big : {false, true}) {
    WriteBytes(folder_ / "in.rtpi", Rtpi3Header(9, 13) + RtpiBody(columns, big));
    const RtpiFile before = ReadRtpi(folder_ / "in.rtpi");
    const Scan scan = ScanFromRtpi(before, {});
    WriteColoredRtpi(folder_ / "in.rtpi", ColorsByCell(scan), folder_ / "out.rtpi");
    const RtpiFile after = ReadRtpi(folder_ / "out.rtpi");
    EXPECT_TRUE(after.header.has_color);
    EXPECT_EQ(after.byte_order, before.byte_order);
    EXPECT_EQ(after.column_begin, before.column_begin);
    for (size_t i = 0; i < before.samples.size(); ++i) {
      EXPECT_EQ(std::memcmp(&before.samples[i], &after.samples[i], 12), 0);
      EXPECT_EQ(after.samples[i].Intensity(true), before.samples[i].Intensity(false));
    }
    // The coloured file gives the same scan, and its bytes are the colours of the cells.
    const Scan colored = ScanFromRtpi(after, {});
    for (int c = 0; c < 9; ++c) {
      for (int64_t i = after.column_begin[c]; i < after.column_begin[c + 1]; ++i) {
        const RtpiSample& sample = after.samples[i];
        const int red = sample.value & 255, green = sample.value >> 8 & 255,
                  blue = sample.value >> 16 & 255;
        if (!(sample.range > 0)) {
          EXPECT_EQ(red + green + blue, 0);
          continue;
        }
        ASSERT_EQ(red, c + 1);
        ASSERT_EQ(blue, 200);
        const Eigen::Vector3d& point = colored.points[colored.Index(c, green - 1)];
        EXPECT_NEAR(std::asin(point.y() / point.norm()), sample.phi, 1.1e-4);
        EXPECT_NEAR(point.norm(), sample.range, 1e-5);
      }
    }
  }
}

TEST_F(RtpiColor, LargeIntensitiesAreScaledToAByteAndTheHeaderSaysSo) {
  WriteBytes(folder_ / "in.rtpi", Rtpi3Header(9, 13) + RtpiBody(Columns(16), false));
  const RtpiFile before = ReadRtpi(folder_ / "in.rtpi");
  WriteColoredRtpi(folder_ / "in.rtpi", ColorsByCell(ScanFromRtpi(before, {})),
                   folder_ / "out.rtpi");
  const RtpiFile after = ReadRtpi(folder_ / "out.rtpi");
  double largest = 0;
  for (const RtpiSample& sample : before.samples)
    largest = std::max<double>(largest, sample.Intensity(false));
  for (size_t i = 0; i < before.samples.size(); ++i) {
    EXPECT_NEAR(after.samples[i].Intensity(true),
                before.samples[i].Intensity(false) * 255 / largest, 0.51);
  }
  EXPECT_THAT(after.header.comments, Contains(HasSubstr("0..255 for 0 to")));
}

TEST_F(RtpiColor, Version2BecomesVersion3AndAColouredFileCanBeColouredAgain) {
  WriteBytes(folder_ / "in.rtpi", "RTPIv2 9 13\n" + RtpiBody(Columns(1), true));
  const Scan scan = ScanFromRtpi(ReadRtpi(folder_ / "in.rtpi"), {});
  WriteColoredRtpi(folder_ / "in.rtpi", ColorsByCell(scan), folder_ / "out.rtpi");
  EXPECT_EQ(ReadRtpi(folder_ / "out.rtpi").header.version, 3);
  WriteColoredRtpi(folder_ / "out.rtpi", ColorsByCell(scan), folder_ / "again.rtpi");
  const RtpiFile once = ReadRtpi(folder_ / "out.rtpi"), twice = ReadRtpi(folder_ / "again.rtpi");
  ASSERT_EQ(once.samples.size(), twice.samples.size());
  EXPECT_EQ(std::memcmp(once.samples.data(), twice.samples.data(), 16 * once.samples.size()), 0);
  EXPECT_THROW(WriteColoredRtpi(folder_ / "in.rtpi", {}, folder_ / "no.rtpi"),
               std::invalid_argument);
}

}  // namespace
}  // namespace roomtex
