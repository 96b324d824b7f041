#include "importers/pcd.h"

#include <cstring>

#include <gmock/gmock.h>
#include <pcl/io/pcd_io.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include "core/error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

Scan MakeScan(double offset = 0) {
  Scan scan;
  scan.num_columns = 6;
  scan.num_rows = 4;
  scan.scan_from_station = {Eigen::Quaterniond(0.9, 0.1, -0.2, 0.3).normalized(), {offset, 2, 3}};
  for (int i = 0; i < 24; ++i) {
    const bool missing = i % 5 == 2;
    scan.points.push_back(missing ? Scan::MissingPoint()
                                  : Eigen::Vector3d(offset + 0.25 * i, 1 + i * 0.125, -0.5 * i));
    scan.intensity.push_back(missing ? 0 : static_cast<float>(3 * i));
  }
  return scan;
}

pcl::PointCloud<pcl::PointXYZI> PclCloud(const Scan& scan) {
  pcl::PointCloud<pcl::PointXYZI> cloud(scan.num_columns, scan.num_rows);
  for (size_t i = 0; i < scan.points.size(); ++i) {
    cloud[i].getVector3fMap() = scan.points[i].cast<float>();
    cloud[i].intensity = scan.intensity[i];
  }
  cloud.sensor_origin_ << scan.Station().cast<float>(), 0;
  cloud.sensor_orientation_ = scan.scan_from_station.rotation.cast<float>();
  return cloud;
}

void ExpectSameScan(const Scan& a, const Scan& b, double tolerance) {
  ASSERT_EQ(a.num_columns, b.num_columns);
  ASSERT_EQ(a.num_rows, b.num_rows);
  EXPECT_THAT(a.scan_from_station, IsNearRigid(b.scan_from_station, 1e-5, 1e-6));
  for (int i = 0; i < static_cast<int>(a.points.size()); ++i) {
    ASSERT_EQ(a.IsMissing(i), b.IsMissing(i));
    EXPECT_EQ(a.intensity[i], b.intensity[i]);
    if (a.IsMissing(i)) continue;
    EXPECT_THAT(a.points[i], IsNearMatrix(b.points[i], tolerance));
  }
}

class Pcd : public testing::Test {
 protected:
  Scan Read(const std::string& bytes) {
    WriteBytes(folder_ / "scan.pcd", bytes);
    return ReadPcd(folder_ / "scan.pcd", {});
  }
  void ExpectError(const std::string& bytes, const std::string& message) {
    EXPECT_INPUT_ERROR(Read(bytes), message);
    EXPECT_INPUT_ERROR(Read(bytes), folder_ / "scan.pcd");
  }
  TempFolder folder_;
};

TEST_F(Pcd, RoundTripIsExactInFloat) {
  const Scan scan = MakeScan();
  WritePcd(scan, folder_ / "a.pcd");
  ExpectSameScan(ReadPcd(folder_ / "a.pcd", {}), scan, 0);
}

TEST_F(Pcd, LargeCoordinatesKeepTheirDigits) {
  const Scan scan = MakeScan(5412345.654321);
  WritePcd(scan, folder_ / "a.pcd");
  const Scan again = ReadPcd(folder_ / "a.pcd", {});
  ExpectSameScan(again, scan, 0);
  EXPECT_THAT(again.Station(), IsNearMatrix(scan.Station(), 0));
}

TEST_F(Pcd, WrittenFilesOpenInPcl) {
  const Scan scan = MakeScan();
  WritePcd(scan, folder_ / "a.pcd");
  pcl::PointCloud<pcl::PointXYZI> cloud;
  ASSERT_EQ(pcl::io::loadPCDFile(folder_ / "a.pcd", cloud), 0);
  ASSERT_EQ(cloud.width, 6u);
  ASSERT_EQ(cloud.height, 4u);
  EXPECT_THAT(cloud.sensor_origin_.head<3>(), IsNearMatrix(Eigen::Vector3f(0, 2, 3), 1e-6f));
  for (int i = 0; i < 24; ++i) {
    ASSERT_EQ(std::isnan(cloud[i].x), scan.IsMissing(i));
    EXPECT_EQ(cloud[i].intensity, scan.intensity[i]);
    if (scan.IsMissing(i)) continue;
    EXPECT_THAT(cloud[i].getVector3fMap().cast<double>().eval(),
                IsNearMatrix(scan.points[i], 1e-6));
  }
}

TEST_F(Pcd, ReadsAllThreeKindsThatPclWrites) {
  const Scan scan = MakeScan();
  const auto cloud = PclCloud(scan);
  pcl::PCDWriter writer;
  std::string kind;
  ASSERT_EQ(writer.writeASCII(folder_ / "a.pcd", cloud), 0);
  ExpectSameScan(ReadPcd(folder_ / "a.pcd", {}, &kind), scan, 1e-6);
  EXPECT_EQ(kind, "ascii");
  ASSERT_EQ(writer.writeBinary(folder_ / "b.pcd", cloud), 0);
  ExpectSameScan(ReadPcd(folder_ / "b.pcd", {}, &kind), scan, 1e-6);
  EXPECT_EQ(kind, "binary");
  ASSERT_EQ(writer.writeBinaryCompressed(folder_ / "c.pcd", cloud), 0);
  ExpectSameScan(ReadPcd(folder_ / "c.pcd", {}, &kind), scan, 1e-6);
  EXPECT_EQ(kind, "binary_compressed");
}

// Versions of PCL before 1.9 leave the rest of a page behind the data.
TEST_F(Pcd, ZerosMayFollowBinaryData) {
  const Scan scan = MakeScan();
  const auto cloud = PclCloud(scan);
  pcl::PCDWriter writer;
  ASSERT_EQ(writer.writeBinary(folder_ / "b.pcd", cloud), 0);
  ASSERT_EQ(writer.writeBinaryCompressed(folder_ / "c.pcd", cloud), 0);
  for (const char* name : {"b.pcd", "c.pcd"}) {
    const std::string bytes = ReadBytes(folder_ / name);
    ExpectSameScan(Read(bytes + std::string(3900, '\0')), scan, 1e-6);
    ExpectError(bytes + std::string(3900, '\0') + "x", "bytes of data follow the header");
    ExpectError(bytes + std::string(1 << 17, '\0'), "bytes of data follow the header");
  }
}

TEST_F(Pcd, SkipsPaddingAndTakesTheGreyOfColours) {
  pcl::PointCloud<pcl::PointXYZRGBNormal> cloud(3, 2);
  for (int i = 0; i < 6; ++i) {
    cloud[i].getVector3fMap() = Eigen::Vector3f(1.0f + i, 2, 3);
    cloud[i].r = 200;
    cloud[i].normal_x = 77;
  }
  for (const bool compressed : {false, true}) {
    pcl::PCDWriter writer;
    ASSERT_EQ(compressed ? writer.writeBinaryCompressed(folder_ / "c.pcd", cloud)
                         : writer.writeBinary(folder_ / "c.pcd", cloud),
              0);
    const Scan scan = ReadPcd(folder_ / "c.pcd", {});
    for (int i = 0; i < 6; ++i) {
      EXPECT_THAT(scan.points[i], IsNearMatrix(Eigen::Vector3d(1 + i, 2, 3), 0));
      EXPECT_NEAR(scan.intensity[i], 0.299 * 200, 1e-4);  // the grey of the colours
      EXPECT_TRUE(scan.colors.empty());
    }
  }
}

std::string Header(const std::string& size_and_data) {
  return "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 "
         "1 1\n" +
         size_and_data;
}
const char kAscii[] = "WIDTH 2\nHEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA ascii\n";

TEST_F(Pcd, ReadsUnitsRangesAndWhatIsNotANumber) {
  WriteBytes(folder_ / "a.pcd",
             Header(kAscii) + "1000 0 0 7\nnan nan nan 7\r\n0 0 0 7\n0 9000 0 7\n");
  PcdOptions options;
  options.meters_per_unit = 1e-3;
  options.max_range = 5;
  const Scan scan = ReadPcd(folder_ / "a.pcd", options);
  EXPECT_THAT(scan.points[0], IsNearMatrix(Eigen::Vector3d(1, 0, 0), 1e-12));
  EXPECT_EQ(scan.NumMissing(), 3);
  EXPECT_EQ(scan.intensity[1], 0);
}

TEST_F(Pcd, AnUnorganisedCloudIsRefused) {
  ExpectError(
      Header("WIDTH 4\nHEIGHT 1\nPOINTS 4\nDATA ascii\n1 2 3 4\n1 2 3 4\n1 2 3 4\n1 2 3 4\n"),
      "is a cloud without a grid (HEIGHT 1)");
}

TEST_F(Pcd, TellsTheLineOrByteOfWhatIsWrong) {
  const std::string points = "1 2 3 4\n2 2 3 4\n3 2 3 4\n4 2 3 4\n";
  ASSERT_EQ(Read(Header(kAscii) + points).NumMissing(), 0);
  ExpectError(Header(kAscii) + "1 2 3 4\n2 2 x 4\n3 2 3 4\n4 2 3 4\n", "line 13: is \"2 2 x 4\"");
  ExpectError(Header(kAscii) + "1 2 3 4\n2,5 2 0,5 4\n3 2 3 4\n4 2 3 4\n",
              "expected 4 numbers. Its numbers have decimal commas: write them with points");
  ExpectError(Header("WIDTH 2\nHEIGHT 2\nVIEWPOINT 0,5 0 0 1 0 0 0\nPOINTS 4\nDATA ascii\n"),
              "no line of a PCD header. Its numbers have decimal commas");
  ExpectError(Header(kAscii) + "1 2 3 4\n2 2 3.25\n3 2 3 4\n4 2 3 4\n", "line 13");
  ExpectError(Header(kAscii) + "1 2 3 4 5\n2 2 3\n3 2 3 4\n4 2 3 4\n", "line 12");
  ExpectError(Header(kAscii) + points + "5 5 5 5\n", "line 16: is \"5 5 5 5\", expected the end");
  ExpectError(Header(kAscii) + "1 2 3 4.0000000000000000000000000000000000001\n",
              "ends after 1 of 4 points");
  ExpectError(Header("WIDTH 1000000000\nHEIGHT 2\nPOINTS 2000000000\nDATA ascii\n") + points,
              "bytes of data follow the header, expected at least 15999999999");
  ExpectError(
      Header("WIDTH 1000000000\nHEIGHT 1000000000\nPOINTS 1000000000000000000\nDATA binary\n") +
          points,
      "do not make a grid");
  ExpectError(Header("WIDTH -2\nHEIGHT 2\nPOINTS 4\nDATA ascii\n") + points,
              "line 7: is \"WIDTH -2\"");
  ExpectError(Header("WIDTH 0\nHEIGHT 2\nPOINTS 0\nDATA ascii\n"), "do not make a grid");
  ExpectError(Header("WIDTH 2\nHEIGHT 2\nPOINTS 5\nDATA ascii\n") + points,
              "POINTS 5 do not make a grid");
  ExpectError(Header("WIDTH 2\nHEIGHT 2\nPOINTS 4\nDATA hex\n") + points,
              "line 10: is \"DATA hex\"");
  ExpectError(Header("WIDTH 2\nHEIGHT 2\nVIEWPOINT 0 0 0 0 0 0 0\nPOINTS 4\nDATA ascii\n") + points,
              "line 9");
  ExpectError(Header("WIDTH 2\nHEIGHT 2\nPOINTS 4\n"), "no DATA line");
  ExpectError(
      "VERSION 0.7\nFIELDS x y\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\nWIDTH 2\nHEIGHT 2\nPOINTS 4\nDATA "
      "ascii\n",
      "without a float field z");
  ExpectError("VERSION 0.7\nFIELDS x y z\nSIZE 4 4 3\n", "line 3: is \"SIZE 4 4 3\"");
  ExpectError("VERSION 0.7\nFIELDS x y z\nSIZE 4 4\n", "line 3");
  ExpectError("VERSION 0.7\nFIELDS x y z\nCOUNT 1 1 2000000000\n", "line 3");
  ExpectError("VERSION 0.7\nFIELDS x y z\nTYPE F F Q\n", "line 3");
  ExpectError("nonsense\n", "line 1");
  ExpectError("", "no DATA line");
  ExpectError(Header(kAscii) + "nan nan nan 0\nnan nan nan 0\nnan nan nan 0\nnan nan nan 0\n",
              "no measured sample");
}

// pcl::PCDReader takes such data for more header lines; found by tests/fuzz/scan_reader_fuzz.cc.
TEST_F(Pcd, DataThatSpellHeaderLinesAreData) {
  for (const std::string words : {"COLUMNS @\n", "WIDTH 900000000\n",
                                  "FIELDS x\nSIZE 8\nCOUNT 99999\n", "DATA binary_compressed\n"}) {
    std::string data(64, '\x40');
    data.replace(0, words.size(), words);
    const Scan scan =
        Read(Header("WIDTH 2\nHEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA binary\n") + data);
    ASSERT_EQ(scan.num_columns, 2) << words;
    ASSERT_EQ(scan.num_rows, 2) << words;
    const double value = 3.0039215087890625;  // the float of four bytes 0x40
    EXPECT_THAT(scan.points[3], IsNearMatrix(Eigen::Vector3d(value, value, value), 0));
    EXPECT_EQ(scan.intensity[3], static_cast<float>(value));
    float first = 0;
    std::memcpy(&first, data.data(), sizeof(first));
    EXPECT_EQ(scan.points[0].x(), first);
  }
}

TEST_F(Pcd, BinaryFilesAreRefusedWhereverTheyAreCutOff) {
  const auto cloud = PclCloud(MakeScan());
  pcl::PCDWriter writer;
  ASSERT_EQ(writer.writeBinary(folder_ / "b.pcd", cloud), 0);
  ASSERT_EQ(writer.writeBinaryCompressed(folder_ / "c.pcd", cloud), 0);
  for (const char* name : {"b.pcd", "c.pcd"}) {
    const std::string good = ReadBytes(folder_ / name);
    for (size_t size = 0; size < good.size(); size += size + 40 < good.size() ? 7 : 1) {
      EXPECT_THROW(Read(good.substr(0, size)), InputError) << name << " cut after byte " << size;
    }
    EXPECT_THROW(Read(good + "x"), InputError);
  }
}

TEST_F(Pcd, DamagedCompressedDataIsAnErrorOrAScan) {
  const auto cloud = PclCloud(MakeScan());
  ASSERT_EQ(pcl::PCDWriter().writeBinaryCompressed(folder_ / "c.pcd", cloud), 0);
  const std::string good = ReadBytes(folder_ / "c.pcd");
  const size_t data = good.find("binary_compressed\n") + 18;
  for (size_t at = data; at < good.size(); ++at) {
    for (const char flip : {'\x01', '\x80', '\xff'}) {
      std::string bad = good;
      bad[at] = static_cast<char>(bad[at] ^ flip);
      try {
        EXPECT_EQ(Read(bad).points.size(), 24u);
      } catch (const InputError&) {
      }
    }
  }
}

}  // namespace
}  // namespace roomtex
