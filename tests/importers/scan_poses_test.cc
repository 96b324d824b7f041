#include "importers/scan_poses.h"

#include <cmath>
#include <filesystem>

#include <gmock/gmock.h>

#include "core/error.h"
#include "importers/scan_reader.h"
#include "tests/importers/rtpi_bytes.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::IsEmpty;
using testing::SizeIs;

const Eigen::Vector3d kYUp = Eigen::Vector3d::UnitY();

class ScanPosesFile : public testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& bytes) {
    WriteBytes(folder_ / name, bytes);
    return folder_ / name;
  }
  std::string Poses(const std::string& text) { return Write("poses.txt", text); }
  std::string WriteRtpi(const std::string& name) {
    return Write(name, Rtpi3Header(4, 3) + RtpiBody(MakeColumns(4, 3), true));
  }
  // One sample, 1 right, 2 forward, 3 up of a station that the file's own pose puts elsewhere.
  std::string WritePtx(const std::string& name) {
    return Write(name,
                 "1\n1\n5 6 7\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 6 7 1\n"
                 "1 2 3 0.5\n");
  }
  TempFolder folder_;
};

TEST_F(ScanPosesFile, MatricesAndQuaternionsMayStandTogether) {
  ScanPoses poses(
      Poses("# comment\n\n  \t\n"
            "a.rtpi 1 0 0 0 10 20 30 # metres\n"
            "  b.rtpi 0 -1 0 10  1 0 0 20  0 0 1 30  0 0 0 1\r\n"
            "\"room 2.rtpi\" 0.5 0.5 0.5 0.5 0 0 7\n"
            "c.ptx#2 1 0 0 0 0 0 -1"));
  EXPECT_FALSE(poses.surveyed());
  EXPECT_FALSE(poses.empty());
  const auto take = [&](const std::string& path, int number, int count) {
    const auto placement = poses.Take({path, number, count, kYUp});
    EXPECT_TRUE(placement) << path;
    EXPECT_FALSE(placement && placement->station);
    return placement ? placement->scan_from_station : Rigid();
  };
  EXPECT_THAT(take("scans/a.rtpi", 1, 1), IsNearRigid(Rigid{{1, 0, 0, 0}, {10, 20, 30}}, 0, 0));
  const double half = std::sqrt(0.5);
  EXPECT_THAT(take("b.rtpi", 1, 1), IsNearRigid(Rigid{{half, 0, 0, half}, {10, 20, 30}}, 1e-7, 0));
  EXPECT_THAT(take("/x/room 2.rtpi", 1, 1) * Eigen::Vector3d(1, 2, 3),
              IsNearMatrix(Eigen::Vector3d(3, 1, 9), 1e-12));
  EXPECT_FALSE(poses.Take({"c.ptx", 1, 2, kYUp}));
  EXPECT_EQ(take("c.ptx", 2, 2).translation.z(), -1);
  poses.RequireAllTaken();
}

TEST_F(ScanPosesFile, SurveyedStationsMakeTheScanFrameEastNorthUpAboutTheFirst) {
  ScanPoses poses(
      Poses("# surveyed\n"
            "a.rtpi geo 47 8 500 0 # the origin\n"
            "b.ptx geo 47.001 8.001 510 90\n"));
  ASSERT_TRUE(poses.surveyed());
  EXPECT_EQ(poses.enu()->origin().latitude_deg, 47);
  EXPECT_EQ(poses.enu()->origin().height, 500);
  // Asked for in another order than they stand in the file: the frame stays the same.
  const auto b = poses.Take({"b.ptx", 1, 1, Eigen::Vector3d::UnitZ()});
  const auto a = poses.Take({"a.rtpi", 1, 1, kYUp});
  ASSERT_TRUE(a && b);
  EXPECT_THAT(a->scan_from_station.translation, IsNearMatrix(Eigen::Vector3d(0, 0, 0), 1e-8));
  EXPECT_THAT(a->scan_from_station * Eigen::Vector3d(0, 0, -2),
              IsNearMatrix(Eigen::Vector3d(0, 2, 0), 1e-8));
  const GeoPosition there{47.001, 8.001, 510};
  EXPECT_THAT(b->scan_from_station.translation,
              IsNearMatrix(GeoFrame({47, 8, 500}).EnuFromGeo(there), 1e-8));
  EXPECT_EQ(b->station->heading_deg, 90);
  EXPECT_EQ(b->station->position.longitude_deg, 8.001);
}

TEST_F(ScanPosesFile, ScansOfSurveyedStationsComeTogether) {
  const std::string a = WriteRtpi("a.rtpi"), c = WritePtx("c.ptx");
  const std::string poses = Poses("a.rtpi geo -33.9 151.2 40 0\nc.ptx geo -33.896 151.2 42 180\n");
  const PlacedScans placed = ReadPlacedScans({a, c}, poses, {});
  ASSERT_THAT(placed.scans, SizeIs(2));
  ASSERT_THAT(placed.stations, SizeIs(2));
  ASSERT_TRUE(placed.enu);
  const std::vector<Scan>& scans = placed.scans;
  const Scan alone = ReadScan(a, {});
  for (size_t i = 0; i < alone.points.size(); ++i) {
    const Eigen::Vector3d x = alone.points[i];  // y up
    if (alone.IsMissing(static_cast<int>(i))) continue;
    EXPECT_THAT(scans[0].points[i], IsNearMatrix(Eigen::Vector3d(x.x(), -x.z(), x.y()), 1e-8));
  }
  EXPECT_THAT(scans[0].up, IsNearMatrix(Eigen::Vector3d(0, 0, 1), 1e-9));
  // The PTX's own pose is replaced; heading 180 turns forward and right to south and west.
  const Eigen::Vector3d station = placed.enu->EnuFromGeo({-33.896, 151.2, 42});
  EXPECT_NEAR(station.y(), 443.7, 0.5);
  EXPECT_THAT(scans[1].Station(), IsNearMatrix(station, 1e-8));
  // Its plumb line leans by 70 microradians: 0.3 mm over the 3.7 metres to the sample.
  EXPECT_THAT(scans[1].points[0], IsNearMatrix(station + Eigen::Vector3d(-1, -2, 3), 3e-4));
  EXPECT_NEAR((scans[1].points[0] - station).norm(), std::sqrt(14.0), 1e-9);
}

TEST_F(ScanPosesFile, OneSurveyedScanIsEnough) {
  const PlacedScans placed =
      ReadPlacedScans({WriteRtpi("a.rtpi")}, Poses("a.rtpi geo 47 8 500 90\n"), {});
  ASSERT_TRUE(placed.enu);
  EXPECT_THAT(placed.scans[0].up, IsNearMatrix(Eigen::Vector3d(0, 0, 1), 1e-9));
  const PlacedScans local = ReadPlacedScans({WriteRtpi("a.rtpi")}, "", {});
  EXPECT_FALSE(local.enu);
  EXPECT_THAT(local.stations, IsEmpty());
}

TEST_F(ScanPosesFile, KindsCannotBeMixed) {
  EXPECT_INPUT_ERROR(ScanPoses(Poses("a 1 0 0 0 0 0 0\n\nb geo 47 8 500 0\n")),
                     "line 3: is a surveyed station, but line 1 is a pose. Poses are given in");
  EXPECT_INPUT_ERROR(ScanPoses(Poses("a geo 47 8 500 0\nb 1 0 0 0 0 0 0\n")),
                     "line 2: is a pose, but line 1 is a surveyed station");
}

TEST_F(ScanPosesFile, BadStationsAreToldWithTheirLine) {
  const std::pair<const char*, const char*> cases[] = {
      {"a geo 47 8 500\n", "line 1: is \"a geo 47 8 500\", which is no surveyed station"},
      {"\na geo 47 8 500 0 0\n", "line 2: is \"a geo 47 8 500 0 0\", which is no surveyed"},
      {"a geo\n", "HEIGHT HEADING"},
      {"a geo 47 8 500 # 90\n", "which is no surveyed station"},
      {"a geo 47N 8E 500 0\n", "which is no surveyed station"},
      {"a geo geo 47 8 500 0\n", "which is no surveyed station"},
      {"a 47 8 500 0\n", "which is no pose"},
      {"a geo nan 8 500 0\n", "which is no surveyed station"},
      {"a geo 0x10 8 500 0\n", "which is no surveyed station"},
      {"a 1 0 0 0 0x10 0 0\n", "which is no pose"},
      {"a geo inf 8 500 0\n", "which is no surveyed station"},
      {"a geo 103.8 1.3 15 0\n", "latitude and longitude exchanged?"},
      {"a geo 47 400 15 0\n", "longitude must lie within"},
      {"a geo 47 8 500000 0\n", "height must lie within"},
      {"a geo 47 8 500 400\n", "heading must lie within"},
      {"a geo 47 8 5 0\nb geo 8 47 5 0\n", "line 2: the station lies 5"},
      {"a geo 47 8 5 0\na geo 47 8 5 0\n", "line 2: gives a second pose for a"},
      {"\"a geo 47 8 500 0\n", "names no scan"},
      {"\"\" geo 47 8 500 0\n", "names no scan"}};
  for (const auto& [text, message] : cases) {
    EXPECT_INPUT_ERROR(ScanPoses(Poses(text)), message);
  }
}

TEST_F(ScanPosesFile, LongFilesAndLinesAreReadInTime) {
  std::string many, wide = "a";
  for (int i = 0; i < 50000; ++i) many += "scan" + std::to_string(i) + " 1 0 0 0 0 0 0\n";
  for (int i = 0; i < 300000; ++i) wide += " 1";
  EXPECT_FALSE(ScanPoses(Poses(many)).empty());
  EXPECT_INPUT_ERROR(ScanPoses(Poses(wide)), "which is no pose");
}

TEST_F(ScanPosesFile, MissingUnknownAndAmbiguousNamesGetTheirSentence) {
  const std::string a = WriteRtpi("a.rtpi"), b = WriteRtpi("b.rtpi");
  const std::string pose = " 1 0 0 0 0 0 0\n", station = " geo 47 8 500 0\n";
  EXPECT_INPUT_ERROR(ReadScans({a, b}, Poses("a.rtpi" + pose), {}),
                     "poses.txt: gives no pose for b.rtpi, one of 2 scans; it names a.rtpi. Add a "
                     "line that begins with b.rtpi");
  EXPECT_INPUT_ERROR(ReadScans({a, b}, Poses("# none\n"), {}), "gives no pose for a.rtpi");
  EXPECT_INPUT_ERROR(ReadScans({a, b}, Poses("a.rtpi" + station), {}),
                     "gives no station for b.rtpi");
  EXPECT_INPUT_ERROR(ReadScans({a, b}, Poses("a.rtpi" + pose + "b.ptx" + pose), {}),
                     "line 2: b.ptx is none of the scans given (a.rtpi, b.rtpi)");
  EXPECT_INPUT_ERROR(ReadScans({a, b}, "", {}), "Give each scan's pose with --scan_poses");
  // A PTX carries its own pose, but not its place on the Earth.
  const std::string c = WritePtx("c.ptx");
  EXPECT_THAT(ReadScans({a, c}, Poses("a.rtpi" + pose), {}), SizeIs(2));
  EXPECT_INPUT_ERROR(ReadScans({a, c}, Poses("a.rtpi" + station), {}),
                     "gives no station for c.ptx");
  // The same file name in two folders.
  std::filesystem::create_directory(folder_ / "other");
  const std::string other = WriteRtpi("other/a.rtpi");
  EXPECT_INPUT_ERROR(ReadScans({a, other}, Poses("a.rtpi" + pose), {}),
                     "line 1: a.rtpi is the name of two scans");
  EXPECT_THAT(ReadScans({a, other}, Poses(a + pose + other + " 1 0 0 0 9 0 0\n"), {}), SizeIs(2));
  // A path and a file name that mean the same scan.
  EXPECT_INPUT_ERROR(ReadScans({a}, Poses(a + pose + "a.rtpi" + pose), {}),
                     "line 2: a.rtpi is none of the scans given");
  EXPECT_THROW(ReadScans({a, a}, Poses("a.rtpi" + pose), {}), UsageError);
}

}  // namespace
}  // namespace roomtex
