#include "importers/ply.h"

#include <cstring>

#include <gmock/gmock.h>

#include "core/error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::ElementsAre;

class Ply : public testing::Test {
 protected:
  Scan Read(const std::string& bytes, const PlyOptions& options = {}) {
    WriteBytes(folder_ / "mesh.ply", bytes);
    return ReadPly(folder_ / "mesh.ply", options);
  }
  void ExpectError(const std::string& bytes, const std::string& message) {
    EXPECT_INPUT_ERROR(Read(bytes), message);
    EXPECT_INPUT_ERROR(Read(bytes), folder_ / "mesh.ply");
  }
  TempFolder folder_;
};

// Four vertices with a property that is not ours, a quad and a triangle with a quality, edges at
// the end.
std::string HeaderOf(const std::string& format) {
  return "ply\nformat " + format +
         " 1.0\ncomment made by hand\nobj_info x\nelement vertex 4\nproperty float x\nproperty "
         "double y\n"
         "property short z\nproperty uchar red\nproperty float intensity\nelement face 2\n"
         "property float quality\nproperty list uchar int vertex_indices\nelement edge 1\n"
         "property list uint ushort parts\nend_header\n";
}
const char kAsciiBody[] =
    "0 0 1 9 0.5\n1 0 1 9 1.5\n1 1.25 1 9 2.5\n0 1 -2 9 3.5\n"
    "0.5 4 0 1 2 3\n0.5 3 0 2 3\n3 7 8 9\n";

class BytesWriter {
 public:
  explicit BytesWriter(bool big) : big_(big) {}
  template <typename T>
  BytesWriter& Add(T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    for (size_t i = 0; i < sizeof(T); ++i) text_ += bytes[big_ ? sizeof(T) - 1 - i : i];
    return *this;
  }
  const std::string& text() const { return text_; }

 private:
  bool big_;
  std::string text_;
};

std::string BinaryBody(bool big) {
  BytesWriter bytes(big);
  const double vertices[4][3] = {{0, 0, 1}, {1, 0, 1}, {1, 1.25, 1}, {0, 1, -2}};
  for (int i = 0; i < 4; ++i) {
    bytes.Add(static_cast<float>(vertices[i][0])).Add(vertices[i][1]);
    bytes.Add(static_cast<int16_t>(vertices[i][2]))
        .Add(uint8_t{9})
        .Add(0.5f + static_cast<float>(i));
  }
  bytes.Add(0.5f).Add(uint8_t{4}).Add(int32_t{0}).Add(int32_t{1}).Add(int32_t{2}).Add(int32_t{3});
  bytes.Add(0.5f).Add(uint8_t{3}).Add(int32_t{0}).Add(int32_t{2}).Add(int32_t{3});
  bytes.Add(uint32_t{3}).Add(uint16_t{7}).Add(uint16_t{8}).Add(uint16_t{9});
  return bytes.text();
}

std::vector<std::string> AllFormats() {
  return {HeaderOf("ascii") + kAsciiBody, HeaderOf("binary_little_endian") + BinaryBody(false),
          HeaderOf("binary_big_endian") + BinaryBody(true)};
}

TEST_F(Ply, ReadsAsciiAndBothByteOrders) {
  const char* const formats[] = {"ascii", "little", "big"};
  for (int k = 0; k < 3; ++k) {
    WriteBytes(folder_ / "mesh.ply", AllFormats()[k]);
    std::string format;
    const Scan scan = ReadPly(folder_ / "mesh.ply", {}, &format);
    EXPECT_EQ(format, formats[k]);
    EXPECT_FALSE(scan.organised);
    ASSERT_EQ(scan.points.size(), 4u);
    EXPECT_EQ(scan.num_columns, 4);
    EXPECT_EQ(scan.num_rows, 1);
    EXPECT_THAT(scan.points[2], IsNearMatrix(Eigen::Vector3d(1, 1.25, 1), 0));
    EXPECT_THAT(scan.points[3], IsNearMatrix(Eigen::Vector3d(0, 1, -2), 0));
    EXPECT_THAT(scan.intensity, ElementsAre(0.5f, 1.5f, 2.5f, 3.5f));
    EXPECT_THAT(scan.triangles,
                ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 2, 3}));
  }
}

TEST_F(Ply, AcceptsFacesBeforeVerticesAndCarriageReturns) {
  const Scan scan = Read(
      "ply\r\nformat ascii 1.0\r\nelement face 1\r\nproperty list uchar int vertex_index\r\n"
      "element vertex 3\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n"
      "property float scalar_Intensity\r\nend_header\r\n3 0 1 2\r\n0 0 0 1\r\n\r\n1 0 0 2\r\n0 1 0 "
      "3\r\n");
  EXPECT_THAT(scan.triangles, ElementsAre(Triangle{0, 1, 2}));
  EXPECT_EQ(scan.intensity[2], 3);
}

TEST_F(Ply, AcceptsAByteOrderMarkAndSigns) {
  const Scan scan = Read(
      "\xEF\xBB\xBFply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n"
      "+0.0 0 0\n+1.5 0 -0\n0 +1 0\n3 0 1 2\n");
  EXPECT_THAT(scan.triangles, ElementsAre(Triangle{0, 1, 2}));
  EXPECT_EQ(scan.points[1].x(), 1.5);
}

// Every second triangle of a strip is turned over, so that all show the same side.
TEST_F(Ply, ReadsStripsOfTriangles) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
      "property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n";
  EXPECT_THAT(
      Read(header + "9 0 1 2 3 4 -1 2 3 4\n").triangles,
      ElementsAre(Triangle{0, 1, 2}, Triangle{2, 1, 3}, Triangle{2, 3, 4}, Triangle{2, 3, 4}));
  // A vertex that stands twice turns the strip and makes no triangle.
  EXPECT_THAT(Read(header + "5 0 1 1 2 3\n").triangles, ElementsAre(Triangle{1, 2, 3}));
  ExpectError(header + "3 0 1 5\n", "line 15: a face names a vertex that is none of the 5");
  ExpectError(header + "3 0 1 -2\n", "line 15: a face names a vertex that is none of the 5");
  ExpectError(header + "4 0 1 -1 2\n", "no triangle with three measured corners");
  ExpectError(header + "4 0 1 2\n", "line 15");
}

TEST_F(Ply, LeavesOutTrianglesAtMissingAndFarVertices) {
  std::string bytes = HeaderOf("ascii") + kAsciiBody;
  bytes.replace(bytes.find("0 0 1 9"), 7, "nan 0 1 9");
  ExpectError(bytes, "no triangle with three measured corners");
  PlyOptions options;
  options.meters_per_unit = 0.5;
  options.max_range = 1.0;  // the last vertex is at sqrt(5)/2 metres
  const Scan scan = Read(AllFormats()[0], options);
  EXPECT_EQ(scan.NumMissing(), 1);
  EXPECT_THAT(scan.points[2], IsNearMatrix(Eigen::Vector3d(0.5, 0.625, 0.5), 1e-12));
  EXPECT_THAT(scan.triangles, ElementsAre(Triangle{0, 1, 2}));
}

Scan GridScan(double offset) {
  Scan scan;
  scan.num_columns = 3;
  scan.num_rows = 2;
  scan.up = Eigen::Vector3d::UnitY();
  scan.scan_from_station.translation = {1, 2, 3};
  for (int i = 0; i < 6; ++i) {
    scan.points.push_back(i == 1 ? Scan::MissingPoint()
                                 : Eigen::Vector3d(offset + 0.125 * i, 1.0 / 3, -0.5 * i));
    scan.intensity.push_back(i == 1 ? 0.0f : 10.0f * static_cast<float>(i));
  }
  return scan;
}

TEST_F(Ply, RoundTripKeepsVerticesFacesUpAndStation) {
  const std::vector<Triangle> triangles = {{0, 3, 4}, {2, 4, 5}};
  for (const double offset : {0.0, 5412345.654321}) {
    const Scan scan = GridScan(offset);
    WritePly({{&scan, &triangles}}, folder_ / "a.ply");
    const Scan again = ReadPly(folder_ / "a.ply", {});
    ASSERT_EQ(again.points.size(), 5u);
    EXPECT_THAT(again.points[4], IsNearMatrix(scan.points[5], offset > 0 ? 0 : 2e-8));
    EXPECT_EQ(again.intensity[1], 20);
    EXPECT_THAT(again.triangles, ElementsAre(Triangle{0, 2, 3}, Triangle{1, 3, 4}));
    EXPECT_THAT(again.up, IsNearMatrix(scan.up, 0));
    EXPECT_THAT(again.Station(), IsNearMatrix(scan.Station(), 0));
  }
}

TEST_F(Ply, SeveralScansBecomeOneMesh) {
  const Scan a = GridScan(0), b = GridScan(7);
  const std::vector<Triangle> of_a = {{0, 3, 4}}, of_b = {{2, 4, 5}};
  WritePly({{&a, &of_a}, {&b, &of_b}}, folder_ / "a.ply");
  const Scan again = ReadPly(folder_ / "a.ply", {});
  ASSERT_EQ(again.points.size(), 10u);
  EXPECT_THAT(again.triangles, ElementsAre(Triangle{0, 2, 3}, Triangle{6, 8, 9}));
  EXPECT_THAT(again.points[6], IsNearMatrix(b.points[2], 1e-7));
}

TEST_F(Ply, IsRefusedWhereverItIsCutOff) {
  for (const std::string& good : AllFormats()) {
    // The last newline and the last digit of an ascii file may be missing unnoticed.
    const size_t last = good[good.size() - 1] == '\n' ? good.size() - 2 : good.size() - 1;
    for (size_t size = 0; size <= last; ++size) {
      EXPECT_THROW(Read(good.substr(0, size)), InputError) << "cut after byte " << size;
    }
    EXPECT_THROW(Read(good + "1"), InputError);
  }
}

TEST_F(Ply, TellsTheLineOrByteOfWhatIsWrong) {
  const auto with = [](int format, const std::string& from, const std::string& to) {
    std::string bytes = AllFormats()[format];
    const size_t at = bytes.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return bytes.replace(at, from.size(), to);
  };
  ExpectError(
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0,5 1,5 2,5\n3 0 0 0\n",
      "line 10: is \"0,5 1,5 2,5\", which lacks a number or holds something else. Its numbers have "
      "decimal commas");
  for (int format = 0; format < 3; ++format) {
    ExpectError(with(format, "vertex 4", "vertex 1000000000"), "line 5: says 1000000000 of vertex");
    ExpectError(with(format, "face 2", "face 9000000000000000000"),
                "line 11: says 9000000000000000000 of face");
    ExpectError(with(format, "edge 1", "edge 99999999999999999999999"),
                "line 14: is \"element edge 9999");
    ExpectError(with(format, "vertex 4", "vertex -4"), "line 5");
    ExpectError(with(format, "property float x", "property float u"),
                "line 5: the vertices have no property x");
    ExpectError(with(format, "property float x", "property quad x"), "line 6");
    ExpectError(with(format, "vertex_indices", "corners"), "line 11: the faces have no list");
    ExpectError(with(format, "element face", "element faces"),
                "point cloud of 4 points without faces");
    ExpectError(with(format, "element edge", "element vertex"),
                "line 14: is a second element vertex");
    ExpectError(with(format, "end_header", "enb_header"), "line 16");
    ExpectError(with(format, "ply", "plx"), "line 1");
  }
  ExpectError(with(0, "ascii 1.0", "base64 1.0"), "line 2");
  ExpectError(with(0, "\n0.5 3 0 2 3", "\n0.5 3 0 2 4"),
              "line 22: a face names a vertex that is none of the 4");
  ExpectError(with(0, "\n0.5 3 0 2 3", "\n0.5 3 0 2 -1"), "line 22");
  ExpectError(with(0, "\n0.5 3 0 2 3", "\n0.5 3 0 2"), "line 22");
  ExpectError(with(0, "\n0.5 3 0 2 3", "\n0.5 3 0 2 3 3"),
              "line 22: is \"0.5 3 0 2 3 3\", which has more numbers");
  ExpectError(with(0, "\n0.5 3 0 2 3", "\n0.5 -3 0 2 3"), "line 22: a list of -3 items");
  ExpectError(with(0, "\n0.5 3 0 2 3", "\n0.5 2000000000 0 2 3"),
              "line 22: a list of 2000000000 items");
  ExpectError(with(0, "1 1.25 1 9", "1 one 1 9"), "line 19");
  ExpectError(with(0, "\n0.5 3 0 2 3", "\n0.5 2 0 2"), "line 22: a face has 2 corners");
  ExpectError(with(0, "\n0.5 3 0 2 3", "\n0.5 0"), "line 22: a face has 0 corners");
  const std::string header = HeaderOf("binary_little_endian");
  std::string bytes = header + BinaryBody(false);
  const size_t face = header.size() + 4 * 19;
  bytes[face + 5 + 3] = 1;  // the first index of the first face becomes 2^24
  ExpectError(bytes, "byte " + std::to_string(face) + ": a face names a vertex");
  bytes = header + BinaryBody(false);
  bytes[bytes.size() - 7] = '\x7f';  // the edge's list of 2 billion
  ExpectError(bytes, "byte " + std::to_string(bytes.size() - 10) + ": a list of 2130706435 items");
  ExpectError("", "line 1");
  ExpectError("ply\nformat ascii 1.0\nend_header\n", "no element vertex");
  ExpectError("ply\nelement vertex 0\nend_header\n", "without a \"format\" line");
  EXPECT_INPUT_ERROR(ReadPly(folder_ / "none.ply", {}), "does not exist");
  EXPECT_INPUT_ERROR(ReadPly(folder_.path(), {}), "is a folder");
}

TEST_F(Ply, ElementsWithoutPropertiesTakeNoTime) {
  std::string bytes = AllFormats()[0];
  bytes.insert(bytes.find("end_header"), "element nothing 9000000000000000000\n");
  EXPECT_EQ(Read(bytes).points.size(), 4u);
}

}  // namespace
}  // namespace roomtex
