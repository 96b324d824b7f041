#include "importers/xyz.h"

#include <gmock/gmock.h>

#include "core/error.h"
#include "core/frames.h"
#include "importers/scan_reader.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::ElementsAre;
using testing::FloatEq;
using testing::SizeIs;

class Xyz : public testing::Test {
 protected:
  Scan Read(const std::string& text, const XyzOptions& options = {}) {
    WriteBytes(folder_ / "points.txt", text);
    EXPECT_TRUE(LooksLikeXyz(text)) << text;
    return ReadXyz(folder_ / "points.txt", options);
  }
  void ExpectError(const std::string& text, const std::string& message) {
    WriteBytes(folder_ / "points.txt", text);
    EXPECT_INPUT_ERROR(ReadXyz(folder_ / "points.txt", {}), message);
    EXPECT_INPUT_ERROR(ReadXyz(folder_ / "points.txt", {}), folder_ / "points.txt");
  }
  TempFolder folder_;
};

TEST_F(Xyz, TheNumberOfColumnsSaysWhatTheyAre) {
  const Scan plain = Read("651234.123456 5412345.654321 123.5\n-1e0 +2 .5\n");
  EXPECT_EQ(plain.kind(), Scan::Kind::kCloud);
  ASSERT_THAT(plain.points, SizeIs(2));
  EXPECT_THAT(plain.points[0],
              IsNearMatrix(Eigen::Vector3d(651234.123456, 5412345.654321, 123.5), 0));
  EXPECT_THAT(plain.points[1], IsNearMatrix(Eigen::Vector3d(-1, 2, 0.5), 0));
  EXPECT_THAT(plain.intensity, ElementsAre(0, 0));
  EXPECT_THAT(plain.up, IsNearMatrix(Eigen::Vector3d::UnitZ(), 0));
  EXPECT_THAT(Read("1,2,3,0.5\r\n4;5;6;0.25\r\n").intensity, ElementsAre(0.5f, 0.25f));
  EXPECT_THAT(Read("1 2 3 10 20 30\n").intensity,
              ElementsAre(FloatEq(0.299f * 10 + 0.587f * 20 + 0.114f * 30)));
  EXPECT_THAT(Read("1\t2\t3\t-900 10 20 30\n").intensity, ElementsAre(-900));
}

TEST_F(Xyz, ColoursBehindTheIntensityAreKeptOnRequest) {
  XyzOptions options;
  options.colors = true;
  EXPECT_THAT(Read("1 2 3 0.5 255 0 7\n", options).colors,
              ElementsAre(std::array<uint8_t, 3>{255, 0, 7}));
  // Normals, these.
  EXPECT_THAT(Read("1 2 3 0.5 1 0 0\n2 2 3 0.5 0 -1 0\n3 2 3 0.5 0 1 0\n", options).colors,
              SizeIs(0));
}

TEST_F(Xyz, NamesSayWhatTheColumnsAre) {
  const Scan scan =
      Read("# made by hand\n//X,Intensity,Z,other,Y\n1,7,3,text?,2\n\n4,8,6,more,5\n");
  ASSERT_THAT(scan.points, SizeIs(2));
  EXPECT_THAT(scan.points[0], IsNearMatrix(Eigen::Vector3d(1, 2, 3), 0));
  EXPECT_THAT(scan.intensity, ElementsAre(7, 8));
}

TEST_F(Xyz, SurveyorsNamesAreNamesToo) {
  for (const char* names :
       {"Northing,Easting,Elevation", "north;east;height", "Y [m];X [m];Z [m]", "y(m),x(m),z(m)"}) {
    const Scan scan = Read(names + std::string("\n2,1,3\n"));
    EXPECT_THAT(scan.points[0], IsNearMatrix(Eigen::Vector3d(1, 2, 3), 0)) << names;
  }
  EXPECT_THAT(Read("height,x,y,z\n9,1,2,3\n").points[0], IsNearMatrix(Eigen::Vector3d(1, 2, 3), 0));
}

TEST_F(Xyz, WhatMarksACommentIsNoColumn) {
  for (const char* mark : {"# ", "#", "// ", "//"}) {
    const Scan scan = Read(mark + std::string("x y z intensity\n1 2 3 0.5\n"));
    EXPECT_THAT(scan.points[0], IsNearMatrix(Eigen::Vector3d(1, 2, 3), 0)) << mark;
    EXPECT_THAT(scan.intensity, ElementsAre(0.5f)) << mark;
  }
  // Prose with the same letters in it names no columns.
  const Scan prose = Read("# room scan, columns are z y x i\n1 2 3\n");
  EXPECT_THAT(prose.points[0], IsNearMatrix(Eigen::Vector3d(1, 2, 3), 0));
  EXPECT_THAT(Read("\xEF\xBB\xBFx,y,z\n1,2,3\n").points, SizeIs(1));  // as Excel writes it
}

TEST_F(Xyz, CommasMayStandForPoints) {
  for (const char* text : {"-2,5;1,25;3\n", "-2,5 1,25 3\n", "-2,5\t1,25\t3,0\n",
                           "x;y;z\n-2,5;1,25;3\n", "1;2;3\n-2,5;1,25;3\n"}) {
    EXPECT_THAT(Read(text).points.back(), IsNearMatrix(Eigen::Vector3d(-2.5, 1.25, 3), 0)) << text;
  }
  for (const char* text : {"-2.5, 1.25, 3\n", "-2.5,1.25,3\n", "-2.5 ,1.25 ,3\n"}) {
    EXPECT_THAT(Read(text).points.back(), IsNearMatrix(Eigen::Vector3d(-2.5, 1.25, 3), 0)) << text;
  }
}

TEST_F(Xyz, CommasWithinNumbersBesidePointsAreRefused) {
  for (const char* text :
       {"1,5 2,5 3.5\n", "1,5;2.5;3,5\n", "1,234.56 2,345.67 3.1\n",
        "500,123.45\t5,400,123.45\t30.1\n", "1 2 3 4 5\n1 2 3 4 5\n1,5 2,5 3.5\n"}) {
    ExpectError(text, "where commas stand within numbers, and points as well. Write all numbers");
  }
  // Commas between numbers, with blanks between groups of them.
  for (const char* text : {"1.5,2.5,3.5 4.5\n", "1.5 2.5 3.5 4,5,6\n", "1.0,2.0 3.0,4.0 5.0\n",
                           "1.5 2.5 3.5 255,128,064\n"}) {
    WriteBytes(folder_ / "points.txt", text);
    EXPECT_NO_THROW(ReadXyz(folder_ / "points.txt", {})) << text;
  }
}

TEST_F(Xyz, NormalsAreNoColours) {
  XyzOptions options;
  options.colors = true;
  const Scan six = Read("1 2 3 0 0.6 -0.8\n4 5 6 1 0 0\n", options);
  EXPECT_THAT(six.intensity, ElementsAre(0, 0));
  EXPECT_THAT(six.colors, SizeIs(0));
  EXPECT_THAT(six.normals, ElementsAre(Eigen::Vector3f(0, 0.6f, -0.8f), Eigen::Vector3f(1, 0, 0)));
  const Scan nine = Read("1 2 3 200 100 50 0 0 1\n1 2 3 20 10 5 0 1 0\n", options);
  EXPECT_THAT(nine.colors,
              ElementsAre(std::array<uint8_t, 3>{200, 100, 50}, std::array<uint8_t, 3>{20, 10, 5}));
  EXPECT_THAT(nine.normals, SizeIs(2));
  // Neither: numbers below 0, which no colour has.
  const Scan none = Read("1 2 3 4 5 -6\n1 2 3 4 5 6\n", options);
  EXPECT_THAT(none.intensity, ElementsAre(0, 0));
  EXPECT_THAT(none.colors, SizeIs(0));
}

TEST_F(Xyz, AScalarMayStandBehindTheColours) {
  XyzOptions options;
  options.colors = true;
  const Scan scan = Read("1 2 3 200 100 50 1999.5\n1 2 3 20 10 5 7\n", options);
  EXPECT_THAT(scan.intensity, ElementsAre(1999.5f, 7));
  EXPECT_THAT(scan.colors,
              ElementsAre(std::array<uint8_t, 3>{200, 100, 50}, std::array<uint8_t, 3>{20, 10, 5}));
}

TEST_F(Xyz, APtsSaysItsNumberOfPoints) {
  EXPECT_THAT(Read("2\n1 2 3 -5 0 0 0\n4 5 6 -6 0 0 0\n").points, SizeIs(2));
  EXPECT_THAT(Read("1\n1 2 3 -5 0 0 0\n1\n4 5 6 -6 0 0 0\n").points, SizeIs(2));
  EXPECT_THAT(Read("//X Y Z R G B Intensity\n1\n1 2 3 0 0 0 5\n").intensity, ElementsAre(5));
  ExpectError("2\n1 2 3 4\n1\n4 5 6 4\n", "line 3: is \"1\", expected 4 columns");
  ExpectError("3\n1 2 3 -5 0 0 0\n4 5 6 -6 0 0 0\n", "line 4: the file ends after 2 of 3 points");
  ExpectError("1000000000000\n1 2 3\n", "line 1: is \"1000000000000\", expected the number");
}

TEST_F(Xyz, PointsThatAreNoneAreLeftOut) {
  XyzOptions options;
  options.meters_per_unit = 1e-3;
  options.max_range = 5;
  const Scan scan = Read("1000 2000 3000\nnan nan nan\n9000 0 0\n1e999 0 1e-999\n", options);
  ASSERT_THAT(scan.points, SizeIs(1));
  EXPECT_THAT(scan.points[0], IsNearMatrix(Eigen::Vector3d(1, 2, 3), 1e-12));
}

TEST_F(Xyz, TellsTheLineOfWhatIsWrong) {
  ExpectError("1 2 3\n1 2\n", "line 2: is \"1 2\", expected 3 columns");
  ExpectError("1 2 3\n1 2 x\n", "line 2: is \"1 2 x\", expected numbers");
  ExpectError("1 2 3\n# fine\n1,5 2,5 3.5\n", "line 3: is \"1,5 2,5 3.5\", expected 3 columns");
  ExpectError("5 6\n", "line 1: is \"5 6\", expected x, y and z");
  ExpectError("hello\n", "line 1: is \"hello\", expected numbers, or the names of columns");
  ExpectError("# nothing\n", "holds no point");
  ExpectError("nan nan nan\n", "holds no point");
  for (const char* text : {"hello", "12\nhello\n", "# nothing\n", "1 2\n3 4\n", ""}) {
    EXPECT_FALSE(LooksLikeXyz(text)) << text;
  }
}

// A scan of a box, its points in any order.
TEST_F(Xyz, AScanThatLostItsGridGetsItBack) {
  std::string text;
  for (int i = 0; i < 200 * 60; ++i) {
    const int k = i * 7 % (200 * 60);
    const double azimuth = 2 * kPi * (k / 60) / 200, elevation = 0.7 - 0.02 * (k % 60);
    const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                    std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    const Eigen::Vector3d point = direction / (direction.cwiseAbs() / 3).maxCoeff();
    for (int axis = 0; axis < 3; ++axis) text += std::to_string(point[axis]) + " ";
    text += "0.5\n";
  }
  WriteBytes(folder_ / "box.ply", text);  // the content counts
  const ScanFile file = ReadScanFile(folder_ / "box.ply", {});
  EXPECT_EQ(file.format, "XYZ");
  EXPECT_EQ(file.scans[0].kind(), Scan::Kind::kGrid);
  EXPECT_EQ(file.scans[0].num_columns, 200);
  EXPECT_EQ(file.scans[0].num_rows, 60);
  WriteBytes(folder_ / "few.xyz", "1 2 3\n4 5 6\n");
  EXPECT_EQ(ReadScan(folder_ / "few.xyz", {}).kind(), Scan::Kind::kCloud);
}

}  // namespace
}  // namespace roomtex
