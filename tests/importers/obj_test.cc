#include "importers/obj.h"

#include <sstream>

#include <gmock/gmock.h>

#include "core/error.h"
#include "importers/scan_reader.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::ElementsAre;

class Obj : public testing::Test {
 protected:
  Scan Read(const std::string& text, const PlyOptions& options = {}) {
    WriteBytes(folder_ / "mesh.obj", text);
    return ReadObj(folder_ / "mesh.obj", options);
  }
  void ExpectError(const std::string& text, const std::string& message) {
    EXPECT_INPUT_ERROR(Read(text), message);
    EXPECT_INPUT_ERROR(Read(text), folder_ / "mesh.obj");
  }
  TempFolder folder_;
};

const char kVertices[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\n";

TEST_F(Obj, ReadsVerticesAndFacesAndSkipsTheRest) {
  const Scan scan =
      Read(std::string("# made by hand\r\nmtllib room.mtl\r\no wall\r\n") + kVertices +
           "vt 0 0\nvn 0 0 1\nusemtl red\ns off\n  f 1/1/1 2/1/1 3/1/1 4/1/1\n"
           "f 1//1 3//1 4//1 # a comment is no corner\n");
  EXPECT_FALSE(scan.organised);
  EXPECT_EQ(scan.num_columns, 4);
  EXPECT_EQ(scan.num_rows, 1);
  EXPECT_THAT(scan.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 2, 3}));
  EXPECT_EQ(scan.points[3], Eigen::Vector3d(0, 1, 0.5));
  EXPECT_EQ(scan.intensity.size(), 4u);
  EXPECT_EQ(scan.up, Eigen::Vector3d::UnitZ());
}

TEST_F(Obj, CountsNegativeNumbersFromTheLastVertex) {
  const Scan scan = Read(std::string(kVertices) + "f -4 -3 -1\nv 9 9 9\nf 1 2 -1\n");
  EXPECT_THAT(scan.triangles, ElementsAre(Triangle{0, 1, 3}, Triangle{0, 1, 4}));
}

TEST_F(Obj, ReadsColorsBehindTheVerticesAsNothing) {
  const Scan scan = Read("v 0 0 0 0.5 0.5 0.5\nv 1 0 0 1 1 1\nv 0 1e-400 2e0 0 0 0\nf 1 2 3\n");
  EXPECT_EQ(scan.points[2], Eigen::Vector3d(0, 0, 2));
}

TEST_F(Obj, JoinsLinesThatEndWithABackslash) {
  EXPECT_EQ(Read(std::string(kVertices) + "f 1 2 \\\n 3 \\\n4\n").triangles.size(), 2u);
}

TEST_F(Obj, AppliesUnitsRangeAndTheUpAxisOfOurFiles) {
  PlyOptions options;
  options.meters_per_unit = 0.001;
  options.max_range = 5;
  const Scan scan = Read(
      "# roomtex up 0 1 0\nv 0 0 0\nv 1000 0 0\nv 0 1000 0\nv 9000 0 0\n"
      "f 1 2 3\nf 1 2 4\n",
      options);
  EXPECT_EQ(scan.up, Eigen::Vector3d::UnitY());
  EXPECT_EQ(scan.points[1], Eigen::Vector3d(1, 0, 0));
  EXPECT_TRUE(scan.IsMissing(3));
  EXPECT_EQ(scan.triangles.size(), 1u);
}

// The front of its walls is to the middle, not to an origin that lies elsewhere or at its border.
TEST_F(Obj, IsSeenFromWithinWhereverItsOriginLies) {
  const auto station = [&](const Eigen::Vector3d& low) {
    std::ostringstream obj;
    for (int i = 0; i < 8; ++i) {
      obj << "v "
          << (low + Eigen::Vector3d(4 * (i & 1), 3 * (i >> 1 & 1), 2 * (i >> 2))).transpose()
          << "\n";
    }
    obj << "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n";
    WriteBytes(folder_ / "room.obj", obj.str());
    return ReadScanFile(folder_ / "room.obj", {}).scans[0];
  };
  EXPECT_EQ(station({0, 0, 0}).Station(), Eigen::Vector3d(2, 1.5, 1));
  EXPECT_EQ(station({500, 200, 0}).Station(), Eigen::Vector3d(502, 201.5, 1));
  EXPECT_EQ(station({-1, -1, -1}).Station(), Eigen::Vector3d(0, 0, 0));  // where an app started
  // A given pose is that of the file's frame.
  EXPECT_EQ(station({500, 200, 0}).scan_from_station.translation, Eigen::Vector3d(0, 0, 0));
}

TEST_F(Obj, AcceptsAByteOrderMarkAndSigns) {
  WriteBytes(folder_ / "bom.obj", "\xEF\xBB\xBFv +0 0 0\nv +1.5 0 0\nv 0 1 0\nf 1 2 3\n");
  const ScanFile file = ReadScanFile(folder_ / "bom.obj", {});
  EXPECT_EQ(file.format, "OBJ");
  EXPECT_EQ(file.scans[0].points[1].x(), 1.5);
}

TEST_F(Obj, LeavesOutTrianglesWithOneCornerTwice) {
  EXPECT_EQ(Read(std::string(kVertices) + "f 1 1 2\nf 1 2 2 3\nf 1 2 3\n").triangles.size(), 2u);
}

TEST_F(Obj, RefusesBrokenFilesWithTheLine) {
  const std::string v = kVertices;
  ExpectError("", "without faces");
  ExpectError(v, "4 vertices without faces");
  ExpectError("v 0 0\nf 1 1 1\n", "line 1");
  ExpectError("v 0 0 x\n", "expected v and three numbers");
  ExpectError("v 0 0 0x7\n", "expected v and three numbers");
  ExpectError("v 1,5 0,25 2\n", "Its numbers have decimal commas: write them with points");
  ExpectError(v + "f 1 2\n", "line 5: a face has 2 corners");
  ExpectError(v + "f\n", "0 corners");
  ExpectError(v + "f 1 2 0\n", "from 1");
  ExpectError(v + "f 1 2 5\n", "line 5: a face names vertex 5 of 4");
  ExpectError(v + "f 1 2 -5\n", "before the first");
  ExpectError(v + "f 1 2 99999999999999999999\n", "numbers of vertices");
  ExpectError(v + "f 1 2 4294967299\n", "before the first");
  ExpectError(v + "f 1 2 3a\n", "numbers of vertices");
  ExpectError(v + "f a b c\n", "numbers of vertices");
  ExpectError(v + "f 1 2 3\nnonsense\n", "no line of an OBJ");
  ExpectError(std::string("v 0 0 0\n\0\x7f\xff\n", 12), "line 2");
  ExpectError("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "three measured corners");
  ExpectError("v 0 0 0\n" + std::string(3 << 20, '1') + "\n", "mesh.obj");
}

TEST_F(Obj, ScanReaderKnowsItByItsContent) {
  WriteBytes(folder_ / "mesh.txt", std::string("# by some program\n\n") + kVertices + "f 1 2 3\n");
  const ScanFile file = ReadScanFile(folder_ / "mesh.txt", {});
  EXPECT_EQ(file.format, "OBJ");
  EXPECT_EQ(file.byte_order, "text");
  EXPECT_EQ(file.scans.at(0).triangles.size(), 1u);
  for (const char* text : {"# only a comment\n", "velocity 3\n", "v\n", "p\n", "voila\n"}) {
    WriteBytes(folder_ / "mesh.txt", text);
    EXPECT_INPUT_ERROR(ReadScanFile(folder_ / "mesh.txt", {}), "no scan format");
  }
}

}  // namespace
}  // namespace roomtex
