// What roomtex-auto says before its first step, and what it counts; with a program in COLMAP's
// place.

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "tests/support/run_command.h"
#include "tests/workflow/step_table_fixture.h"
#include "workflow/made_from.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

class AutoStart : public StepTableTest {
 protected:
  // Where COLMAP is asked for features, this says so and fails.
  void SetUp() override {
    StepTableTest::SetUp();
    const std::string rest = kColmap38;
    WriteBytes(folder_ / "colmap",
               "#!/bin/sh\n"
               "if [ \"$2\" = --database_path ]; then\n"
               "  touch " +
                   (folder_ / "begun") +
                   "\n"
                   "  head -c 150000000 /dev/zero | tail | wc -c\n"
                   "  exit 1\n"
                   "fi\n" +
                   rest.substr(rest.find('\n') + 1));
    AddPhotos("a", 4, 60);
    AddScan("room.xyz");
  }

  CommandResult Run(const std::string& more) {
    return RunCommandLine("roomtex-auto --image_path " + options_.image_path + " --colmap " +
                          options_.colmap + " --output_path " + options_.output_path + " " + more);
  }
  bool HasBegun() { return fs::exists(folder_ / "begun"); }
  std::string Scan() { return "--scan_path " + (folder_ / "room.xyz") + " "; }

  // It ends with `finding` before the first step.
  void ExpectRefused(const std::string& arguments, const std::string& finding) {
    const CommandResult result = Run(arguments);
    EXPECT_EQ(result.exit_code, 3) << arguments;
    EXPECT_THAT(result.err, HasSubstr(finding));
    EXPECT_FALSE(HasBegun()) << arguments;
  }
};

TEST_F(AutoStart, SaysWhatIsWrongWithTheScansBeforeTheFirstStep) {
  WriteBytes(folder_ / "empty.e57", "");
  WriteBytes(folder_ / "cut.ptx", "20\n20\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n");
  AddScan("again.xyz");
  ExpectRefused("--scan_path " + (folder_ / "empty.e57"), "empty.e57: is empty");
  ExpectRefused("--scan_path " + (folder_ / "cut.ptx"), "cut.ptx: ");
  ExpectRefused("--scan_path " + (folder_ / "photos/a100.jpg"),
                "a100.jpg: is a photo, expected a range scan");
  ExpectRefused(Scan() + "--scan_path " + (folder_ / "again.xyz"), "has no pose");
  WriteBytes(folder_ / "poses.txt", "room.xyz 1 0 0\n");
  ExpectRefused(Scan() + "--scan_path " + (folder_ / "again.xyz") + " --scan_poses " +
                    (folder_ / "poses.txt"),
                "poses.txt: line 1");
  // In the words of the reader, and nothing else.
  EXPECT_EQ(Run("--quiet --scan_path " + (folder_ / "empty.e57")).err,
            "roomtex-auto: " + (folder_ / "empty.e57") +
                ": is empty. Give an RTPI, a PTX, an E57, a PCD, a PLY, a LAS, an OBJ mesh or "
                "points as text (the content counts, not the name).\n");
  // Step by step, as a site has it: with the first.
  ExpectRefused("--until features --scan_path " + (folder_ / "empty.e57"), "empty.e57: is empty");
}

TEST_F(AutoStart, LooksAtTheScansAsTheyWillBeRead) {
  EXPECT_EQ(Run(Scan() + "--units feet --up_axis -y --azimuth counterclockwise --E57.check 0 "
                         "--max_range 4")
                .exit_code,
            3);
  EXPECT_TRUE(HasBegun());
  const json report = json::parse(ReadBytes(folder_ / "result/log/scans.json"));
  const json& options = report["options"];
  EXPECT_EQ(options["units"], "feet");
  EXPECT_EQ(options["up_axis"], "-y");
  EXPECT_EQ(options["azimuth"], "counterclockwise");
  EXPECT_EQ(options["E57.check"], false);
  EXPECT_EQ(options["max_range"], 4.0);
  // Beyond 13.12 feet: six rows, and two of the row at 13 that are 1.8 and 1.9 aside.
  EXPECT_EQ(report["num_missing"], 122);
  EXPECT_THAT(ReadBytes(folder_ / "result/log/scans.log"), HasSubstr("room.xyz: XYZ"));
  // What roomtex-import itself does not take for granted.
  ASSERT_EQ(Run(Scan()).exit_code, 3);
  EXPECT_EQ(json::parse(ReadBytes(folder_ / "result/log/scans.json"))["options"]["azimuth"],
            "auto");
}

TEST_F(AutoStart, SaysWhatIsWrongWithThePicksBeforeTheFirstStep) {
  const std::string header = "image_name,x,y,scan_x,scan_y,scan_z";
  const auto expect = [&](const std::string& picks, const std::string& finding) {
    WriteBytes(folder_ / "picks.csv", picks);
    ExpectRefused(Scan() + "--picks_path " + (folder_ / "picks.csv"), finding);
  };
  expect("", "holds no picks");
  expect("a100.jpg,1,2,3,4,5\n", "line 1: the header is missing");
  expect(header + "\na100.jpg,1,2,3,4\n", "line 2: found 5 fields, expected 6");
  expect(header + "\na100.jpg,1,2,3,4,left\n", "scan_z is \"left\"");
  // Those that lie where roomtex-pick puts them, too.
  WriteBytes(folder_ / "result/picks.csv", "nothing\n");
  ExpectRefused(Scan(), "where the header of a picks file should be");
  // Comments, weights and labels are as they should be.
  fs::remove(folder_ / "result/picks.csv");
  WriteBytes(folder_ / "picks.csv",
             "# mine\n" + header + ",weight,label\n\na100.jpg,1,2,3,4,5,0,door # one\n");
  EXPECT_EQ(Run(Scan() + "--picks_path " + (folder_ / "picks.csv")).exit_code, 3);
  EXPECT_TRUE(HasBegun());
}

TEST_F(AutoStart, TellsItsVerdictOnceTheReportIsThere) {
  EXPECT_THAT(Run(Scan()).out, HasSubstr("/report.html\n"));
  EXPECT_TRUE(HasBegun());
  fs::remove(folder_ / "result/report.json");
  fs::create_directories(folder_ / "result/report.json/full");
  const CommandResult result = Run(Scan());
  EXPECT_THAT(result.err, HasSubstr("report.json: "));
  EXPECT_EQ(result.out, "");
}

TEST_F(AutoStart, CountsTheMemoryOfTheProgramsThatItRuns) {
  const CommandResult result = Run(Scan() + "--report_path " + (folder_ / "mine.json"));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_TRUE(HasBegun());
  for (const char* name : {"mine.json", "result/report.json"}) {
    const json report = json::parse(ReadBytes(folder_ / name));
    EXPECT_GT(report["peak_memory_bytes"], 150'000'000) << name;
  }
}

// A program that keeps copies of photos hidden beside them begins and ends while nothing changes.
TEST_F(AutoStart, HiddenPhotosMakeNoFeaturesAnew) {
  const auto features = [this] {
    const Step step = Make("features");
    return std::make_pair(PathNames(options_.output_path).Essential(step.commands.at(0)),
                          step.files);
  };
  const auto before = features();
  EXPECT_EQ(before.second.size(), 1u);
  const std::string line = Line("features");
  fs::copy(folder_ / "photos/a100.jpg", folder_ / "photos/.a100.jpg");
  EXPECT_NE(Line("features"), line);
  EXPECT_EQ(features(), before);
  // One more that COLMAP gets is another thing.
  fs::rename(folder_ / "photos/.a100.jpg", folder_ / "photos/b100.jpg");
  EXPECT_NE(features(), before);
}

}  // namespace
}  // namespace roomtex
