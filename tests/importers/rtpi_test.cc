#include "importers/rtpi.h"

#include <limits>
#include <random>

#include <gmock/gmock.h>

#include "core/error.h"
#include "tests/importers/rtpi_bytes.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class Rtpi : public testing::Test {
 protected:
  std::string Write(const std::string& bytes, const std::string& name = "scan.rtpi") {
    WriteBytes(folder_ / name, bytes);
    return folder_ / name;
  }
  RtpiFile Read(const std::string& bytes) { return ReadRtpi(Write(bytes)); }
  Scan ReadAsScan(const std::string& bytes, const RtpiScanOptions& options = {}) {
    return ScanFromRtpi(Read(bytes), options);
  }
  TempFolder folder_;
};

bool SameBits(const RtpiSample& a, const RawSample& b) {
  return std::memcmp(&a.range, &b.range, 4) == 0 && std::memcmp(&a.theta, &b.theta, 4) == 0 &&
         std::memcmp(&a.phi, &b.phi, 4) == 0 && a.value == b.value;
}

void ExpectColumns(const RtpiFile& file, const RawColumns& columns) {
  ASSERT_EQ(file.NumColumns(), static_cast<int>(columns.size()));
  for (int c = 0; c < file.NumColumns(); ++c) {
    ASSERT_EQ(file.column_begin[c + 1] - file.column_begin[c],
              static_cast<int64_t>(columns[c].size()));
    for (size_t k = 0; k < columns[c].size(); ++k) {
      EXPECT_TRUE(SameBits(file.samples[file.column_begin[c] + k], columns[c][k])) << c << ' ' << k;
    }
  }
}

// Any bits at all, NaN payloads, denormals and infinities among them.
RawColumns RandomColumns(int num_columns, int seed) {
  std::mt19937 random(seed);
  RawColumns columns(num_columns);
  for (auto& column : columns) {
    column.resize(random() % 20);
    for (RawSample& sample : column) {
      uint32_t words[4] = {static_cast<uint32_t>(random()), static_cast<uint32_t>(random()),
                           static_cast<uint32_t>(random()), static_cast<uint32_t>(random())};
      std::memcpy(&sample, words, 16);
    }
  }
  return columns;
}

TEST_F(Rtpi, ReadsEverySampleBitByBitInBothByteOrders) {
  const RawColumns columns = RandomColumns(50, 1);
  for (const bool big : {false, true}) {
    const RtpiFile file = Read(Rtpi3Header(50, 20) + RtpiBody(columns, big));
    EXPECT_EQ(file.byte_order, big ? ByteOrder::kBig : ByteOrder::kLittle);
    EXPECT_EQ(file.header.version, 3);
    ExpectColumns(file, columns);
  }
}

TEST_F(Rtpi, ReadsVersion2InBothByteOrders) {
  const RawColumns columns = RandomColumns(30, 2);
  for (const bool big : {false, true}) {
    const RtpiFile file = Read("# one\n# two\nRTPIv2 30 20\n" + RtpiBody(columns, big));
    EXPECT_EQ(file.byte_order, big ? ByteOrder::kBig : ByteOrder::kLittle);
    EXPECT_EQ(file.header.version, 2);
    EXPECT_THAT(file.header.comments, ElementsAre("# one", "# two"));
    ExpectColumns(file, columns);
  }
}

TEST_F(Rtpi, DecidesTheByteOrderByTheFirstColumnsThatHoldSamples) {
  RawColumns columns(200);
  columns[150] = MakeColumns(1, 7)[0];
  for (const bool big : {false, true}) {
    const RtpiFile file = Read(Rtpi3Header(200, 7) + RtpiBody(columns, big));
    EXPECT_EQ(file.byte_order, big ? ByteOrder::kBig : ByteOrder::kLittle);
    ExpectColumns(file, columns);
  }
}

TEST_F(Rtpi, DecidesTheByteOrderWithoutALargestNumberOfSamples) {
  // 65536 samples are 256 in the other order: only the file's length tells.
  std::string header = Rtpi3Header(2, 0);
  const size_t line = header.find("# max_samples_per_column: 0\n");
  header.erase(line, header.find('\n', line) + 1 - line);
  for (const bool big : {false, true}) {
    const RawColumns columns = MakeColumns(2, 256);
    EXPECT_EQ(Read(header + RtpiBody(columns, big)).byte_order,
              big ? ByteOrder::kBig : ByteOrder::kLittle);
  }
}

TEST_F(Rtpi, WritingAndReadingGivesTheSameBitsAndHeader) {
  for (const bool big : {false, true}) {
    for (const bool has_color : {false, true}) {
      const RawColumns columns = RandomColumns(40, 3);
      std::string header = Rtpi3Header(40, 20,
                                       "# az_fov: -185.683 -90.0503\n# el_fov: -55.9643 86.0231\n"
                                       "# curr_samples_per_degree_el: 16.6634\n"
                                       "# filter1: cull_10_12_3_3\n# max_range: 240.125\n");
      if (has_color) header.replace(header.find("color: no"), 9, "color: yes");
      const RtpiFile first = Read(header + RtpiBody(columns, big, has_color));
      ExpectColumns(first, columns);
      WriteRtpi(first, folder_ / "copy.rtpi");
      const RtpiFile second = ReadRtpi(folder_ / "copy.rtpi");
      ExpectColumns(second, columns);
      EXPECT_EQ(second.byte_order, first.byte_order);
      EXPECT_EQ(RtpiHeaderText(second.header, 40), RtpiHeaderText(first.header, 40));
      EXPECT_EQ(second.header.el_fov->at(1), 86.0231);
      EXPECT_EQ(*second.header.max_range, 240.125);
      EXPECT_THAT(second.header.parameters, ElementsAre("# filter1: cull_10_12_3_3"));
      EXPECT_THAT(second.header.device,
                  ElementsAre("# model: deltaSphere3000", "# serverVersion 1.0.5"));
      WriteRtpi(second, folder_ / "again.rtpi");
      EXPECT_EQ(ReadBytes(folder_ / "again.rtpi"), ReadBytes(folder_ / "copy.rtpi"));
      const std::string written = ReadBytes(folder_ / "copy.rtpi");
      const std::string body = RtpiBody(columns, big, has_color);
      EXPECT_EQ(written.substr(written.size() - body.size()), body);
    }
  }
}

TEST_F(Rtpi, Version2IsWrittenAndReadBack) {
  for (const bool big : {false, true}) {
    const RtpiFile first = Read("# note\nRTPIv2 30 20\n" + RtpiBody(RandomColumns(30, 4), big));
    WriteRtpi(first, folder_ / "copy.rtpi");
    EXPECT_EQ(ReadBytes(folder_ / "copy.rtpi"), ReadBytes(folder_ / "scan.rtpi"));
  }
}

TEST_F(Rtpi, CommasInTheHeaderMayBeDecimal) {
  const std::string body = RtpiBody(MakeColumns(3, 4), false);
  const RtpiHeader decimal =
      Read(Rtpi3Header(3, 4,
                       "# az_fov: -185,683 \xE2\x80\x93"
                       "90,0503\n# curr_samples_per_degree_el: 16,6634\n# max_range: 240,125\n") +
           body)
          .header;
  EXPECT_THAT(*decimal.az_fov, ElementsAre(-185.683, -90.0503));
  EXPECT_EQ(*decimal.samples_per_degree_el, 16.6634);
  EXPECT_EQ(*decimal.max_range, 240.125);
  const RtpiHeader between =
      Read(Rtpi3Header(3, 4, "# az_fov: -90, 95\n# el_fov: -50,60\n") + body).header;
  EXPECT_THAT(*between.az_fov, ElementsAre(-90, 95));
  EXPECT_THAT(*between.el_fov, ElementsAre(-50, 60));
}

TEST_F(Rtpi, ToleratesEveryOddityOfRealHeaders) {
  const std::string header =
      "RTPI_version_3.0\r\n# --begin_header--\r\n# GPS: unknown\r\n# camera:\r\n"
      "# --begin_scan_parameters--\r\n# num_columns: 3\r\n# max_samples_per_column: 4\r\n"
      "# has_color: no\r\n# units: inches\r\n# az_fov: -185.683 \xE2\x80\x93"
      "90.0503\r\n"
      "# el_fov: \x96"
      "55.9643 86.0231\r\n# something_new: 17\r\n"
      "# orig_samples_per_degree_el:\r\n16.7\r\n# curr_samples_per_degree_el:\r\n# 1.5\r\n"
      "# curr_samples_per_degree_az:\r\n4.25\r\n# max_range: 240\r\n# --begin_comments--\r\n"
      "# num_columns: 99\r\nno sign at all, \x01\x02\r\n# units: feet\r\n# --end_header--\r\n";
  const RtpiFile file = Read(header + RtpiBody(MakeColumns(3, 4), false));
  ExpectColumns(file, MakeColumns(3, 4));
  EXPECT_EQ(file.header.units, "inches");
  EXPECT_THAT(*file.header.az_fov, ElementsAre(-185.683, -90.0503));
  EXPECT_THAT(*file.header.el_fov, ElementsAre(-55.9643, 86.0231));
  EXPECT_EQ(*file.header.samples_per_degree_el, 1.5);
  EXPECT_EQ(*file.header.samples_per_degree_az, 4.25);
  EXPECT_EQ(*file.header.max_range, 240);
  EXPECT_EQ(file.header.comments.size(), 3u);
  EXPECT_THAT(file.header.parameters,
              ElementsAre("# something_new: 17", "# orig_samples_per_degree_el:", "16.7"));
}

TEST_F(Rtpi, NeedsNothingButTheNumberOfColumns) {
  const RtpiFile file = Read("RTPI_version_3.0\n# num_columns: 3\n# --end_header--\n" +
                             RtpiBody(MakeColumns(3, 4), true));
  ExpectColumns(file, MakeColumns(3, 4));
  EXPECT_THAT(file.header.units, IsEmpty());
  EXPECT_FALSE(file.header.has_color);
  std::vector<std::string> notes;
  const Scan scan = ScanFromRtpi(file, {}, &notes);
  EXPECT_EQ(scan.num_rows, 4);
  EXPECT_THAT(notes, ElementsAre(HasSubstr("metres")));
}

TEST_F(Rtpi, PointsFollowTheThesisFormula) {
  const RawColumns columns = MakeColumns(6, 5);
  const Scan scan = ReadAsScan(Rtpi3Header(6, 5) + RtpiBody(columns, false));
  ASSERT_EQ(scan.num_columns, 6);
  ASSERT_EQ(scan.num_rows, 5);
  EXPECT_TRUE(scan.is_rtpi);
  EXPECT_THAT(scan.up, IsNearMatrix(Eigen::Vector3d::UnitY(), 0));
  for (int c = 0; c < 6; ++c) {
    for (int k = 0; k < 5; ++k) {
      const RawSample& s = columns[c][k];
      const double r = s.range, t = s.theta, p = s.phi;
      const int cell = scan.Index(c, 4 - k);  // the first sample of a column is its lowest one
      EXPECT_THAT(scan.points[cell],
                  IsNearMatrix(Eigen::Vector3d(std::sin(t) * std::cos(p) * r, std::sin(p) * r,
                                               -std::cos(t) * std::cos(p) * r),
                               1e-12));
      EXPECT_EQ(scan.intensity[cell], static_cast<float>(s.value));
    }
  }
}

TEST_F(Rtpi, CounterclockwiseMirrorsX) {
  const std::string bytes = Rtpi3Header(6, 5) + RtpiBody(MakeColumns(6, 5), false);
  RtpiScanOptions options;
  options.counterclockwise = true;
  const Scan clockwise = ReadAsScan(bytes), counterclockwise = ReadAsScan(bytes, options);
  for (size_t i = 0; i < clockwise.points.size(); ++i) {
    const Eigen::Vector3d mirrored = clockwise.points[i].cwiseProduct(Eigen::Vector3d(-1, 1, 1));
    EXPECT_THAT(counterclockwise.points[i], IsNearMatrix(mirrored, 1e-15));
  }
}

TEST_F(Rtpi, ColumnsRunDownwardsInSomeFiles) {
  RawColumns columns = MakeColumns(4, 6);
  const Scan upwards = ReadAsScan(Rtpi3Header(4, 6) + RtpiBody(columns, false));
  for (auto& column : columns) std::reverse(column.begin(), column.end());
  const Scan downwards = ReadAsScan(Rtpi3Header(4, 6) + RtpiBody(columns, false));
  for (size_t i = 0; i < upwards.points.size(); ++i) {
    EXPECT_THAT(downwards.points[i], IsNearMatrix(upwards.points[i], 0));
  }
}

TEST_F(Rtpi, UnitsAreConvertedToMetres) {
  const std::string body = RtpiBody(MakeColumns(4, 4), false);
  const Scan meters = ReadAsScan(Rtpi3Header(4, 4) + body);
  const std::pair<const char*, double> units[] = {
      {"inches", 0.0254}, {"Feet", 0.3048}, {"mm", 1e-3}, {"centimeters", 1e-2}};
  for (const auto& [name, factor] : units) {
    const Scan scan = ReadAsScan(Rtpi3Header(4, 4, "", name) + body);
    EXPECT_THAT(scan.points[5], IsNearMatrix(Eigen::Vector3d(factor * meters.points[5]), 1e-12));
  }
  RtpiScanOptions options;
  options.meters_per_unit = 0.5;
  const Scan chosen = ReadAsScan(Rtpi3Header(4, 4, "", "cubits") + body, options);
  EXPECT_THAT(chosen.points[5], IsNearMatrix(Eigen::Vector3d(0.5 * meters.points[5]), 1e-12));
  EXPECT_INPUT_ERROR(ReadAsScan(Rtpi3Header(4, 4, "", "cubits") + body), "--units");
}

TEST_F(Rtpi, MissingSamplesAreAbsentOrHaveNoRange) {
  RawColumns columns = MakeColumns(5, 8);
  const float bad[] = {0, -1, std::numeric_limits<float>::quiet_NaN(),
                       std::numeric_limits<float>::infinity(), 241};
  for (int c = 0; c < 5; ++c) columns[c][3].range = bad[c];
  columns[1][3].phi = std::numeric_limits<float>::quiet_NaN();  // angles of no sample do not matter
  columns[2].erase(columns[2].begin() + 5);
  columns[3].clear();
  const Scan scan = ReadAsScan(Rtpi3Header(5, 8, "# max_range: 240\n") + RtpiBody(columns, false));
  ASSERT_EQ(scan.num_rows, 8);
  EXPECT_EQ(scan.NumMissing(), 4 + 1 + 8);
  for (const int c : {0, 1, 2, 4}) EXPECT_TRUE(scan.IsMissing(scan.Index(c, 4)));
  EXPECT_TRUE(scan.IsMissing(scan.Index(2, 2)));
  EXPECT_FALSE(scan.IsMissing(scan.Index(2, 3)));
  EXPECT_EQ(scan.intensity[scan.Index(2, 1)], 206);
}

TEST_F(Rtpi, MaxRangeOfTheUserReplacesThatOfTheHeader) {
  RawColumns columns = MakeColumns(2, 3);
  columns[0][0].range = 100;
  columns[1][2].range = 300;
  const std::string bytes =
      Rtpi3Header(2, 3, "# max_range: 240\n", "inches") + RtpiBody(columns, false);
  EXPECT_EQ(ReadAsScan(bytes).NumMissing(), 1);
  RtpiScanOptions options;
  options.max_range = 1.5;
  EXPECT_EQ(ReadAsScan(bytes, options).NumMissing(), 2);
  options.max_range = 1000;
  EXPECT_EQ(ReadAsScan(bytes, options).NumMissing(), 0);
  options.max_range = 1e-3;
  EXPECT_INPUT_ERROR(ReadAsScan(bytes, options), "--max_range");
}

// Columns with samples at known rows (0 = bottom) of a grid of `density` samples per degree, each
// off by up to `jitter` rows, some absent. The value of a sample is its row.
RawColumns ScatteredColumns(int num_columns, int num_rows, double density, double jitter) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> offset(-jitter, jitter), uniform(0, 1);
  RawColumns columns(num_columns);
  for (int c = 0; c < num_columns; ++c) {
    for (int row = 0; row < num_rows; ++row) {
      if (uniform(random) < 0.2 && row > 0 && row + 1 < num_rows) continue;
      columns[c].push_back(
          {3, static_cast<float>(c * 0.01 + 1e-3 * offset(random)),
           static_cast<float>((-40.0567 + (row + offset(random)) / density) * kDegree),
           static_cast<uint32_t>(row)});
    }
  }
  return columns;
}

void ExpectRowsByValue(const Scan& scan, int num_rows) {
  ASSERT_EQ(scan.num_rows, num_rows);
  for (int row = 0; row < num_rows; ++row) {
    for (int c = 0; c < scan.num_columns; ++c) {
      const int cell = scan.Index(c, row);
      if (!scan.IsMissing(cell)) {
        ASSERT_EQ(scan.intensity[cell], num_rows - 1 - row);
      }
    }
  }
}

TEST_F(Rtpi, RowsFollowTheElevationDespiteJitterAndARoundedDensity) {
  const RawColumns columns = ScatteredColumns(40, 2000, 16.6634, 0.3);
  size_t count = 0;
  for (const auto& column : columns) count += column.size();
  // Two digits less in the header are half a row over the whole column.
  for (const std::string density : {"16.6634", "16.66", "16.7"}) {
    const Scan scan =
        ReadAsScan(Rtpi3Header(40, 2000, "# curr_samples_per_degree_el: " + density + "\n") +
                   RtpiBody(columns, false));
    ExpectRowsByValue(scan, 2000);
    EXPECT_EQ(scan.points.size() - scan.NumMissing(), count);
  }
}

TEST_F(Rtpi, RowSpacingIsEstimatedWhenTheHeaderHasNone) {
  const RawColumns columns = ScatteredColumns(60, 700, 7.3, 0.2);
  const Scan scan = ReadAsScan("RTPIv2 60 700\n" + RtpiBody(columns, true));
  ExpectRowsByValue(scan, 700);
}

TEST_F(Rtpi, ADensityThatContradictsTheSamplesIsToldAndNotUsed) {
  const RawColumns columns = ScatteredColumns(30, 300, 5, 0.1);
  for (const std::string density : {"20", "1.1"}) {
    const RtpiFile file = Read(
        Rtpi3Header(30, 300, "# el_fov: -60 60\n# curr_samples_per_degree_el: " + density + "\n") +
        RtpiBody(columns, false));
    std::vector<std::string> notes;
    ExpectRowsByValue(ScanFromRtpi(file, {}, &notes), 300);
    EXPECT_THAT(notes, ElementsAre(HasSubstr("curr_samples_per_degree_el")));
  }
}

TEST_F(Rtpi, TheGridCoversTheFieldOfViewEvenWhereNothingWasMeasured) {
  RawColumns columns = MakeColumns(3, 11);  // -5 to 5 degrees
  const std::string fov = "# el_fov: -20 30\n# curr_samples_per_degree_el: 1\n";
  const Scan scan = ReadAsScan(Rtpi3Header(3, 51, fov) + RtpiBody(columns, false));
  EXPECT_EQ(scan.num_rows, 51);
  EXPECT_FALSE(scan.IsMissing(scan.Index(0, 25)));
  EXPECT_TRUE(scan.IsMissing(scan.Index(0, 24)));
  EXPECT_FALSE(scan.IsMissing(scan.Index(2, 35)));
  EXPECT_TRUE(scan.IsMissing(scan.Index(2, 36)));
}

TEST_F(Rtpi, AFieldOfViewGivenByItsEdgesAddsNoEmptyRow) {
  const std::string fov = "# el_fov: -5.6 5.6\n# curr_samples_per_degree_el: 1\n";
  const Scan scan = ReadAsScan(Rtpi3Header(3, 11, fov) + RtpiBody(MakeColumns(3, 11), false));
  EXPECT_EQ(scan.num_rows, 11);
  EXPECT_EQ(scan.NumMissing(), 0);
}

TEST_F(Rtpi, TwoSamplesNearOneRowShareItWithTheEmptyRowBeside) {
  RawColumns columns = MakeColumns(8, 10);
  columns[3][4].phi =
      static_cast<float>((-5 + 4.6) * kDegree);  // nearest to row 5, whose sample is there
  const Scan scan = ReadAsScan(Rtpi3Header(8, 10) + RtpiBody(columns, false));
  ASSERT_EQ(scan.num_rows, 10);
  EXPECT_EQ(scan.NumMissing(), 0);
  EXPECT_EQ(scan.intensity[scan.Index(3, 5)], 304);
  EXPECT_EQ(scan.intensity[scan.Index(3, 4)], 305);
}

TEST_F(Rtpi, SamplesThatFindNoRowAreCountedInANote) {
  RawColumns columns = MakeColumns(8, 10);
  columns[3].insert(columns[3].begin() + 4, columns[3][4]);
  columns[3][4].phi += 1e-4f;
  const RtpiFile file = Read(Rtpi3Header(8, 11) + RtpiBody(columns, false));
  std::vector<std::string> notes;
  const Scan scan = ScanFromRtpi(file, {}, &notes);
  EXPECT_EQ(scan.num_rows, 10);
  EXPECT_THAT(notes, ElementsAre(HasSubstr("1 of 81 samples")));
}

TEST_F(Rtpi, ASingleSampleIsAScan) {
  const Scan scan = ReadAsScan(Rtpi3Header(1, 1) + RtpiBody(MakeColumns(1, 1), false));
  EXPECT_EQ(scan.num_rows, 1);
  EXPECT_EQ(scan.NumMissing(), 0);
}

}  // namespace
}  // namespace roomtex
