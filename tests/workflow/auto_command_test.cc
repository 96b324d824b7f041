// roomtex-auto as a user types it, with the real COLMAP: from photos, scan and picks to the report.
// Label `e2e`.

#include <algorithm>
#include <filesystem>
#include <regex>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "colmap_ext/database.h"
#include "tests/support/folders.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"
#include "workflow/run_state.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

json ReadJson(const std::string& path) { return json::parse(ReadBytes(path)); }

class AutoCommand : public testing::Test {
 protected:
  // All tests look at one capture, and go on in one output folder, in their order.
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    Simulate("capture",
             "--num_photos 12 --photo_width 640 --photo_height 427 --scan_columns 700 "
             "--scan_rows 280");
    Simulate("other",
             "--random_seed 9 --num_photos 3 --photo_width 240 --photo_height 160 "
             "--scan_columns 500 --scan_rows 200");
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static void Simulate(const std::string& name, const std::string& options) {
    const CommandResult result = RunCommandLine("roomtex-simulate --quiet --output_path " +
                                                (*folder_ / name) + " " + options);
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }

  static std::string Arguments(const std::string& scan = "capture/scan.rtpi") {
    return "roomtex-auto --quality low --image_path " + (*folder_ / "capture/photos") +
           " --scan_path " + (*folder_ / scan) + " --cameras_path " +
           (*folder_ / "capture/cameras.txt") + " --output_path " + Result("");
  }
  static std::string Result(const std::string& name) {
    return name.empty() ? *folder_ / "result" : *folder_ / ("result/" + name);
  }
  static std::string Picks() { return " --picks_path " + (*folder_ / "capture/picks.csv"); }

  // Starts it in a shell, waits for a file, sends it a signal; its exit code and what still runs in
  // the result's folder.
  static CommandResult StopWhenThereIs(const std::string& file, const std::string& signal) {
    WriteBytes(*folder_ / "stop.sh",
               BinFolder() + "/" + Arguments() + Picks() +
                   " &\npid=$!\nfor i in $(seq 600); do [ -e " + Result(file) +
                   " ] && break; sleep 0.05; done\nsleep 0.3\nkill -" + signal +
                   " $pid\nwait $pid\ncode=$?\nsleep 0.5\n"
                   "for p in /proc/[0-9]*/cmdline; do tr '\\0' ' ' <$p 2>/dev/null | grep -F "
                   "'database_path " +
                   Result("") + "'; done\nexit $code\n");
    return RunProgram("bash " + (*folder_ / "stop.sh"));
  }
  static fs::file_time_type TimeOf(const std::string& name) {
    return fs::last_write_time(Result(name));
  }

  static TempFolder* folder_;
};
TempFolder* AutoCommand::folder_ = nullptr;

// Groups of options (--Rooms.enabled: Rooms) in what a command prints for --help.
std::set<std::string> OptionGroups(const std::string& command) {
  const std::string help = RunCommandLine(command + " --help").out;
  const std::regex option("\n  --([A-Za-z0-9]+)\\.");
  std::set<std::string> groups;
  for (std::sregex_iterator at(help.begin(), help.end(), option), end; at != end; ++at) {
    groups.insert((*at)[1]);
  }
  return groups;
}

TEST(AutoOptions, HoldEveryGroupOfOptionsOfTheCommandsThatItRuns) {
  const std::set<std::string> known = OptionGroups("roomtex-auto");
  for (const char* command :
       {"roomtex-pairs", "roomtex-mapper", "roomtex-align", "roomtex-texture"}) {
    const std::set<std::string> groups = OptionGroups(command);
    EXPECT_FALSE(groups.empty()) << command;
    for (const std::string& group : groups) {
      EXPECT_EQ(known.count(group), 1u) << command << " --" << group << ".*";
    }
  }
}

size_t NumTimes(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

TEST_F(AutoCommand, PrintsTheCommandsWithoutRunningThem) {
  const CommandResult result = RunCommandLine(Arguments() + " --dry_run");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  for (const char* command : {"feature_extractor", "exhaustive_matcher", "roomtex-mapper",
                              "roomtex-align", "roomtex-texture"}) {
    EXPECT_THAT(result.out, HasSubstr(command));
  }
  EXPECT_FALSE(fs::exists(Result("")));
}

TEST_F(AutoCommand, RefusesBadOptionsAndMissingFiles) {
  EXPECT_EQ(RunCommandLine(Arguments() + " --from nowhere").exit_code, 2);
  EXPECT_EQ(RunCommandLine(Arguments() + " --quality best").exit_code, 2);
  const CommandResult near = RunCommandLine(Arguments() + " --near photo_000.jpg,1,2");
  EXPECT_EQ(near.exit_code, 2);
  EXPECT_THAT(near.err, HasSubstr("expected PHOTO,X,Y,Z"));
  const CommandResult stranger = RunCommandLine(Arguments() + " --near nobody.jpg,1,2,3");
  EXPECT_EQ(stranger.exit_code, 2);
  EXPECT_THAT(stranger.err, HasSubstr("names nobody.jpg, which is not in"));
  const CommandResult result = RunCommandLine(Arguments("no.e57"));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.err, HasSubstr("does not exist"));
  EXPECT_FALSE(fs::exists(Result("")));
}

TEST_F(AutoCommand, ASlipInAnOptionForAStepIsSaidBeforeTheFirst) {
  for (const auto& [option, reason] :
       {std::pair("--PlaneBA.betta 2", "--PlaneBA.betta is no option of roomtex-align"),
        {"--Mapper.ba_glbal 1", "--Mapper.ba_glbal is no option of colmap mapper"},
        {"--SiftMatching.max_ration 0.8", "is no option of COLMAP's matchers"}}) {
    const CommandResult result = RunCommandLine(Arguments() + " " + option);
    EXPECT_EQ(result.exit_code, 2) << option;
    EXPECT_THAT(result.err, HasSubstr(reason));
  }
  EXPECT_FALSE(fs::exists(Result("")));
}

// Whichever step is asked for, the first that has to run is named.
TEST_F(AutoCommand, AStepThatCannotRunYetSaysWhichHasToRunFirst) {
  const CommandResult result =
      RunCommandLine("roomtex-auto --quality low --image_path " + (*folder_ / "other/photos") +
                     " --scan_path " + (*folder_ / "other/scan.rtpi") + " --output_path " +
                     (*folder_ / "nothing") + " --only texture");
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.err, HasSubstr("texture: "));
  EXPECT_THAT(result.err, HasSubstr("the step features has to run first. Start without --from or "
                                    "--only, or with --from features."));
  const json report = ReadJson(*folder_ / "nothing/report.json");
  EXPECT_EQ(report["verdict"]["headline"], "Not finished: the step texture cannot run yet");
  EXPECT_EQ(report["trusted"], false);
}

TEST_F(AutoCommand, WhatIsNotItsOwnStaysAsItIs) {
  const std::string line = "roomtex-auto --quality low --picks_path " +
                           (*folder_ / "other/picks.csv") + " --output_path " +
                           (*folder_ / "other_result");
  const std::string scan = " --scan_path " + (*folder_ / "other/scan.rtpi");
  const std::string photos = " --image_path " + (*folder_ / "other/photos");
  // Results of somebody else's.
  for (const char* name : {"database.db", "sparse/0/images.bin", "aligned/images.bin"}) {
    const std::string path = *folder_ / ("other_result/" + std::string(name));
    fs::create_directories(fs::path(path).parent_path());
    WriteBytes(path, "mine");
    const CommandResult result = RunCommandLine(line + scan + photos);
    EXPECT_EQ(result.exit_code, 3) << name;
    EXPECT_THAT(result.err, HasSubstr("roomtex-auto has not made it"));
    EXPECT_EQ(ReadBytes(path), "mine");
    fs::remove_all(*folder_ / "other_result");
  }
  // Photos where results go.
  const std::string path = *folder_ / "other_result/pictures";
  fs::create_directories(fs::path(path).parent_path());
  fs::copy(*folder_ / "other/photos", path);
  const CommandResult result = RunCommandLine(line + scan + " --image_path " + path);
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("which is made anew here"));
  EXPECT_TRUE(fs::exists(path + "/photo_000.jpg"));
  fs::remove_all(*folder_ / "other_result");
}

// As Ctrl-C, which whoever runs tests in the background has switched off.
TEST_F(AutoCommand, ASignalEndsColmapToo) {
  const CommandResult result = StopWhenThereIs("log/features.log", "TERM");
  EXPECT_EQ(result.exit_code, 143) << result.err;
  EXPECT_EQ(result.out, "") << "still running";
  EXPECT_THAT(result.err, HasSubstr("started again, it goes on"));
  EXPECT_FALSE(fs::exists(Result("database.db")));
}

TEST_F(AutoCommand, GoesOnWhereItWasKilled) {
  const CommandResult killed = StopWhenThereIs("log/matches.log", "KILL");
  EXPECT_EQ(killed.exit_code, 137);
  EXPECT_EQ(killed.out, "") << "still running";
  EXPECT_FALSE(fs::exists(Result("database.db")));
  EXPECT_EQ(ReadJson(Result("steps.json"))["steps"]["features"]["state"], "done");

  const CommandResult result = RunCommandLine(Arguments() + " --until mapper");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("features: done before"));
  EXPECT_THAT(result.err, HasSubstr("exhaustive_matcher"));
  EXPECT_TRUE(fs::exists(Result("database.db")));
  EXPECT_TRUE(fs::exists(Result("sparse/0/images.bin")));
  EXPECT_FALSE(fs::exists(Result("aligned")));
  // Done as asked for, but no coloured room that anybody may trust.
  const json report = ReadJson(Result("report.json"));
  EXPECT_EQ(report["verdict"]["state"], "unfinished");
  EXPECT_EQ(report["trusted"], false);
  EXPECT_THAT(report["reason"].get<std::string>(), HasSubstr("only some of the steps"));
}

// The scan of a room of the same plan, and nobody has clicked.
TEST_F(AutoCommand, SaysWhatAPersonCanDoWhereAStepIsNotToBeTrusted) {
  const CommandResult result = RunCommandLine(Arguments("other/scan.rtpi"));
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_THAT(result.err, HasSubstr("mapper: done before"));
  EXPECT_THAT(result.err, HasSubstr("roomtex-pick --input_path " + Result("sparse/0")));
  EXPECT_THAT(result.err, HasSubstr("start again"));
  // Nothing but a word of the user would be missing, if it were the right room.
  EXPECT_EQ(ReadJson(Result("log/align.json"))["search"]["hint_decides"], true);
  EXPECT_THAT(result.err, HasSubstr("--near PHOTO,X,Y,Z"));
  EXPECT_FALSE(fs::exists(Result("textured")));
  const json report = ReadJson(Result("report.json"));
  EXPECT_EQ(report["trusted"], false);
  EXPECT_EQ(report["verdict"]["state"], "untrusted");
  const std::string page = ReadBytes(Result("report.html"));
  EXPECT_THAT(page, HasSubstr("What to do now"));
  // What was found, and what else there is.
  const json& search = report["searches"][0];
  // COLMAP's threads decide which: of seven models two fitted a second place 20 cm beside as well.
  const bool unconfirmed = search["verdict"] == "unconfirmed";
  EXPECT_TRUE(unconfirmed || search["verdict"] == "ambiguous") << search["verdict"];
  EXPECT_THAT(result.err,
              HasSubstr(unconfirmed ? "If photos and scan are of one room, pick one point"
                                    : "Pick one point that photo and scan both show, where"));
  EXPECT_EQ(search["chance_counted"], false);
  EXPECT_EQ(search["places"][0]["place"], "best");
  EXPECT_EQ(search["places"][1]["place"], "second");
  EXPECT_LT(search["places"][1]["score"], search["places"][0]["score"]);
  EXPECT_THAT(page, HasSubstr("How the place was found"));
  EXPECT_THAT(page, HasSubstr("that is a guess"));
}

// The picks are right, and so they are not to be looked at.
TEST_F(AutoCommand, AMirroredScanIsReadTheOtherWayAndKeepsItsPicks) {
  const CommandResult result =
      RunCommandLine(Arguments() + Picks() + " --until align --azimuth counterclockwise");
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_THAT(result.err, HasSubstr("Start again without --azimuth"));
  EXPECT_THAT(result.err, Not(HasSubstr("roomtex-pick --")));
  EXPECT_EQ(ReadJson(Result("log/align.json"))["mirrored"], "scan");
}

TEST_F(AutoCommand, AlignsAgainWhereAPhotoIsSaidToBelongElsewhere) {
  const auto run = [](const std::string& near) {
    const CommandResult result = RunCommandLine(Arguments() + " --until align --near " + near);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.err;
  };
  // Of capture/picks.csv.
  const std::string near = "photo_001.jpg,-0.5455,0.5579,-1.9426";
  EXPECT_THAT(run(near), HasSubstr("$ roomtex-align "));
  EXPECT_EQ(ReadJson(Result("log/align.json"))["options"]["near"], near);
  EXPECT_THAT(run(near), HasSubstr("align: done before"));
  EXPECT_THAT(run("photo_001.jpg,-1.2431,-0.6965,1.1159"), HasSubstr("$ roomtex-align "));
  EXPECT_THAT(ReadBytes(Result("log/align.log")), HasSubstr("align, changed: options (--near)"));
}

TEST_F(AutoCommand, GoesOnFromThereWithPicks) {
  fs::copy_file(*folder_ / "capture/picks.csv", Result("picks.csv"));
  const CommandResult result = RunCommandLine(Arguments());
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("mapper: done before"));
  EXPECT_TRUE(fs::exists(Result("aligned/images.bin")));
  EXPECT_TRUE(fs::exists(Result("textured/model.glb")));
  EXPECT_TRUE(fs::exists(Result("pictures/contact_sheet.png")));
}

TEST_F(AutoCommand, ReportsInOneFileThatNeedsNoOther) {
  const std::string page = ReadBytes(Result("report.html"));
  for (const char* text :
       {"the result can be trusted", "photo_011.jpg", "roomtex-texture --input_path", "<svg",
        "What the photos saw", "COLMAP 3"}) {
    EXPECT_THAT(page, HasSubstr(text));
  }
  for (const char* text : {"http://", "https://", "<script", "<link", "url(//"}) {
    EXPECT_THAT(page, Not(HasSubstr(text)));
  }
  // Four photos beside the scan, four overlays, two views from outside.
  EXPECT_EQ(NumTimes(page, "<img "), 10u);
  const json report = ReadJson(Result("report.json"));
  EXPECT_EQ(report["command"], "roomtex-auto");
  EXPECT_EQ(report["trusted"], true);
  EXPECT_EQ(report["verdict"]["state"], "trusted");
  EXPECT_TRUE(report["searches"].empty());  // six picks
  EXPECT_THAT(page, Not(HasSubstr("How the place was found")));
  EXPECT_EQ(report["photos"].size(), 12u);
  EXPECT_GT(report["photos"][0]["expected_error_mm"], 0);
  EXPECT_EQ(report["steps"].size(), 6u);
  EXPECT_GT(report["total"]["peak_memory_bytes"], 10'000'000);
  EXPECT_GT(report["coverage"]["all"], 0.5);
  EXPECT_LE(report["coverage"]["all"], 1.0);
}

TEST_F(AutoCommand, TellsWhatTheColoursShowedOfEachPhoto) {
  const std::string measured = ReadBytes(Result("log/texture.json"));
  json texture = json::parse(measured);
  const json photos = ReadJson(Result("report.json"))["photos"];
  ASSERT_EQ(photos.size(), texture["images"].size());
  size_t num_maps = 0;
  for (const json& image : texture["images"]) {
    const std::string name = image["name"];
    const auto photo = std::find_if(photos.begin(), photos.end(),
                                    [&](const json& one) { return one["name"] == name; });
    ASSERT_NE(photo, photos.end()) << name;
    for (const char* key : {"shift_px", "shift_map_px", "row_turned_deg", "corrected"}) {
      EXPECT_EQ((*photo)[key], image[key]) << name << " " << key;
    }
    EXPECT_EQ((*photo)["sharpness"], texture["photo_sharpness"][name]["sharpness"]);
    EXPECT_EQ((*photo)["agreement"], texture["photo_agreement"][name]["correlation"]);
    num_maps += image["shift_map_px"].dump().find('.') != std::string::npos;
  }
  EXPECT_GT(num_maps, 6u);
  const auto page = [] { return ReadBytes(Result("report.html")); };
  EXPECT_EQ(NumTimes(page(), "<svg class=\"map\""), num_maps);
  EXPECT_THAT(page(), Not(HasSubstr("Blurred beside the others")));

  texture["photo_sharpness"]["photo_003.jpg"] = {{"sharpness", 0.41}, {"weight", 0.3}};
  WriteBytes(Result("log/texture.json"), texture.dump());
  ASSERT_EQ(RunCommandLine(Arguments() + " --only report").exit_code, 0);
  EXPECT_THAT(page(), HasSubstr("so that they count less: photo_003.jpg."));
  EXPECT_EQ(ReadJson(Result("report.json"))["photos"][3]["blurred"], true);
  WriteBytes(Result("log/texture.json"), measured);
  ASSERT_EQ(RunCommandLine(Arguments() + " --only report").exit_code, 0);
}

TEST_F(AutoCommand, DoesNothingTwice) {
  // Nor because somebody has looked at the photos, or written notes beside them.
  for (const char* name : {".DS_Store", "Thumbs.db", "notes.txt"}) {
    WriteBytes(*folder_ / (std::string("capture/photos/") + name), "x");
  }
  const auto model = TimeOf("textured/model.ply"), database = TimeOf("database.db");
  const CommandResult result = RunCommandLine(Arguments());
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("pictures: done before"));
  EXPECT_THAT(result.err, Not(HasSubstr("$ ")));
  EXPECT_EQ(TimeOf("textured/model.ply"), model);
  EXPECT_EQ(TimeOf("database.db"), database);
}

TEST_F(AutoCommand, GoesOnWhateverItsPathsAreCalled) {
  const auto run_in = [](const std::string& folder, const std::string& arguments) {
    WriteBytes(*folder_ / "elsewhere.sh",
               "cd " + folder + " && " + BinFolder() + "/roomtex-auto --quality low " + arguments);
    const CommandResult result = RunProgram("bash " + (*folder_ / "elsewhere.sh"));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.err, HasSubstr("pictures: done before"));
    EXPECT_THAT(result.err, Not(HasSubstr("$ ")));
  };
  const std::string arguments =
      "--image_path photos/ --scan_path ./scan.rtpi --cameras_path ../capture/cameras.txt ";
  run_in(*folder_ / "capture", arguments + "--output_path ../result");
  // Moved; the page still finds its pictures.
  fs::rename(Result(""), *folder_ / "moved");
  run_in(*folder_ / "capture", arguments + "--output_path ../moved/");
  EXPECT_EQ(NumTimes(ReadBytes(*folder_ / "moved/report.html"), "<img "), 10u);
  fs::rename(*folder_ / "moved", Result(""));

  // As versions before wrote it, paths as they were typed.
  const std::string steps = ReadBytes(Result("steps.json"));
  json typed = json::parse(
      std::regex_replace(steps, std::regex("'?\\{result\\}([^ '\"]*)'?"), "../result$1"));
  json& records = typed["steps"];
  ASSERT_THAT(records["mapper"]["made_from"]["options"].get<std::string>(),
              HasSubstr("--database_path ../result/database.db"));
  records["matches"]["made_from"]["features"] = HashText(records["features"]["made_from"].dump());
  WriteBytes(Result("steps.json"), typed.dump());
  run_in(*folder_ / "capture", arguments + "--output_path " + Result(""));
  WriteBytes(Result("steps.json"), steps);
}

// How cameras moved and their lens roomtex-align judges anew; that photos are missing it does not.
TEST_F(AutoCommand, GoesOnBehindAModelOfWhichAlignmentHasTheLastWord) {
  const std::string steps = ReadBytes(Result("steps.json")),
                    mapped = ReadBytes(Result("log/mapper.json"));
  json doubted = json::parse(steps);
  doubted["steps"]["mapper"]["state"] = "untrusted";
  doubted["steps"]["mapper"]["reason"] = "two pairs contradict it.";
  WriteBytes(Result("steps.json"), doubted.dump());
  const auto run = [&](const std::string& about, const std::string& more = "") {
    json report = json::parse(mapped);
    report["reasons"] = {{{"about", about}, {"reason", "two pairs contradict it."}}};
    WriteBytes(Result("log/mapper.json"), report.dump());
    return RunCommandLine(Arguments() + more);
  };
  const CommandResult motion = run("motion");
  EXPECT_EQ(motion.exit_code, 0) << motion.err;
  EXPECT_THAT(motion.err, HasSubstr("roomtex-align, which knows the scan, has the last word"));
  EXPECT_THAT(motion.err, Not(HasSubstr("$ ")));
  const json verdict = ReadJson(Result("report.json"))["verdict"];
  EXPECT_EQ(verdict["state"], "trusted");
  EXPECT_THAT(verdict["sentences"].dump(), HasSubstr("mapper alone was not sure"));

  const CommandResult photos = run("photos");
  EXPECT_EQ(photos.exit_code, 4) << photos.err;
  EXPECT_THAT(photos.err, HasSubstr("stopped at the step mapper: two pairs contradict it."));
  EXPECT_EQ(run("motion", " --until mapper").exit_code, 4);

  WriteBytes(Result("steps.json"), steps);
  WriteBytes(Result("log/mapper.json"), mapped);
}

TEST_F(AutoCommand, OnlyOneStepIsRunAgainWhenAskedFor) {
  const auto model = TimeOf("textured/model.ply"), aligned = TimeOf("aligned/images.bin");
  const CommandResult result = RunCommandLine(Arguments() + " --only texture");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(TimeOf("textured/model.ply"), model);
  EXPECT_EQ(TimeOf("aligned/images.bin"), aligned);
}

TEST_F(AutoCommand, AChangedOptionIsRunAgainFromItsStepOn) {
  const auto aligned = TimeOf("aligned/images.bin"), model = TimeOf("textured/model.ply");
  const CommandResult result =
      RunCommandLine(Arguments() + " --Texture.unseen black --until texture");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("align: done before"));
  EXPECT_EQ(TimeOf("aligned/images.bin"), aligned);
  EXPECT_NE(TimeOf("textured/model.ply"), model);
  // The pictures are there, but of the texture before.
  const json report = ReadJson(Result("report.json"));
  EXPECT_EQ(report["verdict"]["state"], "unfinished");
  EXPECT_EQ(report["trusted"], false);
}

TEST_F(AutoCommand, AReportAloneSaysWhichStepsItPassedOverAreOutOfDate) {
  const std::string arguments = Arguments() + " --Texture.unseen black";
  const auto verdict = [&] {
    const CommandResult result = RunCommandLine(arguments + " --only report");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return ReadJson(Result("report.json"))["verdict"];
  };
  const json before = verdict();
  EXPECT_EQ(before["state"], "unfinished");
  EXPECT_THAT(before["sentences"].dump(), HasSubstr("The step pictures was passed over"));
  EXPECT_THAT(before["sentences"].dump(), Not(HasSubstr("The step texture")));

  ASSERT_EQ(RunCommandLine(arguments).exit_code, 0);
  EXPECT_EQ(verdict()["state"], "trusted");

  const std::string picks = ReadBytes(Result("picks.csv"));
  WriteBytes(Result("picks.csv"), "# looked at\n" + picks);
  const json after = verdict();
  EXPECT_EQ(after["state"], "unfinished");
  EXPECT_THAT(after["sentences"].dump(), HasSubstr("The step align"));
  EXPECT_THAT(after["sentences"].dump(), HasSubstr("changed: picks.csv"));
  WriteBytes(Result("picks.csv"), picks);
  EXPECT_EQ(verdict()["state"], "trusted");
}

TEST_F(AutoCommand, ScansOfOneNameInOtherFoldersAreTwoInputs) {
  const std::string first = *folder_ / "capture/scan.rtpi", second = *folder_ / "twin/scan.rtpi";
  fs::create_directories(*folder_ / "twin");
  fs::copy_file(first, second);
  const std::string poses = *folder_ / "scan_poses.txt";
  WriteBytes(poses, first + " 1 0 0 0 0 0 0\n" + second + " 1 0 0 0 0 0 0\n");
  const std::string both = Arguments() + " --scan_path " + second + " --scan_poses " + poses;
  const CommandResult result = RunCommandLine(both + " --until align");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto sentences = [&both] {
    EXPECT_EQ(RunCommandLine(both + " --only report").exit_code, 0);
    return ReadJson(Result("report.json"))["verdict"]["sentences"].dump();
  };
  EXPECT_THAT(sentences(), Not(HasSubstr("The step align")));
  WriteBytes(second, ReadBytes(second) + " ");
  EXPECT_THAT(sentences(), HasSubstr("(changed: " + second + ")"));
  WriteBytes(first, ReadBytes(first) + " ");
  EXPECT_THAT(sentences(), HasSubstr("(changed: " + second + ", scan.rtpi)"));
}

// Photos that are matched in another way, or once more, keep the features that they have.
TEST_F(AutoCommand, FeaturesOutliveTheirMatches) {
  const std::string few = *folder_ / "few";
  fs::create_directories(few + "/photos");
  for (const char* name : {"photo_000.jpg", "photo_001.jpg", "photo_002.jpg", "photo_003.jpg"}) {
    fs::copy(*folder_ / ("capture/photos/" + std::string(name)), few + "/photos");
  }
  const std::string database_path = few + "/result/database.db";
  const std::string arguments = "roomtex-auto --quality low --image_path " + few +
                                "/photos --scan_path " + (*folder_ / "other/scan.rtpi") +
                                " --cameras_path " + (*folder_ / "capture/cameras.txt") +
                                " --output_path " + few + "/result";
  const CommandResult first = RunCommandLine(arguments + " --until matches");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const auto time_of_features = [&] {
    return fs::last_write_time(few + "/result/log/features.log");
  };
  const auto features = time_of_features();
  const auto keypoints = [&] { return Database(database_path).CountKeypoints(); };
  const auto matches = [&] {
    size_t sum = 0;
    for (const auto& [pair, count] : Database(database_path).CountMatches()) sum += count;
    return sum;
  };
  const auto features_before = keypoints();
  const size_t matches_before = matches();

  // What cannot be matched leaves what there was, whole, and its features for the next time.
  const std::string database = ReadBytes(database_path);
  const std::string with_ratio = arguments + " --until matches --SiftMatching.max_ratio ";
  const CommandResult failed = RunCommandLine(with_ratio + "nonsense");
  EXPECT_EQ(failed.exit_code, 3) << failed.err;
  EXPECT_THAT(failed.err, HasSubstr("features: done before"));
  EXPECT_EQ(ReadBytes(database_path), database);
  EXPECT_TRUE(fs::exists(few + "/result/database.partial.db"));
  EXPECT_EQ(ReadJson(few + "/result/report.json")["verdict"]["state"], "failed");

  const CommandResult stricter = RunCommandLine(with_ratio + "0.5");
  EXPECT_EQ(stricter.exit_code, 0) << stricter.err;
  EXPECT_THAT(stricter.err, HasSubstr("features: done before"));
  EXPECT_EQ(keypoints(), features_before);
  EXPECT_LT(matches(), 0.8 * matches_before);

  const CommandResult again = RunCommandLine(arguments + " --only matches");
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(time_of_features(), features);
  EXPECT_EQ(keypoints(), features_before);
  EXPECT_NEAR(matches(), matches_before, 0.05 * matches_before);

  // As after a kill between the last match and the record of the step.
  json steps = ReadJson(few + "/result/steps.json");
  steps["steps"]["matches"]["state"] = "started";
  WriteBytes(few + "/result/steps.json", steps.dump());
  const CommandResult killed = RunCommandLine(arguments + " --until matches");
  EXPECT_EQ(killed.exit_code, 0) << killed.err;
  EXPECT_THAT(killed.err, HasSubstr("features: done before"));
  EXPECT_EQ(keypoints(), features_before);

  const CommandResult nothing = RunCommandLine(arguments + " --until matches");
  EXPECT_EQ(nothing.exit_code, 0) << nothing.err;
  EXPECT_THAT(nothing.err, Not(HasSubstr("$ ")));
  EXPECT_FALSE(fs::exists(few + "/result/database.partial.db"));
  EXPECT_FALSE(fs::exists(few + "/result/database.copy.db"));
}

TEST_F(AutoCommand, OneRunAtATime) {
  WriteBytes(*folder_ / "lock.sh", "exec 9>" + Result("log/lock") + "\nflock 9\n" + BinFolder() +
                                       "/" + Arguments() + "\n");
  const CommandResult result = RunProgram("bash " + (*folder_ / "lock.sh"));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.err, HasSubstr("another roomtex-auto works in it"));
}

}  // namespace
}  // namespace roomtex
