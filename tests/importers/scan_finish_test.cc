#include <algorithm>

#include <gmock/gmock.h>

#include "core/error.h"
#include "importers/mesh_scan.h"
#include "importers/scan_reader.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class ScanFinish : public testing::Test {
 protected:
  ScanFile Read(const std::string& bytes) {
    WriteBytes(folder_ / "scan", bytes);
    return ReadScanFile(folder_ / "scan", {});
  }
  void ExpectError(const std::string& bytes, const std::string& message) {
    WriteBytes(folder_ / "scan", bytes);
    EXPECT_INPUT_ERROR(ReadScanFile(folder_ / "scan", {}), message);
  }
  static std::string Ptx(const std::string& translation) {
    return "2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n" + translation +
           " 1\n1 2 -1 0.5\n1 2 0 0.5\n1 2.1 -1 0.5\n";
  }
  static std::string Mesh(const std::string& far) {
    return "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n"
           "property double z\nelement face 2\nproperty list uchar int vertex_index\nend_header\n"
           "0 0 0\n1 0 0\n0 1 0\n" +
           far + " 0 0\n3 0 1 2\n3 1 3 2\n";
  }
  TempFolder folder_;
};

TEST_F(ScanFinish, WhatIsNoPlaceIsLeftOutOfAGrid) {
  const ScanFile file = Read(Ptx("0 0 0") + "1e300 -1e300 1 0.5\n");
  EXPECT_EQ(file.scans[0].NumMissing(), 1);
  EXPECT_LT(FindBounds(file.scans[0]).max.maxCoeff(), 3);
  EXPECT_THAT(file.notes, Contains(HasSubstr("1 point beyond 1e+12 m")));
}

TEST_F(ScanFinish, WhatIsNoPlaceIsLeftOutOfAMesh) {
  const ScanFile file = Read(Mesh("-1e13"));
  EXPECT_EQ(file.scans[0].NumMissing(), 1);
  EXPECT_THAT(file.scans[0].triangles, ElementsAre(Triangle{0, 1, 2}));
  EXPECT_THAT(file.notes, Contains(HasSubstr("1 point beyond")));
  EXPECT_THAT(Read(Mesh("-1e11")).scans[0].triangles, SizeIs(2));
}

TEST_F(ScanFinish, WhatIsNoPlaceIsLeftOutOfACloud) {
  const ScanFile file = Read("1 2 3 0.25\n3e38 3e38 3e38 1\n4 5 6 0.75\nnan 1 1 1\n");
  ASSERT_THAT(file.scans[0].points, SizeIs(2));
  EXPECT_THAT(file.scans[0].intensity, ElementsAre(0.25f, 0.75f));
  EXPECT_EQ(file.scans[0].num_columns, 2);
  EXPECT_EQ(file.scans[0].num_left_out, 2);  // the far one and the one that is none
  EXPECT_THAT(file.notes, Contains(HasSubstr("1 point beyond")));
}

TEST_F(ScanFinish, AFileOfNothingButSuchPlacesIsRefused) {
  ExpectError("1e30 0 0\n0 1e30 0\n", "holds no point but those beyond 1e+12 m");
  ExpectError(Ptx("1e300 0 0") + "1 2 3 0.5\n", "has its scanner beyond 1e+12 m");
}

TEST_F(ScanFinish, CoordinatesInMillimetresOfAnyCountryAreFine) {
  const ScanFile file = Read("456789123 5412345678 312500\n456789124 5412345679 312501\n");
  EXPECT_THAT(file.scans[0].points, SizeIs(2));
  EXPECT_EQ(file.scans[0].num_left_out, 0);
}

// Of a town's coordinates single floats keep half metres only.
TEST_F(ScanFinish, CoordinatesThatAreTooLargeForSingleFloatsAreNoticed) {
  const auto cloud = [](const std::string& type, double x, double y) {
    std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex 8\n";
    for (const char axis : {'x', 'y', 'z'}) bytes += "property " + type + " " + axis + "\n";
    bytes += "end_header\n";
    for (int i = 0; i < 8; ++i) {
      const double point[] = {x + 0.137 * i, y + 0.777 * i, 0.5};
      for (const double value : point) {
        const auto single = static_cast<float>(value);
        if (type == "double") bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
        if (type == "float") bytes.append(reinterpret_cast<const char*>(&single), sizeof single);
      }
    }
    return bytes;
  };
  EXPECT_THAT(Read(cloud("float", 456789.123, 5412345.678)).notes,
              Contains(HasSubstr("single precision, 5412351 m from the origin: there they step by "
                                 "500 mm. Export it with doubles")));
  EXPECT_THAT(Read(cloud("double", 456789.123, 5412345.678)).notes, IsEmpty());
  EXPECT_THAT(Read(cloud("float", 12, 340)).notes, IsEmpty());
  // Doubles of a raster.
  EXPECT_THAT(Read("456789.5 5412345.5 7\n456790.5 5412345.5 7.25\n456789.5 5412346.5 7\n").notes,
              IsEmpty());
}

TEST_F(ScanFinish, AScannerFarFromItsGridIsNoticed) {
  const auto ptx = [](const std::string& x) {
    return "2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n" + x +
           " 2 -1 0.5\n" + x + " 2 0.25 0.5\n" + x + " 2.1 -1 0.5\n" + x + " 2.1 0.25 0.5\n";
  };
  EXPECT_THAT(Read(ptx("456789.123")).notes,
              Contains(HasSubstr("has its scanner 456789 m from its points: surfaces, as seen from "
                                 "there, come out wrong")));
  EXPECT_THAT(Read(ptx("90.5")).notes, IsEmpty());
  // Placed there by its pose.
  EXPECT_THAT(Read(Ptx("456789.123 5412345.678 0") + "1 2.1 0 0.5\n").notes, IsEmpty());
}

// What the file has as points and a cloud has not counts as missing.
TEST_F(ScanFinish, PointsOfACloudThatAreNoneAreCounted) {
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n0 0 0\nnan 0 0\n0 1 0\n";
  EXPECT_EQ(Read(ply).scans[0].num_left_out, 1);
  EXPECT_EQ(Read("0 0 0\ninf 0 0\n1e999 0 0\n0 1 0\n").scans[0].num_left_out, 2);
}

// Old Macs ended lines so; all of it was one line, and one point, before.
TEST_F(ScanFinish, CarriageReturnsAloneEndLines) {
  const auto of_mac = [](std::string text) {
    std::replace(text.begin(), text.end(), '\n', '\r');
    return text;
  };
  EXPECT_THAT(Read(of_mac("1 2 3\n4 5 6\n\n7 8 9\n")).scans[0].points, SizeIs(3));
  EXPECT_THAT(Read(of_mac("x,y,z\n1,2,3\n4,5,6")).scans[0].points, SizeIs(2));
  const ScanFile ptx = Read(of_mac(Ptx("0 0 0") + "1 2.1 0 0.5\n"));
  EXPECT_EQ(ptx.format, "PTX");
  EXPECT_EQ(ptx.scans[0].NumMissing(), 0);
  EXPECT_THAT(Read(of_mac(Mesh("1"))).scans[0].triangles, SizeIs(2));
  EXPECT_THAT(Read(of_mac("# a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")).scans[0].triangles,
              SizeIs(1));
  const ScanFile pcd =
      Read(of_mac("# .PCD v.7\nVERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
                  "WIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n1 2 3\n4 5 6\n"));
  EXPECT_THAT(pcd.scans[0].points, SizeIs(2));
  // One that got into a comment is none.
  EXPECT_THAT(Read("# by\rhand\n1 2 3\n4 5 6\n").scans[0].points, SizeIs(2));
  // The data of a binary file may hold any byte.
  std::string binary = of_mac(
      "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty uchar x\nproperty uchar y\n"
      "property uchar z\nend_header\n");
  binary += std::string("\n\r\n\r\n\r", 6);
  EXPECT_THAT(Read(binary).scans[0].points,
              ElementsAre(Eigen::Vector3d(10, 13, 10), Eigen::Vector3d(13, 10, 13)));
}

TEST_F(ScanFinish, TextInUtf16IsToldFromOtherFiles) {
  ExpectError(std::string("\xff\xfe"
                          "1\0 \0",
                          6),
              "byte 0: is text in UTF-16, expected UTF-8. Save it as UTF-8");
  ExpectError(std::string("\xfe\xff\0"
                          "1",
                          4),
              "is text in UTF-16");
}

}  // namespace
}  // namespace roomtex
