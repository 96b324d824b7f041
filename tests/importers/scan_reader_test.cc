#include "importers/scan_reader.h"

#include <cmath>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <unistd.h>

#include "core/error.h"
#include "importers/scan_writer.h"
#include "tests/importers/rtpi_bytes.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

const char kPose[] = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";

class ScanReader : public testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& bytes) {
    WriteBytes(folder_ / name, bytes);
    return folder_ / name;
  }
  std::string WriteGoodRtpi(const std::string& name) {
    return Write(name, Rtpi3Header(4, 3) + RtpiBody(MakeColumns(4, 3), true));
  }
  std::string WriteGoodPtx(const std::string& name, int num_scans = 1) {
    std::string text;
    for (int i = 0; i < num_scans; ++i) {
      text += std::string("1\n2\n") + kPose + "1 2 3 0.5\n1 2 4 0.25\n";
    }
    return Write(name, text);
  }
  void ExpectError(const std::string& path, const std::string& text) {
    EXPECT_INPUT_ERROR(ReadScanFile(path, {}), text);
    EXPECT_INPUT_ERROR(ReadScan(path, {}), path);
  }
  TempFolder folder_;
};

TEST_F(ScanReader, ColumnsThatNameTheirUnitAreReadInIt) {
  const std::string row = "1500 250 -500 0.5\n";
  for (const char* names : {"x[mm] y[mm] z[mm] i", "X (mm),Y (mm),Z (mm),Intensity [0-1]",
                            "# x [mm] y [mm] z [mm] intensity", "x(MM);y(mm);z(mm);r[]"}) {
    const ScanFile file = ReadScanFile(Write("a.xyz", names + ("\n" + row)), {});
    EXPECT_THAT(file.scans[0].points[0], IsNearMatrix(Eigen::Vector3d(1.5, 0.25, -0.5), 1e-12))
        << names;
    EXPECT_THAT(file.notes, Contains(HasSubstr("its unit is millimeters"))) << names;
  }
  ScanReaderOptions options;
  options.units = "centimeters";
  const std::string path = Write("a.xyz", "x[mm] y[mm] z[mm] i\n" + row);
  EXPECT_EQ(ReadScanFile(path, options).scans[0].points[0].x(), 15);
  // Said of all three alike, or of none.
  for (const char* names :
       {"x[mm] y[mm] z[m] i", "x[mm] y z i", "x[m] y[m] z[m] i", "x[?] y z i"}) {
    const ScanFile file = ReadScanFile(Write("b.xyz", names + ("\n" + row)), {});
    EXPECT_EQ(file.scans[0].points[0].x(), 1500) << names;
  }
}

TEST_F(ScanReader, ColoursStandInForIntensityWhereMostSamplesHaveOne) {
  ScanReaderOptions options;
  options.colors_as_intensity = true;
  const std::string start = std::string("1\n4\n") + kPose;
  const std::string grey = "1 2 3 0.5 100 100 100\n1 2 4 0.25 0 255 0\n1 3 4 0.1 255 255 255\n";
  const ScanFile colored = ReadScanFile(Write("a.ptx", start + grey + "0 0 0 0 0 0 0\n"), options);
  EXPECT_TRUE(colored.scans[0].colors.empty());
  // Rec. 709; the rows of a PTX go upwards, so the last one is missing and on top.
  EXPECT_THAT(colored.scans[0].intensity,
              ElementsAre(0, testing::FloatNear(255, 0.01f), testing::FloatNear(182.376f, 0.01f),
                          testing::FloatNear(100, 0.01f)));
  EXPECT_THAT(colored.notes, Contains(HasSubstr("colours of its own")));
  // A camera that saw half of it.
  const ScanFile half = ReadScanFile(Write("b.ptx", start + grey + "1 4 4 0.7 0 0 0\n"), options);
  EXPECT_THAT(half.scans[0].intensity, ElementsAre(0.7f, 0.1f, 0.25f, 0.5f));
  EXPECT_THAT(half.notes, testing::Not(Contains(HasSubstr("colours of its own"))));
}

TEST_F(ScanReader, TheContentDecidesNotTheName) {
  const ScanFile rtpi = ReadScanFile(WriteGoodRtpi("a.ply"), {});
  EXPECT_EQ(rtpi.format, "RTPI");
  EXPECT_EQ(rtpi.byte_order, "big");
  const ScanFile version2 =
      ReadScanFile(Write("b.pcd", "# x\nRTPIv2 4 3\n" + RtpiBody(MakeColumns(4, 3), false)), {});
  EXPECT_EQ(version2.format, "RTPI");
  EXPECT_EQ(version2.byte_order, "little");
  const ScanFile ptx = ReadScanFile(WriteGoodPtx("c.rtpi"), {});
  EXPECT_EQ(ptx.format, "PTX");
  EXPECT_EQ(ptx.byte_order, "text");
  const Scan scan = ReadScan(WriteGoodRtpi("a.rtpi"), {});
  WriteScan(scan, {}, folder_ / "x.pcd");
  std::filesystem::rename(folder_ / "x.pcd", folder_ / "x.ptx");
  EXPECT_EQ(ReadScanFile(folder_ / "x.ptx", {}).format, "PCD");
  WriteScan(scan, {{0, 5, 4}}, folder_ / "y.ply");
  std::filesystem::rename(folder_ / "y.ply", folder_ / "y");
  EXPECT_EQ(ReadScanFile(folder_ / "y", {}).format, "PLY");
}

TEST_F(ScanReader, OurOwnFilesSayTheSenseOfTheirAzimuths) {
  const Scan scan = ReadScan(WriteGoodRtpi("a.rtpi"), {});
  for (const bool counterclockwise : {false, true}) {
    ScanWriterOptions writer;
    writer.counterclockwise = counterclockwise;
    WriteScan(scan, {}, folder_ / "again.rtpi", writer);
    const ScanFile again = ReadScanFile(folder_ / "again.rtpi", {});
    EXPECT_EQ(again.azimuth, counterclockwise ? "counterclockwise" : "clockwise");
    EXPECT_EQ(again.azimuth_note, "");
    EXPECT_THAT(again.scans[0].points[2], IsNearMatrix(scan.points[2], 1e-5));
    ScanReaderOptions other;
    other.azimuth = counterclockwise ? "clockwise" : "counterclockwise";
    EXPECT_THAT(ReadScanFile(folder_ / "again.rtpi", other).azimuth_note,
                HasSubstr("the room is a mirror image"));
  }
}

TEST_F(ScanReader, OptionsReachTheFormats) {
  const std::string path = WriteGoodRtpi("a.rtpi");
  const Scan plain = ReadScan(path, {});
  ScanReaderOptions options;
  options.azimuth = "counterclockwise";
  options.units = "feet";
  const Scan other = ReadScan(path, options);
  EXPECT_THAT(other.points[2],
              IsNearMatrix(
                  Eigen::Vector3d(0.3048 * plain.points[2].cwiseProduct(Eigen::Vector3d(-1, 1, 1))),
                  1e-12));
  options.max_range = 0.618;  // 2.0276 feet: less than the ranges of the last column
  EXPECT_EQ(ReadScan(path, options).NumMissing(), 3);
}

// The sides of a box-shaped room and a table in it as an OBJ, turned about the vertical.
std::string RoomAsObj(const Eigen::Vector3d& size, double turn, char up) {
  std::string vertices, faces;
  int count = 0;
  const auto add_box = [&](const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool far : {false, true}) {
        for (int corner = 0; corner < 4; ++corner) {
          Eigen::Vector3d p = low;
          if (far) p[axis] = high[axis];
          if (corner == 1 || corner == 2) p[(axis + 1) % 3] = high[(axis + 1) % 3];
          if (corner >= 2) p[(axis + 2) % 3] = high[(axis + 2) % 3];
          p = Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()) * p;
          if (up == 'y') p = {p.x(), p.z(), -p.y()};
          vertices += "v " + std::to_string(p.x()) + " " + std::to_string(p.y()) + " " +
                      std::to_string(p.z()) + "\n";
        }
        faces += "f";
        for (int k = 1; k <= 4; ++k) faces += " " + std::to_string(count + k);
        faces += "\n";
        count += 4;
      }
    }
  };
  add_box({0, 0, 0}, size);
  add_box({1, 1, 0}, {2, 1.6, 0.75});
  return vertices + faces;
}

TEST_F(ScanReader, FindsWhichWayIsUp) {
  const Eigen::Vector3d room(6, 5, 2.7), corridor(20, 1.6, 2.6);
  for (const char up : {'y', 'z'}) {
    for (const double turn : {0.0, 0.4, 0.8}) {
      const ScanFile file =
          ReadScanFile(Write("room.obj", RoomAsObj(room, turn, up)), ScanReaderOptions());
      EXPECT_EQ(file.up_axis, std::string(1, up)) << turn;
      EXPECT_THAT(file.notes, SizeIs(up == 'y' ? 1 : 0)) << turn;
      EXPECT_EQ(file.scans[0].up_is_assumed, up == 'z');
    }
    const std::string path = Write("corridor.obj", RoomAsObj(corridor, 0.4, up));
    EXPECT_EQ(ReadScanFile(path, {}).up_axis, std::string(1, up));
  }
  // What stands along the axes and is no plain room is taken as usual.
  const std::string path = Write("corridor.obj", RoomAsObj(corridor, 0, 'z'));
  EXPECT_EQ(ReadScanFile(path, {}).up_axis, "z");
  ScanReaderOptions options;
  options.up_axis = "-y";
  const ScanFile told = ReadScanFile(path, options);
  EXPECT_THAT(told.scans[0].up, IsNearMatrix(Eigen::Vector3d(0, -1, 0), 0));
  EXPECT_THAT(told.notes, SizeIs(0));
  // Also of a format that says it: a scanner may hang from the ceiling.
  const std::string rtpi = WriteGoodRtpi("a.rtpi");
  EXPECT_EQ(ReadScanFile(rtpi, {}).up_axis, "y");
  const ScanFile hanging = ReadScanFile(rtpi, options);
  EXPECT_EQ(hanging.up_axis, "-y");
  EXPECT_EQ(hanging.scans[0].points, ReadScanFile(rtpi, {}).scans[0].points);
}

TEST_F(ScanReader, AGridSaysWhichWayIsUp) {
  std::string text;
  for (int column = 0; column < 120; ++column) {
    for (int row = 0; row < 60; ++row) {
      const double azimuth = 0.0523 * column, elevation = 1.2 - 0.03 * row;
      const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth), std::sin(elevation),
                                      -std::cos(elevation) * std::sin(azimuth));
      const Eigen::Vector3d p =
          direction / direction.cwiseAbs().cwiseQuotient(Eigen::Vector3d(4, 1.5, 3)).maxCoeff();
      text += std::to_string(p.x()) + " " + std::to_string(p.y()) + " " + std::to_string(p.z()) +
              " " + std::to_string(row) + "\n";
    }
  }
  const ScanFile file = ReadScanFile(Write("a.xyz", text), {});
  ASSERT_TRUE(file.scans[0].organised);
  EXPECT_EQ(file.scans[0].num_rows, 60);
  EXPECT_EQ(file.scans[0].num_columns, 120);
  EXPECT_EQ(file.scans[0].intensity[0], 0);  // row 0 on top
  EXPECT_EQ(file.up_axis, "y");
  EXPECT_THAT(file.notes, SizeIs(2));
}

TEST_F(ScanReader, BadOptionsAreUsageErrors) {
  ScanReaderOptions options;
  options.azimuth = "left";
  options.units = "miles";
  options.max_range = -1;
  options.up_axis = "w";
  EXPECT_THAT(options.Problems(), SizeIs(4));
  options.up_axis = "auto";
  EXPECT_THROW(ReadScan(WriteGoodRtpi("a.rtpi"), options), UsageError);
  options.max_range = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(options.Problems(), SizeIs(3));
}

TEST_F(ScanReader, SaysWhatAFileIsThatIsNoScan) {
  ExpectError(Write("a", ""), "is empty");
  ExpectError(Write("a", "hello"), "begins with \"hello\"");
  ExpectError(Write("a", std::string("\0\1\2\3", 4)), "byte 0: begins with \"????\"");
  ExpectError(Write("a", "ASTM-E57xxxx"), "byte 12: the file ends in its header");
  ExpectError(Write("a", "LASFxxxx"), "ends within the header");
  ExpectError(Write("a", "\xff\xd8\xff\xe0"), "a JPEG photo");
  ExpectError(Write("a.ptx.gz", "\x1f\x8b\x08"),
              "is a gzip file, expected a range scan. Unpack it, and give the file that is in it");
  ExpectError(Write("a", "12\nhello\n"), "no scan format");
  ExpectError(Write("a", "P9 4 3\n"), "version 1");
  ExpectError(Write("a", "# nothing else\n"), "no scan format");
  ExpectError(Write("a", "12\n"), "the file ends before the number of rows");
  ExpectError(Write("a", "plywood"), "no scan format");
  ExpectError(folder_ / "none", "does not exist");
  ExpectError(folder_.path(), "is a folder");
  ExpectError("/dev/null", "is not a regular file");
  if (geteuid() != 0) {
    std::filesystem::permissions(WriteGoodRtpi("secret"), std::filesystem::perms::none);
    ExpectError(folder_ / "secret", "may not be read");
  }
}

TEST_F(ScanReader, AFileWithSeveralScansNeedsACommandThatTakesThem) {
  const std::string path = WriteGoodPtx("three.ptx", 3);
  EXPECT_THAT(ReadScanFile(path, {}).scans, SizeIs(3));
  EXPECT_THAT(ReadScans({path}, "", {}), SizeIs(3));
  EXPECT_INPUT_ERROR(ReadScan(path, {}), "holds 3 scans, expected one");
}

// 8 x 4 samples a scan, all different.
class ManyScans : public ScanReader {
 protected:
  std::string WriteLargePtx(const std::string& name, int num_scans, double first) {
    std::string text;
    for (int scan = 0; scan < num_scans; ++scan) {
      text += std::string("8\n4\n") + kPose;
      for (int i = 0; i < 32; ++i) {
        text += std::to_string(first + scan) + " " + std::to_string(1 + i) + " 3 0.5\n";
      }
    }
    return Write(name, text);
  }
  static std::vector<double> FirstCoordinates(const PlacedScans& placed) {
    std::vector<double> x;
    for (const Scan& scan : placed.scans) x.push_back(scan.points[0].x());
    return x;
  }
};

TEST_F(ManyScans, AreThinnedToTheBoundInWhateverOrder) {
  const std::string a = WriteLargePtx("a.ptx", 2, 1), b = WriteLargePtx("b.ptx", 1, 3);
  EXPECT_EQ(ReadPlacedScans({a, b}, "", {}, 96).stride, 1);
  const PlacedScans ab = ReadPlacedScans({a, b}, "", {}, 95);
  PlacedScans ba = ReadPlacedScans({b, a}, "", {}, 95);
  EXPECT_EQ(ab.stride, 2);
  EXPECT_EQ(ReadPlacedScans({b, a}, "", {}, 23).stride, 4);
  EXPECT_EQ(ba.stride, 2);
  EXPECT_THAT(FirstCoordinates(ba), ElementsAre(3, 1, 2));
  // Sorted by path they are the same, and go back.
  const std::vector<size_t> as_named = ba.SortByPath();
  EXPECT_THAT(FirstCoordinates(ba), ElementsAre(1, 2, 3));
  const PlacedScans whole = ReadPlacedScans({a, b}, "", {});
  for (size_t s = 0; s < 3; ++s) {
    EXPECT_EQ(ba.scans[s].points, ab.scans[s].points);
    ASSERT_EQ(ba.scans[s].num_columns, 4);
    ASSERT_EQ(ba.scans[s].num_rows, 2);
    for (int i = 0; i < 8; ++i) {
      EXPECT_EQ(ba.scans[s].points[i], whole.scans[s].points[2 * (i % 4) + 16 * (i / 4)]);
    }
  }
  EXPECT_THAT(ba.ScanOrder(as_named), ElementsAre(2, 0, 1));
  ba.Reorder(as_named);
  EXPECT_THAT(FirstCoordinates(ba), ElementsAre(3, 1, 2));
  EXPECT_EQ(ba.files[0].path, b);
  // One alone is held in full, whatever the bound.
  EXPECT_EQ(ReadPlacedScans({b}, "", {}, 4).stride, 1);
}

TEST_F(ManyScans, AreReadAgainInFullWhereTheyStand) {
  const std::string a = WriteLargePtx("a.ptx", 2, 1), b = WriteLargePtx("b.ptx", 1, 3);
  const std::string poses = Write("poses.txt", "b.ptx 1 0 0 0  0 0 7\n");
  const PlacedScans whole = ReadPlacedScans({a, b}, poses, {});
  const PlacedScans thinned = ReadPlacedScans({a, b}, poses, {}, 10);
  std::vector<size_t> order;
  ForEachFullScan(thinned, [&](size_t index, const Scan& scan) {
    order.push_back(index);
    EXPECT_EQ(scan.points, whole.scans[index].points);
    EXPECT_EQ(scan.Station(), whole.scans[index].Station());
  });
  EXPECT_THAT(order, ElementsAre(0, 1, 2));
}

TEST_F(ScanReader, SeveralScansNeedTheirPoses) {
  const std::string a = WriteGoodRtpi("a.rtpi"), b = WriteGoodRtpi("b.rtpi"),
                    c = WriteGoodPtx("c.ptx");
  EXPECT_THAT(ReadScans({a}, "", {}), SizeIs(1));
  EXPECT_THAT(ReadScans({c, WriteGoodPtx("d.ptx")}, "", {}), SizeIs(2));
  EXPECT_INPUT_ERROR(ReadScans({a, c}, "", {}), "--scan_poses");
  const std::string poses =
      Write("poses.txt", "# stations\na.rtpi 1 0 0 0  0 0 0\n\n" + b +
                             " 0 -1 0 10 1 0 0 20 0 0 1 30 0 0 0 1 # turned\n");
  const std::vector<Scan> scans = ReadScans({a, b, c}, poses, {});
  ASSERT_THAT(scans, SizeIs(3));
  const Eigen::Vector3d point = scans[0].points[5];
  EXPECT_THAT(scans[1].points[5],
              IsNearMatrix(Eigen::Vector3d(10 - point.y(), 20 + point.x(), 30 + point.z()), 1e-12));
  EXPECT_THAT(scans[1].up, IsNearMatrix(Eigen::Vector3d(-1, 0, 0), 1e-12));
  EXPECT_THAT(scans[1].Station(), IsNearMatrix(Eigen::Vector3d(10, 20, 30), 1e-12));
  EXPECT_THROW(ReadScans({}, "", {}), UsageError);
}

TEST_F(ScanReader, APoseReplacesThatOfThePtx) {
  const std::string path = Write(
      "c.ptx", "1\n1\n5 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 0 0 1\n1 2 3 0.5\n");
  const std::vector<Scan> scans = ReadScans({path}, Write("p", "c.ptx 1 0 0 0 0 0 7\n"), {});
  EXPECT_THAT(scans[0].points[0], IsNearMatrix(Eigen::Vector3d(1, 2, 10), 1e-12));
  const std::string two = WriteGoodPtx("two.ptx", 2);
  const std::vector<Scan> both =
      ReadScans({two}, Write("p", "two.ptx#1 1 0 0 0 0 0 7\ntwo.ptx#2 1 0 0 0 0 0 8\n"), {});
  EXPECT_THAT(both[1].points[1], IsNearMatrix(Eigen::Vector3d(1, 2, 11), 1e-12));
  EXPECT_INPUT_ERROR(ReadScans({two}, Write("p", "two.ptx 1 0 0 0 0 0 7\n"), {}), "two.ptx#1");
}

TEST_F(ScanReader, BadPosesAreToldWithTheirLine) {
  const std::string a = WriteGoodRtpi("a.rtpi");
  const std::pair<const char*, const char*> cases[] = {
      {"a.rtpi 1 0 0 0 0 0\n", "line 1: is \"a.rtpi 1 0 0 0 0 0\", which is no pose"},
      {"\na.rtpi 1 0 0 0 0 0 x\n", "line 2"},
      {"a.rtpi 1 0 0 0 0 0 nan\n", "line 1"},
      {"a.rtpi 0 0 0 0 0 0 0\n", "not a rotation"},
      {"a.rtpi -1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n", "not a rotation"},
      {"a.rtpi 2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1\n", "not a rotation"},
      {"a.rtpi 1 0 0 0 0 1 0 0 0 0 1 0 5 0 0 1\n", "not a rotation"},
      {"a.rtpi 1 0 0 0 0 0 0\na.rtpi 1 0 0 0 0 0 0\n", "line 2: gives a second pose"},
      {"b.rtpi 1 0 0 0 0 0 0\n", "line 1: b.rtpi is none of the scans"}};
  for (const auto& [text, message] : cases) {
    EXPECT_INPUT_ERROR(ReadScans({a}, Write("poses.txt", text), {}), message);
  }
  EXPECT_INPUT_ERROR(ReadScans({a}, folder_ / "none.txt", {}), "does not exist");
}

TEST_F(ScanReader, ARoomOfKilometresIsNoticed) {
  const std::string path = Write("a.obj", "v 0 0 0\nv 5000 0 0\nv 0 0 2500\nf 1 2 3\n");
  const ScanFile file = ReadScanFile(path, {});
  ASSERT_THAT(file.notes, SizeIs(1));
  EXPECT_THAT(file.notes[0], testing::HasSubstr("--units millimeters"));
  EXPECT_THAT(ReadPlacedScans({path}, "", {}).notes, SizeIs(1));
  ScanReaderOptions options;
  options.units = "millimeters";
  EXPECT_THAT(ReadScanFile(path, options).notes, SizeIs(0));
}

// A room of 5.2 x 4.4 x 2.7 m as points of its six sides (without the ceiling: five), z up, in the
// given unit and moved off the origin.
std::string RoomAsText(double units_per_meter, bool ceiling, double size = 1) {
  std::string text = "x y z\n";
  const Eigen::Vector3d half = Eigen::Vector3d(2.6, 2.2, 1.35) * size * units_per_meter;
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {-1, 1}) {
      if (axis == 2 && side == 1 && !ceiling) continue;
      for (int i = 0; i < 25 * 25; ++i) {
        Eigen::Vector3d point;
        point[axis] = side;
        point[(axis + 1) % 3] = (i % 25) / 12.0 - 1;
        point[(axis + 2) % 3] = (i / 25) / 12.0 - 1;
        point = point.cwiseProduct(half) + half * 3;
        text += std::to_string(point.x()) + " " + std::to_string(point.y()) + " " +
                std::to_string(point.z()) + "\n";
      }
    }
  }
  return text;
}

TEST_F(ScanReader, ARoomInCentimetresOrInchesIsNoticed) {
  const std::pair<double, std::string> units[] = {
      {1000, "millimeters"}, {100, "centimeters"}, {39.37, "inches"}};
  for (const auto& [units_per_meter, name] : units) {
    for (const bool ceiling : {true, false}) {
      const std::string path = Write("room.xyz", RoomAsText(units_per_meter, ceiling));
      const ScanFile file = ReadScanFile(path, {});
      ASSERT_THAT(file.notes, SizeIs(1)) << name << ceiling;
      EXPECT_THAT(file.notes[0], HasSubstr("--units " + name));
      EXPECT_THAT(file.notes[0], HasSubstr("(5.2 x 4.4 x 2.7 m)"));
      ScanReaderOptions options;
      options.units = name;
      EXPECT_THAT(ReadScanFile(path, options).notes, SizeIs(0));
    }
  }
  for (const double size : {1.0, 20.0}) {  // a room, and a hall of 54 m height
    EXPECT_THAT(ReadScanFile(Write("hall.xyz", RoomAsText(1, true, size)), {}).notes, SizeIs(0));
  }
}

TEST_F(ScanReader, ALargeSiteIsLeftInMetres) {
  std::string text = "x y z\n";  // 600 x 600 m with a hill of 120 m
  for (int i = 0; i < 120 * 120; ++i) {
    const double x = (i % 120) * 5 - 300, y = (i / 120) * 5 - 300;
    text += std::to_string(x) + " " + std::to_string(y) + " " +
            std::to_string(120 * std::exp(-(x * x + y * y) / 2e4)) + "\n";
  }
  EXPECT_THAT(ReadScanFile(Write("site.xyz", text), {}).notes, SizeIs(0));
}

TEST_F(ScanReader, AGridInCentimetresIsNoticedByTheHeightOfItsScanner) {
  // Floor and walls 8 m around, without a ceiling; half of the rays end in the sky.
  std::string text = "72\n40\n" + std::string(kPose);
  for (int column = 0; column < 72; ++column) {
    for (int row = 0; row < 40; ++row) {  // from the bottom up
      const double azimuth = column * 0.0873, elevation = -1.0 + row * 0.05;
      const double range = 100 * std::min(1.6 / -std::sin(elevation), 8 / std::cos(elevation));
      const bool is_sky = elevation > 0;
      const double out = is_sky ? 0 : range * std::cos(elevation);
      text += std::to_string(out * std::cos(azimuth)) + " " +
              std::to_string(out * std::sin(azimuth)) + " " +
              std::to_string(is_sky ? 0 : range * std::sin(elevation)) + " 0.5\n";
    }
  }
  const ScanFile file = ReadScanFile(Write("yard.ptx", text), {});
  ASSERT_THAT(file.notes, SizeIs(1));
  EXPECT_THAT(file.notes[0], HasSubstr("--units centimeters"));
}

TEST_F(ScanReader, EveryWriterGivesWhatTheReadersTake) {
  const Scan scan = ReadScan(WriteGoodRtpi("a.rtpi"), {});
  for (const std::string extension : {".pcd", ".ptx", ".rtpi"}) {
    WriteScan(scan, {}, folder_ / "out" + extension);
    const Scan again = ReadScan(folder_ / "out" + extension, {});
    ASSERT_EQ(again.num_columns, scan.num_columns) << extension;
    ASSERT_EQ(again.num_rows, scan.num_rows) << extension;
    for (size_t i = 0; i < scan.points.size(); ++i) {
      EXPECT_THAT(again.points[i], IsNearMatrix(scan.points[i], 1e-6)) << extension;
    }
  }
  EXPECT_THROW(WriteScan(scan, {}, folder_ / "out.stl"), UsageError);
  Scan mesh = scan;
  mesh.organised = false;
  mesh.triangles = {{0, 5, 4}};
  EXPECT_INPUT_ERROR(WriteScan(mesh, {}, folder_ / "out.pcd"), "without a grid");
  EXPECT_EQ(ScanWriterExtension("a.b/ROOM.PlY"), ".ply");
  EXPECT_EQ(ScanWriterExtension("room"), "");
}

}  // namespace
}  // namespace roomtex
