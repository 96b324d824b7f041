#include "importers/e57.h"

#include <filesystem>
#include <fstream>
#include <random>

#include <gmock/gmock.h>

#include "core/error.h"
#include "core/frames.h"
#include "importers/scan_reader.h"
#include "tests/importers/e57_bytes.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class E57 : public testing::Test {
 protected:
  std::vector<Scan> Read(const std::string& bytes, const std::string& part = "",
                         const E57Options& options = {}) {
    WriteBytes(folder_ / "site.e57", bytes);
    notes_.clear();
    return ReadE57(folder_ / "site.e57", part, options, &notes_);
  }
  // One scan of single floats.
  static std::string Cloud(const std::vector<Eigen::Vector3f>& points, const std::string& more,
                           size_t piece = 5000) {
    std::vector<std::string> streams(3);
    for (const Eigen::Vector3f& point : points) {
      for (int i = 0; i < 3; ++i) streams[i] += Bytes(point[i]);
    }
    E57Bytes file;
    const uint64_t offset = file.AddPoints(streams, piece);
    return file.Finish(E57Xml(ScanXml(offset, points.size(), SinglesXml(), more)));
  }
  void ExpectError(const std::string& bytes, const std::string& message) {
    EXPECT_INPUT_ERROR(Read(bytes), message);
    EXPECT_INPUT_ERROR(Read(bytes), folder_ / "site.e57");
  }
  TempFolder folder_;
  std::vector<std::string> notes_;
};

TEST_F(E57, ChecksumsAreCrc32c) {
  EXPECT_EQ(Crc32c("123456789"), 0xe3069283u);              // the check value of the algorithm
  EXPECT_EQ(Crc32c(std::string(32, '\0')), 0x8a9136aau);    // RFC 3720, B.4
  EXPECT_EQ(Crc32c(std::string(32, '\xff')), 0x62a8ab43u);  // RFC 3720, B.4
  EXPECT_EQ(Crc32c(""), 0u);
}

// Everything but the header lies behind 5 GB that take no room on the disk.
TEST_F(E57, ReadsWhatLiesBeyondFourGigabytes) {
  constexpr uint64_t kHole = uint64_t{5} << 30;
  E57Bytes file(kHole);
  const uint64_t offset = file.AddPoints(
      {StreamOf<float>({1, 2, 3}), StreamOf<float>({4, 5, 6}), StreamOf<float>({7, 8, 9})});
  const std::string bytes = file.Finish(E57Xml(ScanXml(offset, 3, SinglesXml())));
  WriteBytes(folder_ / "site.e57", bytes.substr(0, E57Bytes::kPage));
  {
    std::fstream stream(folder_ / "site.e57", std::ios::binary | std::ios::in | std::ios::out);
    stream.seekp(static_cast<std::streamoff>(kHole));
    stream << bytes;
  }
  E57Options options;
  options.check = false;  // the hole has no checksums
  const std::vector<Scan> scans = ReadE57(folder_ / "site.e57", "", options, &notes_);
  ASSERT_EQ(scans.size(), 1u);
  ASSERT_EQ(scans[0].points.size(), 3u);
  EXPECT_EQ(scans[0].points[2], Eigen::Vector3d(3, 6, 9));
  EXPECT_INPUT_ERROR(ReadE57(folder_ / "site.e57", "", {}, &notes_), "checksum of page");
}

TEST_F(E57, ReadsIntegersOfEveryWidthAcrossPackets) {
  std::mt19937_64 random(7);
  for (int bits = 1; bits <= 64; ++bits) {
    const uint64_t range = ~uint64_t{0} >> (64 - bits);
    const int64_t minimum = bits == 64 ? std::numeric_limits<int64_t>::min() : -5;
    const auto maximum = static_cast<int64_t>(static_cast<uint64_t>(minimum) + range);
    if (bits == 63) continue;  // -5 and 2^63 numbers more are no range of int64
    std::vector<uint64_t> raw;
    for (int i = 0; i < 300; ++i) raw.push_back(random() & range);
    const std::vector<float> ones(raw.size(), 1.0f);
    E57Bytes file;
    const uint64_t offset =
        file.AddPoints({BitStream(raw, bits), StreamOf(ones), StreamOf(ones)}, 13);
    const std::string prototype =
        Element("cartesianX", "ScaledInteger", "",
                "minimum=\"" + std::to_string(minimum) + "\" maximum=\"" + std::to_string(maximum) +
                    "\" scale=\"2.5e-001\" offset=\"3\"") +
        Element("cartesianY", "Float", "", "precision=\"single\"") +
        Element("cartesianZ", "Float", "", "precision=\"single\"");
    const Scan scan = Read(file.Finish(E57Xml(ScanXml(offset, raw.size(), prototype))))[0];
    ASSERT_EQ(scan.points.size(), raw.size()) << bits;
    for (size_t i = 0; i < raw.size(); ++i) {
      const auto value = static_cast<int64_t>(raw[i] + static_cast<uint64_t>(minimum));
      ASSERT_DOUBLE_EQ(scan.points[i].x(), static_cast<double>(value) * 0.25 + 3) << bits;
    }
  }
}

TEST_F(E57, ReadsFloatsWhateverThePiecesOfTheirStreams) {
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 5000; ++i) points.emplace_back(1 + 0.1f * i, -2.5f * i, 1e-3f * i * i);
  for (const size_t piece : {3u, 1000u, 20000u}) {
    const Scan scan = Read(Cloud(points, "", piece))[0];
    ASSERT_THAT(scan.points, SizeIs(5000));
    EXPECT_EQ(scan.kind(), Scan::Kind::kCloud);
    for (size_t i = 0; i < points.size(); ++i) {
      ASSERT_THAT(scan.points[i], IsNearMatrix(points[i].cast<double>(), 0));
    }
  }
}

// x is said by doubles, which come eight bytes at a time, y takes none, and z one bit.
TEST_F(E57, StreamsNeedNotHoldTheSameNumberOfRecords) {
  std::vector<double> x;
  std::vector<uint64_t> z;
  for (int i = 0; i < 200; ++i) x.push_back(1.0 / (i + 1)), z.push_back(i % 3 == 0);
  E57Bytes file;
  const std::string empty_packet("\2\0\3\0", 4), no_records("\1\0\7\0\0\0\0\0", 8);
  const std::string index_packet = std::string("\0\0\x1f\0", 4) + std::string(28, '\x7f');
  const uint64_t offset = file.AddPoints({StreamOf(x), "", BitStream(z, 1)}, 10,
                                         empty_packet + index_packet + no_records);
  const std::string prototype = Element("cartesianX", "Float") + IntegerXml("cartesianY", 7, 7) +
                                IntegerXml("cartesianZ", 4, 5);
  const Scan scan = Read(file.Finish(E57Xml(ScanXml(offset, 200, prototype))))[0];
  ASSERT_THAT(scan.points, SizeIs(200));
  for (int i = 0; i < 200; ++i) {
    ASSERT_THAT(scan.points[i],
                IsNearMatrix(Eigen::Vector3d(1.0 / (i + 1), 7, i % 3 == 0 ? 5 : 4), 0));
  }
}

TEST_F(E57, RecordsThatTakeNoBytesAreOnePoint) {
  E57Bytes file;
  const uint64_t offset = file.AddPoints({"", "", ""});
  const std::string prototype = IntegerXml("cartesianX", 1, 1) + IntegerXml("cartesianY", 2, 2) +
                                IntegerXml("cartesianZ", 3, 3);
  const Scan scan = Read(file.Finish(E57Xml(ScanXml(offset, 4000000000000000000u, prototype))))[0];
  ASSERT_THAT(scan.points, SizeIs(1));
  EXPECT_THAT(scan.points[0], IsNearMatrix(Eigen::Vector3d(1, 2, 3), 0));
}

TEST_F(E57, SphericalCoordinates) {
  E57Bytes file;
  const uint64_t offset =
      file.AddPoints({StreamOf<double>({2, 2, 2, 0, -1}), StreamOf<double>({0, kPi / 2, kPi, 1, 1}),
                      StreamOf<double>({0, 0, kPi / 6, 1, 1})});
  const std::string prototype = Element("sphericalRange", "Float") +
                                Element("sphericalAzimuth", "Float") +
                                Element("sphericalElevation", "Float");
  const Scan scan = Read(file.Finish(E57Xml(ScanXml(offset, 5, prototype))))[0];
  ASSERT_THAT(scan.points, SizeIs(3));  // the others have no range
  EXPECT_THAT(scan.points[0], IsNearMatrix(Eigen::Vector3d(2, 0, 0), 1e-15));
  EXPECT_THAT(scan.points[1], IsNearMatrix(Eigen::Vector3d(0, 2, 0), 1e-15));
  EXPECT_THAT(scan.points[2], IsNearMatrix(Eigen::Vector3d(-std::sqrt(3.0), 0, 1), 1e-15));
}

TEST_F(E57, InvalidPointsAreLeftOutHoweverTheyAreMarked) {
  const std::vector<float> x = {1, 2, 3, 4, std::numeric_limits<float>::quiet_NaN(), 6};
  const std::vector<float> other = {1, 1, 1, 1, 1, 1};
  for (const bool as_float : {false, true}) {
    E57Bytes file;
    const uint64_t offset = file.AddPoints(
        {StreamOf(x), StreamOf(other), StreamOf(other),
         as_float ? StreamOf<float>({0, 1, 2, 1, 0, 0}) : BitStream({0, 1, 2, 1, 0, 0}, 2)});
    const std::string state =
        as_float ? Element("cartesianInvalidState", "Float", "", "precision=\"single\"")
                 : IntegerXml("cartesianInvalidState", 0, 2);
    const Scan scan = Read(file.Finish(E57Xml(ScanXml(offset, 6, SinglesXml() + state))))[0];
    ASSERT_THAT(scan.points, SizeIs(2));
    EXPECT_EQ(scan.points[0].x(), 1);
    EXPECT_EQ(scan.points[1].x(), 6);
  }
}

TEST_F(E57, PosesMayLackTheirRotationOrTheirLength) {
  const auto numbers = [](const std::string& names, const std::vector<double>& values) {
    std::string xml;
    for (size_t i = 0; i < values.size(); ++i) {
      xml += Element(names.substr(i, 1), "Float", std::to_string(values[i]));
    }
    return xml;
  };
  const std::string translation =
      Element("translation", "Structure", numbers("xyz", {412345.5, -20, 3}));
  const std::string rotation = Element("rotation", "Structure", numbers("wxyz", {2, 0, 0, 2}));
  const Scan moved = Read(Cloud({{1, 2, 3}}, Element("pose", "Structure", translation)))[0];
  EXPECT_THAT(moved.points[0], IsNearMatrix(Eigen::Vector3d(412346.5, -18, 6), 0));
  EXPECT_THAT(moved.Station(), IsNearMatrix(Eigen::Vector3d(412345.5, -20, 3), 0));
  EXPECT_THAT(moved.up, IsNearMatrix(Eigen::Vector3d::UnitZ(), 0));
  E57Options options;
  options.meters_per_unit = 0.5;
  const Scan turned = Read(Cloud({{1, 2, 3}}, Element("pose", "Structure", rotation + translation)),
                           "", options)[0];
  EXPECT_THAT(turned.points[0], IsNearMatrix(Eigen::Vector3d(412345.5 / 2 - 1, -9.5, 3), 1e-9));
  EXPECT_THAT(turned.scan_from_station,
              IsNearRigid(Rigid{Eigen::Quaterniond(std::sqrt(0.5), 0, 0, std::sqrt(0.5)),
                                {412345.5 / 2, -10, 1.5}},
                          1e-12, 1e-9));
  EXPECT_THAT(Read(Cloud({{1, 2, 3}}, ""))[0].Station(), IsNearMatrix(Eigen::Vector3d(0, 0, 0), 0));
  ExpectError(
      Cloud({{1, 2, 3}}, Element("pose", "Structure",
                                 Element("rotation", "Structure", numbers("wxyz", {0, 0, 0, 0})))),
      "the quaternion 0");
  options.max_range = 2;  // from the station, metres
  EXPECT_THAT(
      Read(Cloud({{1, 2, 3}, {3, 3, 3}}, Element("pose", "Structure", translation)), "", options)[0]
          .points,
      SizeIs(1));
}

TEST_F(E57, IntensitiesGoFrom0To1ByTheirLimits) {
  const auto read = [&](const std::string& field, const std::string& stream,
                        const std::string& more) {
    E57Bytes file;
    const std::string x = StreamOf<float>({1, 2, 3});
    const uint64_t offset = file.AddPoints({x, x, x, stream});
    return Read(file.Finish(E57Xml(ScanXml(offset, 3, SinglesXml() + field, more))))[0].intensity;
  };
  const std::string bytes("\0\x33\xff", 3), floats = StreamOf<float>({10, 20, 30});
  const std::string single = Element("intensity", "Float", "", "precision=\"single\"");
  const auto limits = [](const std::string& type, const std::string& attributes,
                         const std::string& low, const std::string& high) {
    return Element("intensityLimits", "Structure",
                   Element("intensityMinimum", type, low, attributes) +
                       Element("intensityMaximum", type, high, attributes));
  };
  using testing::ElementsAre;
  using testing::FloatEq;
  EXPECT_THAT(read(IntegerXml("intensity", 0, 255), bytes, ""), ElementsAre(0, FloatEq(0.2f), 1));
  EXPECT_THAT(read(IntegerXml("intensity", 0, 255), bytes, limits("Integer", "", "", "510")),
              ElementsAre(0, FloatEq(0.1f), 0.5f));
  EXPECT_THAT(read(single, floats, ""), ElementsAre(10, 20, 30));
  EXPECT_THAT(read(single, floats, limits("Float", "", "1e+001", "5.0e+01")),
              ElementsAre(0, 0.25f, 0.5f));
  EXPECT_THAT(read(single, floats, limits("ScaledInteger", "scale=\"0.5\"", "20", "100")),
              ElementsAre(0, 0.25f, 0.5f));
  EXPECT_THAT(read(single, floats, limits("Float", "", "0", "0")), ElementsAre(10, 20, 30));
  EXPECT_THAT(read(IntegerXml("intensity", 4, 4), "", ""), ElementsAre(4, 4, 4));
  EXPECT_THAT(read(IntegerXml("nor:normalX", 0, 255), bytes, ""), ElementsAre(0, 0, 0));
}

TEST_F(E57, ColoursStandInForIntensitiesThatAreNotThere) {
  E57Bytes file;
  const std::string x = StreamOf<float>({1, 2, 3});
  const uint64_t offset = file.AddPoints(
      {x, x, x, StreamOf<uint16_t>({65535, 0, 65535}), StreamOf<uint16_t>({65535, 0, 0}),
       StreamOf<uint16_t>({65535, 0, 0}), BitStream({0, 0, 1}, 1)});
  std::string prototype = SinglesXml();
  for (const char* name : {"colorRed", "colorGreen", "colorBlue"}) {
    prototype += IntegerXml(name, 0, 65535);
  }
  prototype += IntegerXml("isColorInvalid", 0, 1);
  const Scan scan = Read(file.Finish(E57Xml(ScanXml(offset, 3, prototype))))[0];
  EXPECT_THAT(scan.intensity, testing::ElementsAre(testing::FloatEq(1), 0, 0));
}

// A scanner in the middle of a sphere: 12 columns of 5 rows from elevation +0.4 down to -0.4.
struct SphereScan {
  std::vector<uint64_t> rows, columns, returns;
  std::vector<float> xyz[3];

  static Eigen::Vector3d PointAt(int column, int row) {
    const double azimuth = 0.2 * column, elevation = 0.4 - 0.2 * row;
    return 5 * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                               std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
  }
  void Add(int column, int row, uint64_t row_index, uint64_t column_index, uint64_t number = 0,
           double scale = 1) {
    for (int i = 0; i < 3; ++i) {
      xyz[i].push_back(static_cast<float>(scale * PointAt(column, row)[i]));
    }
    rows.push_back(row_index);
    columns.push_back(column_index);
    returns.push_back(number);
  }
  std::string File(const std::string& bounds = "", uint64_t most = 15) const {
    int bits = 1;
    while (most >> bits != 0) ++bits;
    E57Bytes file;
    const uint64_t offset =
        file.AddPoints({StreamOf(xyz[0]), StreamOf(xyz[1]), StreamOf(xyz[2]), BitStream(rows, bits),
                        BitStream(columns, bits), BitStream(returns, 2)});
    const auto highest = static_cast<int64_t>((uint64_t{1} << bits) - 1);
    return file.Finish(
        E57Xml(ScanXml(offset, rows.size(),
                       SinglesXml() + IntegerXml("rowIndex", 0, highest) +
                           IntegerXml("columnIndex", 0, highest) + IntegerXml("returnIndex", 0, 3),
                       bounds)));
  }
  static std::string Bounds(int last_row, int last_column) {
    return Element("indexBounds", "Structure",
                   Element("rowMaximum", "Integer", std::to_string(last_row)) +
                       Element("columnMaximum", "Integer", std::to_string(last_column)));
  }
};

TEST_F(E57, TheGridStandsUprightWhateverTheSenseOfItsIndices) {
  for (const bool upward : {false, true}) {
    for (const bool transposed : {false, true}) {
      SphereScan sphere;
      for (int column = 0; column < 12; ++column) {
        for (int row = 0; row < 5; ++row) {
          if (column == 3 && row == 1) continue;
          const uint64_t index = upward ? 4 - row : row;
          if (transposed) sphere.Add(column, row, column, index);
          if (!transposed) sphere.Add(column, row, index, column);
        }
      }
      const std::string bounds = transposed ? SphereScan::Bounds(11, 4) : SphereScan::Bounds(4, 11);
      const Scan scan = Read(sphere.File(bounds))[0];
      EXPECT_EQ(scan.kind(), Scan::Kind::kGrid);
      ASSERT_EQ(scan.num_columns, 12);
      ASSERT_EQ(scan.num_rows, 5);
      EXPECT_EQ(scan.NumMissing(), 1);
      EXPECT_TRUE(scan.IsMissing(scan.Index(3, 1)));
      EXPECT_EQ(scan.intensity[scan.Index(3, 1)], 0);
      for (int column = 4; column < 12; ++column) {
        for (int row = 0; row < 5; ++row) {
          ASSERT_THAT(scan.points[scan.Index(column, row)],
                      IsNearMatrix(SphereScan::PointAt(column, row), 1e-6));
        }
      }
    }
  }
}

// Older programs write no state; a point of a cloud may lie anywhere.
TEST_F(E57, APointInTheScannerIsMissingFromAGrid) {
  SphereScan sphere;
  for (int column = 0; column < 12; ++column) {
    for (int row = 0; row < 5; ++row) {
      sphere.Add(column, row, row, column, 0, column == 4 && row == 2 ? 0.0 : 1.0);
    }
  }
  const Scan scan = Read(sphere.File())[0];
  EXPECT_EQ(scan.NumMissing(), 1);
  EXPECT_TRUE(scan.IsMissing(scan.Index(4, 2)));
  EXPECT_THAT(Read(Cloud({{0, 0, 0}, {1, 2, 3}}, ""))[0].points, SizeIs(2));
}

TEST_F(E57, OfTwoPointsInACellTheFirstReturnStays) {
  SphereScan sphere;
  for (int column = 0; column < 12; ++column) {
    for (int row = 0; row < 5; ++row) {
      sphere.Add(column, row, row, column, 1, 2.0);  // behind the first return
      sphere.Add(column, row, row, column, 0);
      sphere.Add(column, row, row, column, 0, 3.0);
    }
  }
  const Scan scan = Read(sphere.File())[0];
  ASSERT_THAT(scan.points, SizeIs(60));
  for (const Eigen::Vector3d& point : scan.points) EXPECT_NEAR(point.norm(), 5, 1e-6);
}

TEST_F(E57, IndicesDecideWhereTheBoundsAreWrong) {
  SphereScan sphere;
  for (int column = 0; column < 12; ++column) {
    for (int row = 0; row < 5; ++row) sphere.Add(column, row, row + 2, column + 1);
  }
  const Scan inside = Read(sphere.File(SphereScan::Bounds(9, 14)))[0];
  EXPECT_EQ(inside.num_rows, 10);
  EXPECT_EQ(inside.num_columns, 15);
  EXPECT_THAT(inside.points[inside.Index(3, 4)], IsNearMatrix(SphereScan::PointAt(2, 2), 1e-6));
  EXPECT_THAT(notes_, IsEmpty());
  const Scan beyond = Read(sphere.File(SphereScan::Bounds(4, 11)))[0];
  EXPECT_EQ(beyond.num_rows, 5);
  EXPECT_EQ(beyond.num_columns, 12);
  EXPECT_THAT(notes_, testing::ElementsAre(HasSubstr("beyond its indexBounds of 12 columns x 5")));
  const Scan huge = Read(sphere.File(SphereScan::Bounds(2000000000, 2000000000)))[0];
  EXPECT_EQ(huge.num_rows, 5);
}

TEST_F(E57, RowsAndColumnsThatAThinnedScanLostAreLeftOut) {
  SphereScan thinned, scattered;
  for (int column = 0; column < 12; ++column) {
    for (int row = 0; row < 5; ++row) {
      thinned.Add(column, row, 1000 * row, 1000 * column);
      scattered.Add(column, row, 997 * (5 * column + row), 991 * (60 - 5 * column - row));
    }
  }
  const Scan scan = Read(thinned.File("", 60000))[0];
  ASSERT_EQ(scan.num_rows, 5);
  ASSERT_EQ(scan.num_columns, 12);
  EXPECT_THAT(scan.points[scan.Index(7, 3)], IsNearMatrix(SphereScan::PointAt(7, 3), 1e-6));
  EXPECT_THAT(notes_, testing::ElementsAre(HasSubstr("without a point are left out")));
  // 60 points in 60 rows and 60 columns are a grid: not one that says much, but a small one.
  EXPECT_EQ(Read(scattered.File("", 60000))[0].num_rows, 60);
}

TEST_F(E57, MemoryFollowsThePointsNotTheirIndices) {
  SphereScan sphere;
  for (int i = 0; i < 300; ++i) sphere.Add(i % 12, i % 5, 3000000 * i, 2000000 * i);
  const Scan scan = Read(sphere.File("", 900000000))[0];
  EXPECT_EQ(scan.kind(), Scan::Kind::kCloud);
  EXPECT_THAT(scan.points, SizeIs(300));
  EXPECT_THAT(notes_, testing::ElementsAre(HasSubstr("is read as a cloud")));
}

TEST_F(E57, IndicesMayBeFloatsAndNoNumbers) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = HUGE_VALF;
  const auto read = [&](const std::vector<float>& rows) {
    E57Bytes file;
    const std::string x = StreamOf<float>({1, 2, 3, 4});
    const uint64_t offset =
        file.AddPoints({x, x, x, StreamOf(rows), StreamOf<float>({0, 1, 0, 1})});
    return Read(file.Finish(
        E57Xml(ScanXml(offset, 4,
                       SinglesXml() + Element("rowIndex", "Float", "", "precision=\"single\"") +
                           Element("columnIndex", "Float", "", "precision=\"single\"")))));
  };
  EXPECT_EQ(read({0, 0, 1, 1})[0].NumMissing(), 0);
  EXPECT_EQ(read({0, 0, 1, nan})[0].NumMissing(), 1);
  EXPECT_EQ(read({0, -inf, 1, inf})[0].NumMissing(), 2);
  EXPECT_EQ(read({nan, nan, nan, nan})[0].kind(), Scan::Kind::kCloud);
}

class E57WithScans : public E57 {
 protected:
  // Three scans, the second without points.
  static std::string ThreeScans(const std::string& third_name) {
    E57Bytes file;
    const std::string one = StreamOf<float>({1}), two = StreamOf<float>({2, 2});
    const uint64_t a = file.AddPoints({one, one, one}), c = file.AddPoints({two, two, two});
    const auto named = [](const std::string& name, const std::string& guid) {
      return Element("guid", "String", "<![CDATA[" + guid + "]]>") +
             Element("name", "String", "<![CDATA[" + name + "]]>");
    };
    return file.Finish(E57Xml(ScanXml(a, 1, SinglesXml(), named("hall & stairs", "{A}")) +
                              ScanXml(0, 0, SinglesXml(), named("2", "{B}")) +
                              ScanXml(c, 2, SinglesXml(), named(third_name, "{C}"))));
  }
};

TEST_F(E57WithScans, AllOrOneByNameNumberOrGuid) {
  const std::string bytes = ThreeScans("roof");
  const std::vector<Scan> all = Read(bytes);
  ASSERT_THAT(all, SizeIs(2));
  EXPECT_EQ(all[0].name, "hall & stairs");
  EXPECT_EQ(all[1].name, "roof");
  EXPECT_THAT(notes_, testing::ElementsAre(HasSubstr("scan 2 \"2\" holds no measured point")));
  EXPECT_EQ(Read(bytes, "hall & stairs")[0].points.size(), 1u);
  EXPECT_EQ(Read(bytes, "3")[0].points.size(), 2u);
  EXPECT_EQ(Read(bytes, "{C}")[0].points.size(), 2u);
  EXPECT_INPUT_ERROR(Read(bytes, "2"), "no scan in it holds a measured point");
  EXPECT_INPUT_ERROR(Read(bytes, "4"), "has no scan \"4\"; it has 1 \"hall & stairs\"");
  EXPECT_INPUT_ERROR(Read(bytes, "cellar"), "has no scan \"cellar\"");
  EXPECT_INPUT_ERROR(Read(ThreeScans("2"), "2"), "has 2 scans of the name \"2\"");
}

TEST_F(E57, ReadsOffsetsBeyondFourGigabytes) {
  // The pages between the header and the points are a hole in the file.
  const std::string near = Cloud({{1, 2, 3}, {4, 5, 6}}, "");
  const uint64_t kFar = uint64_t{5} << 30;
  const auto far_of = [&](uint64_t offset) { return offset + kFar - E57Bytes::kPage; };
  E57Bytes points;
  const std::string x = StreamOf<float>({1, 4}), y = StreamOf<float>({2, 5}),
                    z = StreamOf<float>({3, 6});
  points.AddBlob(std::string(1020 - 48 - 16, '\0'));  // fills the first page
  const uint64_t offset = points.AddPoints({x, y, z});
  std::string file = points.Finish(E57Xml(ScanXml(far_of(offset), 2, SinglesXml())));
  ASSERT_EQ(offset, E57Bytes::kPage);
  const auto put = [&](size_t at, uint64_t number) { file.replace(at, 8, Bytes(number)); };
  put(16, file.size() + kFar - E57Bytes::kPage);
  put(24, far_of(LittleEndian<uint64_t>(&file[24])));
  put(offset + 16, far_of(LittleEndian<uint64_t>(&file[offset + 16])));
  const std::string path = folder_ / "large.e57";
  {
    std::ofstream stream(path, std::ios::binary);
    stream << file.substr(0, E57Bytes::kPage);
    stream.seekp(static_cast<std::streamoff>(kFar));
    stream << file.substr(E57Bytes::kPage);
  }
  E57Options options;
  options.check = false;  // five million pages of zeros have no checksums
  const Scan scan = ReadE57(path, "", options, nullptr)[0];
  ASSERT_THAT(scan.points, SizeIs(2));
  EXPECT_THAT(scan.points[1], IsNearMatrix(Eigen::Vector3d(4, 5, 6), 0));
}

TEST_F(E57, AWrongChecksumIsToldWithItsPage) {
  std::vector<Eigen::Vector3f> points(1000, Eigen::Vector3f(1, 2, 3));
  std::string bytes = Cloud(points, "");
  bytes[5000] = static_cast<char>(bytes[5000] ^ 4);
  ExpectError(bytes, "byte 4096: the checksum of page 4");
  ExpectError(bytes, "--E57.check 0");
  E57Options options;
  options.check = false;
  EXPECT_THAT(Read(bytes, "", options)[0].points, SizeIs(1000));
  ScanReaderOptions reader;
  EXPECT_THAT(reader.Problems(), IsEmpty());
}

TEST_F(E57, IsRefusedWhereverItIsCutOff) {
  const std::string good = Cloud(std::vector<Eigen::Vector3f>(400, {1, 2, 3}), "");
  ASSERT_THAT(Read(good)[0].points, SizeIs(400));
  for (size_t size = 1; size < good.size(); size += 97) {
    EXPECT_THROW(Read(good.substr(0, size)), InputError) << "cut after byte " << size;
  }
}

TEST_F(E57, TellsTheByteOfWhatIsWrong) {
  const std::string good = Cloud(std::vector<Eigen::Vector3f>(400, {1, 2, 3}), "");
  const auto with = [&](size_t at, const std::string& bytes) {
    std::string changed = good;
    changed.replace(at, bytes.size(), bytes);
    return E57Bytes::Mended(changed);
  };
  ExpectError(with(8, Bytes(uint32_t{2})), "byte 8: says version 2");
  ExpectError(with(16, Bytes(uint64_t{1} << 60)), "byte 16: says that the file has");
  ExpectError(with(16, Bytes(uint64_t{1000})), "byte 16: says that the file has 1000 bytes");
  ExpectError(with(24, Bytes(uint64_t{1021})), "byte 1021: the XML is said to lie in a checksum");
  ExpectError(with(24, Bytes(uint64_t{1} << 62)), "behind the end of the file");
  ExpectError(with(32, Bytes(uint64_t{1} << 40)), "byte 32: says that the XML has");
  ExpectError(with(40, Bytes(uint64_t{0})), "byte 40: says pages of 0 bytes");
  ExpectError(with(40, Bytes(uint64_t{1} << 40)), "byte 40: says pages of");
  ExpectError(with(48, "\2"), "byte 48: begins with 2, expected a section of points");
  ExpectError(with(56, Bytes(uint64_t{1} << 50)), "byte 56: says a section of");
  ExpectError(with(64, Bytes(uint64_t{4})), "byte 64: the data of a section do not lie in it");
  ExpectError(with(64, Bytes(uint64_t{1020})), "the data of a section is said to lie in a");
  ExpectError(with(80, "\7"), "byte 80: is a packet of type 7");
  ExpectError(with(82, Bytes(uint16_t{0xffff})), "byte 82: says a packet of 65536 bytes");
  ExpectError(with(82, Bytes(uint16_t{1})), "byte 82: says a packet of 2 bytes");
  ExpectError(with(84, Bytes(uint16_t{4})), "byte 84: says 4 streams");
  ExpectError(with(86, Bytes(uint16_t{60000})), "byte 80: the streams of a packet");
  ExpectError(with(86, Bytes(uint16_t{0})), "the points end here, after 0 of 400");
}

TEST_F(E57, TellsWhatIsWrongInItsXml) {
  const auto xml_file = [](const std::string& xml) { return E57Bytes().Finish(xml); };
  const auto scan = [&](const std::string& prototype, const std::string& attributes,
                        const std::string& more = "") {
    return xml_file(
        E57Xml(Element("vectorChild", "Structure",
                       more + Element("points", "CompressedVector",
                                      Element("prototype", "Structure", prototype), attributes))));
  };
  const std::string here = "fileOffset=\"48\" recordCount=\"5\"";
  ExpectError(xml_file("<e57Root>"), "the XML cannot be read here");
  ExpectError(xml_file("hello"), "the XML");
  ExpectError(xml_file("<other/>"), "no element e57Root");
  ExpectError(xml_file(E57Xml("")), "holds no scan");
  ExpectError(xml_file(E57Xml(Element("vectorChild", "Structure"))), "has no element points");
  ExpectError(scan(SinglesXml(), "fileOffset=\"48\" recordCount=\"-5\""), "says -5 points");
  ExpectError(scan(SinglesXml(), "fileOffset=\"48\" recordCount=\"many\""), "\"many\", expected");
  ExpectError(scan(SinglesXml(), "fileOffset=\"-8\" recordCount=\"5\""), "at byte -8");
  ExpectError(scan(SinglesXml(), "fileOffset=\"99999999\" recordCount=\"5\""), "behind the end");
  ExpectError(scan("", here), "have no fields");
  ExpectError(scan(Element("x", "Blob"), here), "has the type \"Blob\"");
  ExpectError(scan(IntegerXml("x", 5, 4), here), "minimum of x is above its maximum");
  ExpectError(scan(Element("x", "Integer", "", "minimum=\"a\""), here), "attribute minimum of x");
  ExpectError(scan(Element("x", "ScaledInteger", "", "scale=\"nan\""), here),
              "attribute scale of x is \"nan\"");
  ExpectError(scan(SinglesXml(), here,
                   Element("pose", "Structure",
                           Element("translation", "Structure", Element("x", "Float", "1,5")))),
              "element x is \"1,5\", expected a number");
  // No document type, no entity of its own.
  ExpectError(xml_file("<!DOCTYPE e57Root [<!ENTITY a SYSTEM \"file:///etc/passwd\">]><e57Root>"
                       "<data3D>&a;</data3D></e57Root>"),
              "holds no scan");
}

TEST_F(E57, ADeclaredNumberOfPointsIsComparedWithTheBytes) {
  E57Bytes file;
  const std::string x = StreamOf<float>({1, 2, 3});
  const uint64_t offset = file.AddPoints({x, x, x});
  ExpectError(file.Finish(E57Xml(ScanXml(offset, 1000000000000, SinglesXml()))),
              "says 1000000000000 points, but the");
  E57Bytes other;
  const uint64_t at = other.AddPoints({x, x, x});
  ExpectError(other.Finish(E57Xml(ScanXml(at, 4, SinglesXml()))),
              "byte 128: the points end here, after 3 of 4");
}

TEST_F(E57, RecordsWithoutCoordinatesAreNoScan) {
  E57Bytes file;
  const uint64_t offset = file.AddPoints({std::string("\1\2\3", 3)});
  ExpectError(file.Finish(E57Xml(ScanXml(offset, 3, IntegerXml("intensity", 0, 255)))),
              "have neither cartesianX");
}

TEST_F(E57, ReadersOfScansTakeTheGridAndThePose) {
  SphereScan sphere;
  for (int column = 0; column < 12; ++column) {
    for (int row = 0; row < 5; ++row) sphere.Add(column, row, row, column);
  }
  const std::string path = folder_ / "a.rtpi";  // the content counts
  WriteBytes(path, sphere.File());
  EXPECT_EQ(ReadScanFile(path, {}).format, "E57");
  EXPECT_THAT(ReadScan(path + "#1", {}).points, SizeIs(60));
  EXPECT_INPUT_ERROR(ReadScan(path + "#2", {}), "has no scan \"2\"");
  EXPECT_INPUT_ERROR(ReadScan(folder_ / "none.e57#1", {}), "does not exist");
  std::filesystem::copy_file(path, folder_ / "b.e57");
  EXPECT_THAT(ReadScans({path, folder_ / "b.e57"}, "", {}), SizeIs(2));  // poses are their own
  WriteBytes(folder_ / "c#1.ptx",
             "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n"
             "0 0 0 1\n1 2 3 0.5\n");
  EXPECT_EQ(ReadScanFile(folder_ / "c#1.ptx", {}).format, "PTX");
  EXPECT_INPUT_ERROR(ReadScan(folder_ / "c#1.ptx#1", {}), "is no E57");
}

}  // namespace
}  // namespace roomtex
