#include "importers/scan_record.h"

#include <filesystem>

#include <gmock/gmock.h>

#include "core/error.h"
#include "importers/content_hash.h"
#include "tests/importers/e57_bytes.h"
#include "tests/importers/rtpi_bytes.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;
using testing::SizeIs;

// The vectors of the specification's own tests, and one that fills whole stripes.
TEST(ContentHash, IsXxh64) {
  const auto hash = [](const std::string& bytes) {
    ContentHash result;
    result.Add(bytes);
    return result.Value();
  };
  EXPECT_EQ(hash(""), 0xef46db3751d8e999u);
  EXPECT_EQ(hash("a"), 0xd24ec4f1a98c6e5bu);
  EXPECT_EQ(hash("abc"), 0x44bc2cf5ad770999u);
  EXPECT_EQ(hash("Nobody inspects the spammish repetition"), 0xfbcea83c8a378bf1u);
}

TEST(ContentHash, DoesNotDependOnHowTheBytesCome) {
  std::string bytes;
  for (int i = 0; i < 1000; ++i) bytes += static_cast<char>(i * 7);
  ContentHash whole;
  whole.Add(bytes);
  for (const size_t step : {1, 5, 31, 32, 33, 100}) {
    ContentHash parts;
    for (size_t at = 0; at < bytes.size(); at += step) {
      parts.Add(std::string_view(bytes).substr(at, step));
    }
    EXPECT_EQ(parts.Value(), whole.Value()) << step;
  }
}

class ScanRecords : public testing::Test {
 protected:
  ScanRecords() {
    fs::create_directories(folder_ / "scans");
    fs::create_directories(folder_ / "aligned");
  }
  std::string WriteRtpi(const std::string& name, int num_columns = 4) const {
    return Write(name, Rtpi3Header(num_columns, 3) + RtpiBody(MakeColumns(num_columns, 3), false));
  }
  std::string Write(const std::string& name, const std::string& bytes) const {
    WriteBytes(folder_ / name, bytes);
    return folder_ / name;
  }
  // As roomtex-align leaves it.
  void Align(const std::vector<std::string>& paths, const ScanReaderOptions& options = {},
             const std::string& poses = "") const {
    Record(ReadPlacedScans(paths, poses, options));
  }
  void Record(const PlacedScans& placed) const {
    Json json;
    json["trusted"] = true;
    json["reason"] = "";
    json["scans"] = ToJson(RecordScans(placed, folder_ / "aligned"));
    WriteJson(folder_ / "aligned/alignment.json", json);
  }
  PlacedScans Read(const std::vector<std::string>& paths = {},
                   const ScanReaderOptions& options = {}, const std::string& poses = "",
                   const std::string& model = "aligned") const {
    return ReadScansOfModel(ReadAlignmentRecord(folder_ / model), {paths, poses, options});
  }

  TempFolder folder_;
};

TEST_F(ScanRecords, TheScanIsReadAgainAsItWas) {
  const std::string path = WriteRtpi("scans/a.rtpi");
  ScanReaderOptions options;
  options.azimuth = "counterclockwise";
  options.units = "feet";
  options.max_range = 5;
  Align({path}, options);
  const Scan then = ReadScan(path, options);
  for (const PlacedScans& now : {Read(), Read({path}), Read({path}, options)}) {
    ASSERT_THAT(now.scans, SizeIs(1));
    EXPECT_EQ(now.files[0].azimuth, "counterclockwise");
    for (size_t i = 0; i < then.points.size(); ++i) {
      if (then.IsMissing(static_cast<int>(i))) continue;
      EXPECT_EQ(now.scans[0].points[i], then.points[i]);
    }
  }
}

TEST_F(ScanRecords, ColoursAreReadWhereTheyAreAskedFor) {
  Align({Write("scans/a.ptx",
               "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
               "1 2 3 0.5 10 20 30\n")});
  EXPECT_TRUE(Read().scans[0].colors.empty());
  ScanReaderOptions options;
  options.colors = true;
  const PlacedScans placed = Read({}, options);
  ASSERT_EQ(placed.scans[0].colors.size(), 1u);
  EXPECT_EQ(placed.scans[0].colors[0][1], 20);
  EXPECT_TRUE(placed.files[0].options.colors) << "in full, too";
}

TEST_F(ScanRecords, AModelThatIsAlignedAgainRemembersTheSame) {
  ScanReaderOptions options;
  options.azimuth = "counterclockwise";
  options.units = "feet";
  options.max_range = 5;
  options.up_axis = "z";
  Align({WriteRtpi("scans/a.rtpi")}, options);
  const std::string first = ReadBytes(folder_ / "aligned/alignment.json");
  Record(Read());
  EXPECT_EQ(ReadBytes(folder_ / "aligned/alignment.json"), first);
}

TEST_F(ScanRecords, SurveyedStationsAreRemembered) {
  const std::string a = WriteRtpi("scans/a.rtpi"), b = WriteRtpi("scans/b.rtpi", 5);
  const std::string poses = Write("poses.txt",
                                  "a.rtpi geo -33.9 151.2 40.25 12.5\n"
                                  "b.rtpi geo -33.8999 151.2001 41 180\n");
  Align({b, a}, {}, poses);
  fs::remove(poses);
  const PlacedScans now = Read();
  ASSERT_TRUE(now.enu);
  EXPECT_EQ(now.enu->origin().latitude_deg, -33.9);
  EXPECT_EQ(now.enu->origin().height, 40.25);
  ASSERT_THAT(now.stations, SizeIs(2));
  EXPECT_EQ(now.stations[0].position.longitude_deg, 151.2001);
  EXPECT_EQ(now.stations[1].heading_deg, 12.5);
  const std::string first = ReadBytes(folder_ / "aligned/alignment.json");
  Record(now);
  EXPECT_EQ(ReadBytes(folder_ / "aligned/alignment.json"), first);
  const PlacedScans one = Read({a});
  ASSERT_THAT(one.stations, SizeIs(1));
  EXPECT_EQ(one.stations[0].heading_deg, 12.5);
  Align({a});
  EXPECT_FALSE(Read().enu);
}

TEST_F(ScanRecords, PosesAreRememberedToTheLastBit) {
  const std::string a = WriteRtpi("scans/a.rtpi"), b = WriteRtpi("scans/b.rtpi", 5);
  const std::string poses = Write("poses.txt",
                                  "a.rtpi 0.9 0.1 0.2 0.37 0.1 0.2 0.3\n"
                                  "b.rtpi 1 0 0 0 4 5 6\n");
  const std::vector<Scan> then = ReadScans({a, b}, poses, {});
  Align({a, b}, {}, poses);
  fs::remove(poses);
  const PlacedScans now = Read();
  ASSERT_THAT(now.scans, SizeIs(2));
  for (int s = 0; s < 2; ++s) {
    EXPECT_EQ(now.scans[s].up, then[s].up);
    for (size_t i = 0; i < then[s].points.size(); ++i) {
      if (then[s].IsMissing(static_cast<int>(i))) continue;
      EXPECT_EQ(now.scans[s].points[i], then[s].points[i]);
    }
  }
  EXPECT_THAT(Read({b}).scans, SizeIs(1));  // one of them will do
  const std::string same = Write("poses.txt",
                                 "a.rtpi 0.9 0.1 0.2 0.37 0.1 0.2 0.3\n"
                                 "b.rtpi 1 0 0 0 4 5 6\n");
  EXPECT_THAT(Read({}, {}, same).scans, SizeIs(2));
  const std::string other = Write("other.txt",
                                  "a.rtpi 0.9 0.1 0.2 0.37 0.1 0.2 0.3\n"
                                  "b.rtpi 1 0 0 0 4 5 6.001\n");
  EXPECT_THROW(Read({}, {}, other), UsageError);
}

// The second station of three is empty, and counts.
TEST_F(ScanRecords, PosesOfAFileWithSeveralScansAreTakenByTheirNumbers) {
  const std::string start = "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n";
  const std::string path =
      Write("scans/site.ptx", start + "0 0 0 1\n1 2 3 0.5\n" + start + "0 0 0 1\n0 0 0 0.5\n" +
                                  start + "0 0 0 1\n3 2 1 0.5\n");
  const std::string poses = Write("poses.txt",
                                  "site.ptx#1 1 0 0 0 4 5 6\n"
                                  "site.ptx#3 1 0 0 0 7 8 9\n");
  Align({path}, {}, poses);
  EXPECT_THAT(Read({}, {}, poses).scans[1].Station(), IsNearMatrix(Eigen::Vector3d(7, 8, 9), 0));
  const std::string other = Write("other.txt", "site.ptx#3 1 0 0 0 4 5 6\n");
  EXPECT_THROW(Read({}, {}, other), UsageError);
}

TEST_F(ScanRecords, OneScanOfAnE57IsRemembered) {
  const std::string path = Write("scans/site.e57", E57OfWalls({"hall", "attic", "roof"}));
  Align({path + "#roof", path + "#2"});
  const PlacedScans now = Read();
  ASSERT_THAT(now.scans, SizeIs(2));
  EXPECT_EQ(now.scans[0].name, "roof");
  EXPECT_EQ(now.scans[1].name, "attic");
  EXPECT_THAT(now.scans[0].points[0].y(), 5);
  EXPECT_EQ(Read({path + "#2"}).scans[0].name, "attic");
  EXPECT_INPUT_ERROR(Read({path}), "is another scan than the model");
  EXPECT_INPUT_ERROR(Read({path + "#hall"}), path + "#roof and others");
  fs::rename(path, folder_ / "scans/renamed.e57");
  EXPECT_EQ(Read().scans[1].name, "attic");
  fs::rename(folder_ / "scans/renamed.e57", path);
  Align({path});
  EXPECT_THAT(Read().scans, SizeIs(3));
}

TEST_F(ScanRecords, ARenamedScanIsFound) {
  const std::string path = WriteRtpi("scans/a.rtpi");
  Align({path});
  WriteRtpi("scans/z.rtpi", 5);
  fs::rename(path, folder_ / "scans/b.rtpi");
  EXPECT_EQ(Read().files[0].path, folder_ / "scans/b.rtpi");
  EXPECT_THAT(Read({folder_ / "scans/b.rtpi"}).scans, SizeIs(1));
}

TEST_F(ScanRecords, AFolderThatIsMovedWithItsScanKeepsIt) {
  const std::string path = WriteRtpi("scans/a.rtpi");
  Align({path});
  fs::create_directories(folder_ / "elsewhere");
  fs::rename(folder_ / "aligned", folder_ / "elsewhere/aligned");
  fs::rename(folder_ / "scans", folder_ / "elsewhere/scans");
  EXPECT_THAT(Read({}, {}, "", "elsewhere/aligned").scans, SizeIs(1));
}

TEST_F(ScanRecords, AnotherScanIsRefused) {
  const std::string path = WriteRtpi("scans/a.rtpi"), other = WriteRtpi("b.rtpi", 5);
  Align({path});
  EXPECT_INPUT_ERROR(Read({other}), "is another scan than the model in");
  WriteRtpi("scans/a.rtpi", 6);
  EXPECT_INPUT_ERROR(Read(), "its content has changed");
  fs::remove(path);
  EXPECT_INPUT_ERROR(Read(), "is no longer there");
  EXPECT_INPUT_ERROR(Read({path}), "does not exist");
}

TEST_F(ScanRecords, OptionsThatContradictAreRefused) {
  const std::string path = WriteRtpi("scans/a.rtpi");
  Align({path});
  const auto refused = [&](const ScanReaderOptions& options) {
    EXPECT_THROW(Read({}, options), UsageError);
    EXPECT_THROW(Read({path}, options), UsageError);
  };
  ScanReaderOptions options;
  options.azimuth = "counterclockwise";
  refused(options);
  options = {};
  options.units = "feet";
  refused(options);
  options.units = "meters";  // what the file says
  EXPECT_THAT(Read({}, options).scans, SizeIs(1));
  options = {};
  options.max_range = 3;
  refused(options);
}

TEST_F(ScanRecords, TheUpAxisIsRemembered) {
  const std::string path = Write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  ScanReaderOptions options;
  options.up_axis = "y";
  Align({path}, options);
  EXPECT_EQ(Read().scans[0].up, Eigen::Vector3d(0, 1, 0));
  EXPECT_EQ(Read({path}, options).scans[0].up, Eigen::Vector3d(0, 1, 0));
  options.up_axis = "z";
  EXPECT_THROW(Read({}, options), UsageError);
}

TEST_F(ScanRecords, AModelThatRemembersNothingIsReadAsAsked) {
  const std::string path = WriteRtpi("scans/a.rtpi");
  ScanReaderOptions options;
  options.azimuth = "counterclockwise";
  EXPECT_EQ(Read({path}, options).files[0].azimuth, "counterclockwise");
  EXPECT_THROW(Read(), UsageError);
  // As older versions wrote it.
  Write("aligned/alignment.json", "{\"trusted\": false, \"reason\": \"Too few.\"}");
  EXPECT_EQ(Read({path}).files[0].azimuth, "clockwise");
  EXPECT_THROW(Read(), UsageError);
  EXPECT_FALSE(ReadAlignmentRecord(folder_ / "aligned").trusted);
}

TEST_F(ScanRecords, SaysHowFarTheAlignmentIsOff) {
  Write("aligned/alignment.json",
        "{\"trusted\": true, \"expected_error\": {\"at_far_corner_mm\": 45.5}}");
  EXPECT_NEAR(ReadAlignmentRecord(folder_ / "aligned").expected_error, 0.0455, 1e-9);
  // Photos placed one by one: no room moves as a whole.
  Write("aligned/alignment.json",
        "{\"expected_error\": {\"at_far_corner_mm\": null, \"at_cameras_mm\": 27}}");
  EXPECT_NEAR(ReadAlignmentRecord(folder_ / "aligned").expected_error, 0.027, 1e-9);
  Write("aligned/alignment.json", "{\"trusted\": true, \"expected_error\": null}");
  EXPECT_EQ(ReadAlignmentRecord(folder_ / "aligned").expected_error, 0);
}

TEST_F(ScanRecords, ARecordThatIsNoneIsSaid) {
  for (const char* text : {"", "[]", "{\"scans\": [{}]}", "{\"scans\": 3}", "{\"trusted\": \"x\"}",
                           "{\"scans\": [{\"path\": 3}]}"}) {
    Write("aligned/alignment.json", text);
    EXPECT_INPUT_ERROR(ReadAlignmentRecord(folder_ / "aligned"), "as roomtex-align writes it");
  }
}

TEST_F(ScanRecords, TheHeaderOfTheScannersOwnSoftwareSaysTheAzimuth) {
  std::string header = Rtpi3Header(4, 3);
  const std::string device = "# serverVersion 1.0.5\n";
  header.insert(header.find(device), "# serial_number: 3001\n# laser: ar4K\n");
  const std::string body = RtpiBody(MakeColumns(4, 3), false);
  EXPECT_EQ(ReadScanFile(Write("a.rtpi", header + body), {}).azimuth, "clockwise");
  header.insert(header.find(device), "# scan_start_time: 10:38:23\n");
  const std::string path = Write("b.rtpi", header + body);
  const ScanFile found = ReadScanFile(path, {});
  EXPECT_EQ(found.azimuth, "counterclockwise");
  EXPECT_NE(found.azimuth_note, "");
  EXPECT_THAT(ReadPlacedScans({path}, "", {}).notes, SizeIs(1));
  ScanReaderOptions options;
  options.azimuth = "clockwise";
  EXPECT_EQ(ReadScanFile(path, options).azimuth, "clockwise");
}

}  // namespace
}  // namespace roomtex
