#include "importers/e57.h"

#include <fstream>
#include <random>

#include "core/frames.h"
#include "tests/importers/e57_fixture.h"
#include "tests/support/run_command.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::SizeIs;

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
    EXPECT_EQ(scan.num_left_out, 4);
    const CommandResult import = RunCommandLine(
        "roomtex-import --quiet --input_path " + (folder_ / "site.e57") + " --output_path " +
        (folder_ / "site.ply") + " --report_path " + (folder_ / "report.json"));
    ASSERT_EQ(import.exit_code, 0) << import.err;
    EXPECT_THAT(ReadBytes(folder_ / "report.json"), HasSubstr("\"num_missing\": 4"));
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

}  // namespace
}  // namespace roomtex
