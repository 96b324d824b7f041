#include "importers/ptx.h"

#include <gmock/gmock.h>

#include "core/error.h"
#include "importers/scan_reader.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::HasSubstr;

const char kIdentity[] = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";

class Ptx : public testing::Test {
 protected:
  std::vector<Scan> Read(const std::string& text, const PtxOptions& options = {}) {
    WriteBytes(folder_ / "scan.ptx", text);
    return ReadPtx(folder_ / "scan.ptx", options);
  }
  void ExpectError(const std::string& text, const std::string& message) {
    EXPECT_INPUT_ERROR(Read(text), message);
    EXPECT_INPUT_ERROR(Read(text), folder_ / "scan.ptx");
  }
  TempFolder folder_;
};

TEST_F(Ptx, ColumnsRunFromTheBottomUp) {
  const Scan scan = Read(std::string("2\n3\n") + kIdentity +
                         "1 2 -1 0.1\n1 2 0 0.2\n1 2 1 0.3\n2 2 -1 0.4\n0 0 0 0.5\n2 2 1 0.6\n")[0];
  ASSERT_EQ(scan.num_columns, 2);
  ASSERT_EQ(scan.num_rows, 3);
  EXPECT_THAT(scan.points[scan.Index(0, 0)], IsNearMatrix(Eigen::Vector3d(1, 2, 1), 0));
  EXPECT_THAT(scan.points[scan.Index(0, 2)], IsNearMatrix(Eigen::Vector3d(1, 2, -1), 0));
  EXPECT_THAT(scan.points[scan.Index(1, 2)], IsNearMatrix(Eigen::Vector3d(2, 2, -1), 0));
  EXPECT_TRUE(scan.IsMissing(scan.Index(1, 1)));
  EXPECT_EQ(scan.NumMissing(), 1);
  EXPECT_EQ(scan.intensity[scan.Index(1, 0)], 0.6f);
  EXPECT_EQ(scan.intensity[scan.Index(1, 1)], 0.0f);
  EXPECT_THAT(scan.up, IsNearMatrix(Eigen::Vector3d::UnitZ(), 0));
  EXPECT_FALSE(scan.is_rtpi);
}

TEST_F(Ptx, AppliesItsPoseAsCycloneWritesIt) {
  // A quarter turn about z, x -> y, and a translation in the last row.
  const std::string header =
      "1\n2\n10 20 30\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n";
  const Scan scan = Read(header + "1 0 0 0.5\n0 2 1 0.5\n")[0];
  EXPECT_THAT(scan.points[scan.Index(0, 1)], IsNearMatrix(Eigen::Vector3d(10, 21, 30), 1e-12));
  EXPECT_THAT(scan.points[scan.Index(0, 0)], IsNearMatrix(Eigen::Vector3d(8, 20, 31), 1e-12));
  EXPECT_THAT(scan.Station(), IsNearMatrix(Eigen::Vector3d(10, 20, 30), 0));
  EXPECT_THAT(scan.scan_from_station * Eigen::Vector3d(1, 0, 0),
              IsNearMatrix(Eigen::Vector3d(10, 21, 30), 1e-12));
}

TEST_F(Ptx, AcceptsAPoseWithTheTranslationInTheLastColumn) {
  const std::string header =
      "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 -1 0 10\n1 0 0 20\n0 0 1 30\n0 0 0 1\n";
  EXPECT_THAT(Read(header + "1 0 0 0.5\n")[0].points[0],
              IsNearMatrix(Eigen::Vector3d(10, 21, 30), 1e-12));
}

TEST_F(Ptx, TakesTheScannerPositionWhenThePoseIsTheIdentity) {
  const std::string header =
      "1\n1\n500000.25 0 7\n0 1 0\n-1 0 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
  const Scan scan = Read(header + "500001.5 2 8 0.5\n")[0];
  EXPECT_THAT(scan.points[0], IsNearMatrix(Eigen::Vector3d(500001.5, 2, 8), 0));
  EXPECT_THAT(scan.Station(), IsNearMatrix(Eigen::Vector3d(500000.25, 0, 7), 0));
  EXPECT_THAT(scan.scan_from_station.rotation * Eigen::Vector3d::UnitX(),
              IsNearMatrix(Eigen::Vector3d::UnitY(), 1e-12));
}

TEST_F(Ptx, KeepsTheDigitsOfLargeCoordinates) {
  const Scan scan =
      Read(std::string("1\n1\n") + kIdentity + "651234.123456 5412345.654321 123.5 1\n")[0];
  EXPECT_THAT(scan.points[0],
              IsNearMatrix(Eigen::Vector3d(651234.123456, 5412345.654321, 123.5), 0));
  WritePtx({scan}, folder_ / "copy.ptx");
  EXPECT_THAT(ReadPtx(folder_ / "copy.ptx", {})[0].points[0], IsNearMatrix(scan.points[0], 1e-6));
}

TEST_F(Ptx, AcceptsColoursTabsCarriageReturnsAndBlankLines) {
  const std::string header = std::string("\r\n1\r\n 2 \r\n") + kIdentity;
  const Scan scan = Read(header + "1\t2\t3\t0.5\t255\t0\t9\r\n+1e0 -2 .5 1 1 2 3 \r\n\r\n \r\n")[0];
  EXPECT_THAT(scan.points[1], IsNearMatrix(Eigen::Vector3d(1, 2, 3), 0));
  EXPECT_THAT(scan.points[0], IsNearMatrix(Eigen::Vector3d(1, -2, 0.5), 0));
}

TEST_F(Ptx, CommasMayBeDecimal) {
  const std::string header =
      "1\n2\n10,5 20 30,25\n1,0 0,0 0,0\n0,0 1,0 0,0\n0,0 0,0 1,0\n1,0 0,0 0,0 0,0\n"
      "0,0 1,0 0,0 0,0\n0,0 0,0 1,0 0,0\n10,5 20 30,25 1,0\n";
  const Scan scan = Read(header + "1,5 -2,25 0 0,5\n1 0,5 -,5e0 0,25\n")[0];
  EXPECT_THAT(scan.Station(), IsNearMatrix(Eigen::Vector3d(10.5, 20, 30.25), 0));
  EXPECT_THAT(scan.points[1], IsNearMatrix(Eigen::Vector3d(12, 17.75, 30.25), 0));
  EXPECT_EQ(scan.intensity[1], 0.5f);
  EXPECT_THAT(scan.points[0], IsNearMatrix(Eigen::Vector3d(11.5, 20.5, 29.75), 0));
  // Between numbers they are none.
  EXPECT_THAT(Read(std::string("1\n1\n") + kIdentity + "1,2,3,0.5\n")[0].points[0],
              IsNearMatrix(Eigen::Vector3d(1, 2, 3), 0));
  EXPECT_THAT(Read(std::string("1\n1\n") + kIdentity + "1, 2, 3, 1\n")[0].points[0],
              IsNearMatrix(Eigen::Vector3d(1, 2, 3), 0));
}

TEST_F(Ptx, ConvertsUnitsAndLeavesOutWhatIsTooFar) {
  PtxOptions options;
  options.meters_per_unit = 1e-3;
  options.max_range = 3;
  const std::string header =
      "1\n2\n1000 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1000 0 0 1\n";
  const Scan scan = Read(header + "2000 0 0 1\n3001 0 0 1\n", options)[0];
  EXPECT_THAT(scan.points[1], IsNearMatrix(Eigen::Vector3d(3, 0, 0), 1e-12));
  EXPECT_THAT(scan.Station(), IsNearMatrix(Eigen::Vector3d(1, 0, 0), 1e-12));
  EXPECT_TRUE(scan.IsMissing(0));
}

TEST_F(Ptx, HoldsSeveralScans) {
  const std::string second =
      "1\n1\n5 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 0 0 1\n1 1 1 1\n";
  const std::vector<Scan> scans =
      Read(std::string("1\n2\n") + kIdentity + "1 2 3 0.5\n2 2 3 0.5\n" + second + "\n" + second);
  ASSERT_EQ(scans.size(), 3u);
  EXPECT_EQ(scans[0].num_rows, 2);
  EXPECT_THAT(scans[2].points[0], IsNearMatrix(Eigen::Vector3d(6, 1, 1), 0));
  WritePtx(scans, folder_ / "copy.ptx");
  const std::vector<Scan> again = ReadPtx(folder_ / "copy.ptx", {});
  ASSERT_EQ(again.size(), 3u);
  EXPECT_THAT(again[1].points[0], IsNearMatrix(scans[1].points[0], 1e-6));
}

TEST_F(Ptx, RoundTripKeepsGridPoseAndPointsToTheMicrometre) {
  const Rigid pose{Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized(), {412345.678, -20, 3.25}};
  Scan scan;
  scan.num_columns = 7;
  scan.num_rows = 5;
  scan.scan_from_station = pose;
  for (int i = 0; i < 35; ++i) {
    const bool missing = i % 4 == 1;
    scan.points.push_back(missing
                              ? Scan::MissingPoint()
                              : pose * Eigen::Vector3d(0.1 * i - 1.234567, 2 - 0.01 * i * i, 1));
    scan.intensity.push_back(missing ? 0 : static_cast<float>(i) / 35);
  }
  WritePtx({scan}, folder_ / "a.ptx");
  const Scan again = ReadPtx(folder_ / "a.ptx", {})[0];
  ASSERT_EQ(again.num_columns, 7);
  EXPECT_THAT(again.scan_from_station, IsNearRigid(pose, 1e-11, 1e-9));
  for (int i = 0; i < 35; ++i) {
    ASSERT_EQ(again.IsMissing(i), scan.IsMissing(i));
    EXPECT_NEAR(again.intensity[i], scan.intensity[i], 1e-6);
    if (scan.IsMissing(i)) continue;
    EXPECT_THAT(again.points[i], IsNearMatrix(scan.points[i], 2e-6));
  }
  WritePtx({again}, folder_ / "b.ptx");
  EXPECT_EQ(ReadBytes(folder_ / "a.ptx"), ReadBytes(folder_ / "b.ptx"));
}

TEST_F(Ptx, IntensitiesAreWrittenFrom0To1) {
  Scan scan;
  scan.num_columns = 2;
  scan.num_rows = 1;
  scan.points = {{1, 0, 0}, {2, 0, 0}};
  const std::pair<std::vector<float>, std::vector<float>> cases[] = {
      {{51, 255}, {0.2f, 1}}, {{0, 4095}, {0, 1}},          {{0.25f, 0.5f}, {0.25f, 0.5f}},
      {{-10, 30}, {0, 1}},    {{70000, 140000}, {0.5f, 1}}, {{0, 0}, {0, 0}}};
  for (const auto& [from, to] : cases) {
    scan.intensity = from;
    WritePtx({scan}, folder_ / "i.ptx");
    const Scan again = ReadPtx(folder_ / "i.ptx", {})[0];
    EXPECT_NEAR(again.intensity[0], to[0], 1e-6);
    EXPECT_NEAR(again.intensity[1], to[1], 1e-6);
  }
}

TEST_F(Ptx, IsRefusedWhereverItIsCutOff) {
  const std::string good =
      std::string("2\n2\n") + kIdentity + "1 2 3 0.1\n1 2 4 0.2\n1 3 3 0.3\n1 3 4 0.4\n";
  ASSERT_EQ(Read(good).size(), 1u);
  // Without its last newline, or even the last digits of its last number, it is whole to any
  // reader.
  for (size_t size = 0; size < good.size() - 4; ++size) {
    EXPECT_THROW(Read(good.substr(0, size)), InputError) << "cut after byte " << size;
  }
}

TEST_F(Ptx, AnEmptyStationIsLeftOutAndStillCounts) {
  const std::string pose = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
  const std::string measured = "1\n1\n" + pose + "1 2 3 0.5\n";
  WriteBytes(folder_ / "three.ptx", measured + "1\n1\n" + pose + "0 0 0 0.5\n" + measured);
  std::vector<std::string> notes;
  const std::vector<Scan> scans = ReadPtx(folder_ / "three.ptx", {}, &notes);
  ASSERT_EQ(scans.size(), 2u);
  EXPECT_EQ(scans[0].number_in_file, 1);
  EXPECT_EQ(scans[1].number_in_file, 3);
  EXPECT_EQ(notes, (std::vector<std::string>{"scan 2 holds no measured point and is left out"}));
  // A pose for the third reaches the third.
  WriteBytes(folder_ / "poses.txt", "three.ptx#3 1 0 0 0 0 0 10\n");
  const PlacedScans placed =
      ReadPlacedScans({folder_ / "three.ptx"}, folder_ / "poses.txt", ScanReaderOptions());
  EXPECT_EQ(placed.scans[0].points[0].z(), 3);
  EXPECT_EQ(placed.scans[1].points[0].z(), 13);
}

TEST_F(Ptx, TellsTheLineOfWhatIsWrong) {
  const std::string pose = kIdentity;
  const std::string samples = "1 2 3 0.1\n1 2 4 0.2\n1 3 3 0.3\n1 3 4 0.4\n";
  ExpectError("2\n2\n" + pose + "1 2 3 0.1\n1 2 x 0.2\n1 3 3 0.3\n1 3 4 0.4\n",
              "line 12: is \"1 2 x 0.2\"");
  ExpectError("2\n2\n" + pose + "1 2 3 0.1\n1 2 3\n1 3 3 0.33333\n1 3 4 0.4\n", "line 12");
  ExpectError("2\n2\n" + pose + "1 2 3 0.1 5\n1 2 3 1\n1 3 3 0.3\n1 3 4 0.4\n", "line 11");
  ExpectError("2\n2\n" + pose + "1 2 3 0.1 5 6 7 8\n1 2 3 1\n1 3 3 0.3\n1 3 4 0.4\n", "line 11");
  ExpectError("2\n2\n" + pose + "1 2 1e999 0.1\n1 2 3 1\n1 3 3 0.3\n1 3 4 0.4\n", "line 11");
  ExpectError("2\n2\n" + pose + samples + "9 9 9 0.5\n",
              "line 15: is \"9 9 9 0.5\", expected the number of columns");
  ExpectError("1000000000\n1000000000\n" + pose + samples, "line 2: says 1000000000 columns");
  ExpectError("3\n2\n" + pose + samples, "line 2: says 3 columns by 2 rows");
  ExpectError("-2\n2\n" + pose + samples, "line 1");
  ExpectError("2\n0\n" + pose + samples, "line 2");
  ExpectError("2\n2.5\n" + pose + samples, "line 2");
  ExpectError("2\n2\n0 0\n" + pose + samples, "line 3: is \"0 0\", expected the 3 numbers");
  ExpectError("2\n2\n0 0 nan\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" + samples,
              "line 3");
  ExpectError("2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" + samples,
              "line 10: the 4x4 pose that ends here is not a rotation");
  ExpectError("2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n-1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" + samples,
              "line 10");
  ExpectError("2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0 0\n0 0 0 0\n0 0 0 0\n0 0 0 0\n" + samples,
              "line 10");
  ExpectError("", "is empty");
  ExpectError("1\n2\n" + pose + "0 0 0 0.5\nnan nan nan 0.5\n",
              "no scan in it holds a measured point");
  EXPECT_INPUT_ERROR(ReadPtx(folder_ / "none.ptx", {}), "does not exist");
  EXPECT_INPUT_ERROR(ReadPtx(folder_.path(), {}), "is a folder");
}

TEST_F(Ptx, FindsTheUpAxisInTheOrderOfTheSamples) {
  // A cylinder of points around the scanner; `axis` is up.
  for (const int axis : {1, 2}) {
    std::string text = std::string("40\n20\n") + kIdentity;
    for (int column = 0; column < 40; ++column) {
      for (int k = 0; k < 20; ++k) {
        const double angle = 0.15 * column;
        Eigen::Vector3d point;
        point[axis] = -2 + 0.2 * k;
        point[(axis + 1) % 3] = 3 * std::cos(angle);
        point[(axis + 2) % 3] = 3 * std::sin(angle);
        for (int i = 0; i < 3; ++i) text += std::to_string(point[i]) + " ";
        text += "0.5\n";
      }
    }
    EXPECT_THAT(Read(text)[0].up, IsNearMatrix(Eigen::Vector3d(Eigen::Vector3d::Unit(axis)), 0));
  }
}

}  // namespace
}  // namespace roomtex
