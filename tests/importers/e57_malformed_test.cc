// E57: what is refused, and with which place.

#include "tests/importers/e57_fixture.h"

namespace roomtex {
namespace {
using testing::IsEmpty;
using testing::SizeIs;

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

}  // namespace
}  // namespace roomtex
