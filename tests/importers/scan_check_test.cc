// roomtex-import without an output: what the scans are.

#include "importers/scan_check.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "tests/importers/rtpi_bytes.h"
#include "tests/support/matchers.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class ScanCheck : public testing::Test {
 protected:
  ScanCheck() : progress_(/*quiet=*/true) {
    RawColumns columns = MakeColumns(12, 9);
    columns[3].erase(columns[3].begin() + 4);
    columns[5][2].range = -1;
    WriteBytes(folder_ / "room.rtpi", Rtpi3Header(12, 9) + RtpiBody(columns, true));
    WriteBytes(folder_ / "again.rtpi", Rtpi3Header(12, 9) + RtpiBody(columns, true));
    const std::string samples = "1 2 -1 0.5\n1 2 0 0.5\n0 0 0 0.5\n1 2.1 0 0.5\n";
    const std::string start = "2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n";
    WriteBytes(folder_ / "two.ptx", start + "0 0 0 1\n" + samples + start + "9 0 0 1\n" + samples);
    WriteBytes(folder_ / "mesh.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n");
  }
  CommandResult Run(const std::string& arguments) {
    return RunCommandLine("roomtex-import --quiet " + arguments);
  }
  std::string Input(const std::string& name) { return "--input_path " + (folder_ / name) + " "; }
  size_t NumFiles() {
    return static_cast<size_t>(
        std::distance(fs::directory_iterator(folder_ / ""), fs::directory_iterator()));
  }

  TempFolder folder_;
  Progress progress_;
};

TEST_F(ScanCheck, SaysWhatAScanIsAndWritesNothing) {
  const size_t num_files = NumFiles();
  CommandResult result = Run(Input("room.rtpi"));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.out, (folder_ / "room.rtpi") +
                            ": RTPI, 12 columns x 9 rows, 106 samples, 2 missing, no pose\n");
  result = Run(Input("mesh.obj"));
  EXPECT_EQ(result.out,
            (folder_ / "mesh.obj") + ": OBJ, mesh of 1 triangles, 3 samples, 0 missing, no pose\n");
  EXPECT_EQ(NumFiles(), num_files);
  result = Run(Input("two.ptx") + "--report_path " + (folder_ / "r.json"));
  EXPECT_EQ(result.out, (folder_ / "two.ptx") +
                            "#1: PTX, 2 columns x 2 rows, 3 samples, 1 missing, with a pose\n" +
                            (folder_ / "two.ptx") +
                            "#2: PTX, 2 columns x 2 rows, 3 samples, 1 missing, with a pose\n");
  EXPECT_EQ(NumFiles(), num_files + 1);
}

// What a conversion of the same scan says, but for the triangles that it makes.
TEST_F(ScanCheck, ReportsWhatAConversionReports) {
  for (const char* name : {"room.rtpi", "two.ptx", "mesh.obj"}) {
    SCOPED_TRACE(name);
    const auto report_of = [&](const std::string& more) {
      const std::string path = folder_ / "r.json";
      EXPECT_EQ(Run(Input(name) + more + " --report_path " + path).exit_code, 0);
      return nlohmann::json::parse(ReadBytes(path));
    };
    const auto look = report_of(""), conversion = report_of("--output_path " + (folder_ / "o.ply"));
    for (const char* key : {"num_columns", "num_rows", "num_samples", "num_missing", "byte_order",
                            "bounds", "format", "has_colors", "up"}) {
      EXPECT_EQ(look[key], conversion[key]) << key;
    }
    EXPECT_EQ(look["num_triangles"].is_null(), name != std::string("mesh.obj"));
    ASSERT_EQ(look["scans"].size(), name == std::string("two.ptx") ? 2u : 1u);
    EXPECT_EQ(look["scans"][0]["has_pose"], name == std::string("two.ptx"));
    EXPECT_EQ(look["scans"][0]["kind"], name == std::string("mesh.obj") ? "mesh" : "grid");
  }
}

TEST_F(ScanCheck, NothingOfSeveralFilesIsThatOfOne) {
  WriteBytes(folder_ / "poses.txt", "room.rtpi 1 0 0 0 0 0 0\n");
  const auto files = CheckScans({folder_ / "two.ptx", folder_ / "room.rtpi"}, folder_ / "poses.txt",
                                {}, &progress_);
  const Json keys = ReportKeys(files);
  for (const char* key : {"format", "byte_order", "bounds", "up", "num_triangles"}) {
    EXPECT_TRUE(keys.at(key).is_null()) << key;
  }
  EXPECT_EQ(keys["num_samples"], 3 + 3 + 106);
  EXPECT_EQ(keys["num_columns"], 2 + 2 + 12);
  EXPECT_EQ(keys["num_rows"], 9);
  EXPECT_EQ(keys["scans"][1]["name"], (folder_ / "two.ptx") + "#2");
  EXPECT_EQ(keys["scans"][2]["has_pose"], true);
}

TEST_F(ScanCheck, CloudsOfMoreThanAnIntAreCounted) {
  CheckedFile cloud;
  cloud.scans.resize(2);
  for (CheckedScan& scan : cloud.scans) {
    scan.num_columns = 2'000'000'000;
    scan.num_samples = 2'000'000'000;
  }
  const Json keys = ReportKeys({cloud});
  EXPECT_EQ(keys["num_columns"].get<int64_t>(), 4'000'000'000);
  EXPECT_EQ(keys["num_samples"].get<int64_t>(), 4'000'000'000);
}

// The same words as where the scans are used.
TEST_F(ScanCheck, RefusesWhatReadPlacedScansRefuses) {
  const std::string room = folder_ / "room.rtpi", again = folder_ / "again.rtpi";
  const std::string two = folder_ / "two.ptx", none = folder_ / "none.rtpi";
  WriteBytes(folder_ / "cut.rtpi", ReadBytes(room).substr(0, 1000));
  WriteBytes(folder_ / "bad.txt", "room.rtpi 1 0 0\n");
  WriteBytes(folder_ / "one.txt", "room.rtpi 1 0 0 0 0 0 0\n");
  WriteBytes(folder_ / "both.txt", "room.rtpi 1 0 0 0 0 0 0\nagain.rtpi 1 0 0 0 1 0 0\n");
  WriteBytes(folder_ / "file.txt", "two.ptx 1 0 0 0 0 0 0\n");
  WriteBytes(folder_ / "geo.txt", "two.ptx#1 geo 48 9 300 0\n");
  struct Case {
    std::vector<std::string> paths;
    std::string poses, finding;  // finding "": good
  };
  const Case cases[] = {{{none}, "", "does not exist"},
                        {{folder_ / "cut.rtpi"}, "", "has 9 samples"},
                        {{room, again}, "", "room.rtpi: has no pose, but there are 2 scans"},
                        {{two, again}, "", "again.rtpi: has no pose, but there are 3 scans"},
                        {{room, again}, "bad.txt", "bad.txt: line 1"},
                        {{room, again}, "one.txt", "gives no pose for again.rtpi"},
                        {{room}, "both.txt", "again.rtpi is none of the scans given"},
                        {{two}, "file.txt", "holds 2 scans"},
                        {{two}, "geo.txt", "gives no station for two.ptx#2"},
                        {{room, again}, "both.txt", ""},
                        {{room}, "", ""},
                        {{two}, "", ""}};
  for (const Case& one : cases) {
    SCOPED_TRACE(one.poses + " " + one.finding);
    const std::string poses = one.poses.empty() ? "" : folder_ / one.poses;
    const auto said = [](const auto& read) -> std::string {
      try {
        read();
        return "";
      } catch (const InputError& error) {
        return error.what();
      }
    };
    const std::string by_check = said([&] { CheckScans(one.paths, poses, {}, &progress_); });
    EXPECT_EQ(by_check, said([&] { ReadPlacedScans(one.paths, poses, {}); }));
    if (one.finding.empty()) {
      EXPECT_EQ(by_check, "");
    } else {
      EXPECT_THAT(by_check, HasSubstr(one.finding));
    }
  }
  const CommandResult result = Run(Input("room.rtpi") + Input("again.rtpi"));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_EQ(result.err, "roomtex-import: " + room +
                            ": has no pose, but there are 2 scans. Give each scan's pose with "
                            "--scan_poses.\n");
  EXPECT_THAT(result.out, IsEmpty());
}

TEST_F(ScanCheck, SaysWhatPanoramasAre) {
  fs::create_directory(folder_ / "photos");
  cv::imwrite(folder_ / "photos/a.png", cv::Mat3b(64, 128));
  cv::imwrite(folder_ / "photos/b.png", cv::Mat3b(32, 64));
  const std::string a = (folder_ / "photos/a.png") + ": panorama, 128 x 64 pixels\n";
  const std::string b = (folder_ / "photos/b.png") + ": panorama, 64 x 32 pixels\n";
  const CommandResult one = Run(Input("photos/a.png"));
  EXPECT_EQ(one.exit_code, 0) << one.err;
  EXPECT_EQ(one.out, a);
  const CommandResult all =
      Run(Input("room.rtpi") + Input("photos") + "--report_path " + (folder_ / "r.json"));
  EXPECT_EQ(all.exit_code, 0) << all.err;
  EXPECT_EQ(all.out, a + b + (folder_ / "room.rtpi") +
                         ": RTPI, 12 columns x 9 rows, 106 samples, 2 missing, no pose\n");
  const auto report = nlohmann::json::parse(ReadBytes(folder_ / "r.json"));
  EXPECT_EQ(report["num_panoramas"], 2);
  EXPECT_EQ(report["num_samples"], 106);
  cv::imwrite(folder_ / "photo.png", cv::Mat3b(60, 80));
  const CommandResult photo = Run(Input("photo.png"));
  EXPECT_EQ(photo.exit_code, 3);
  EXPECT_THAT(photo.err, HasSubstr("has 80 x 60 pixels, expected a panorama all around"));
  WriteBytes(folder_ / "photo.png", "none");
  EXPECT_THAT(Run(Input("photo.png")).err, HasSubstr("photo.png: is not a picture that can be"));
}

TEST_F(ScanCheck, WhatIsOnlyForALookIsRefusedWithOutputs) {
  WriteBytes(folder_ / "poses.txt", "room.rtpi 1 0 0 0 0 0 0\n");
  cv::imwrite(folder_ / "pano.png", cv::Mat3b(8, 16));
  const std::string output = "--output_path " + (folder_ / "o.ply") + " ";
  const std::pair<std::string, const char*> cases[] = {
      {Input("room.rtpi") + Input("two.ptx") + output, "--input_path is given 2 times"},
      {Input("room.rtpi") + "--scan_poses " + (folder_ / "poses.txt") + " " + output,
       "--scan_poses is only looked at"},
      {Input("room.rtpi") + Input("room.rtpi"), "is given twice"},
      {Input("room.rtpi") + "--max_range -1", "--max_range"},
      {Input("room.rtpi") + "--Mesh.max_edge_ratio 0.5", "--Mesh.max_edge_ratio"},
      {Input("pano.png") + "--scan_poses " + (folder_ / "poses.txt"), "there are panoramas only"},
      {Input("room.rtpi") + "--E57.picks 1", "give --images_path"}};
  for (const auto& [arguments, text] : cases) {
    const CommandResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    EXPECT_THAT(result.err, HasSubstr(text));
    EXPECT_THAT(result.out, IsEmpty());
  }
  EXPECT_FALSE(fs::exists(folder_ / "o.ply"));
}

}  // namespace
}  // namespace roomtex
