// roomtex-site as users call it, on rooms whose reports are written here.

#include <chrono>
#include <filesystem>
#include <map>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/output_file.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"
#include "workflow/run_state.h"

namespace roomtex {
namespace {
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

class SiteCommand : public testing::Test {
 protected:
  void AddStep(const std::string& room, const std::string& step, StepState state,
               const std::string& reason = "") {
    MakeFolder(folder_ / (room + "/log"));
    StepRecord record;
    record.state = state;
    record.reason = reason;
    record.seconds = 10;
    record.cpu_seconds = 30;
    record.peak_memory_bytes = 2'000'000'000;
    RunState(folder_ / (room + "/steps.json")).Set(step, record);
  }
  void AddReport(const std::string& room, const std::string& state) {
    json report = {
        {"verdict",
         {{"state", state}, {"headline", "It is " + state}, {"sentences", {"So <it> is."}}}},
        {"remedies", json::array()},
        {"photos",
         {{{"name", "a.jpg"}, {"registered_by", "mapper"}},
          {{"name", "b.jpg"}, {"registered_by", "none"}}}}};
    if (state == "trusted") {
      report["coverage"] = {{"all", 0.75}, {"surface_m2", 80.0}, {"unseen_m2", 20.0}};
      report["places_to_photograph"] = {{{"centre_in_plan", {1, 2, 1.5}},
                                         {"direction_in_plan", {0, 0.6, 0.8}},
                                         {"area_m2", 3.5},
                                         {"nearest_photo", "a.jpg"},
                                         {"distance_m", 0.25}}};
      WriteBytes(folder_ / (room + "/log/align.json"),
                 R"({"expected_error": {"at_cameras_mm": 4.25, "at_far_corner_mm": 9}})");
    } else {
      report["remedies"] = {"Pick six points: roomtex-pick --input_path x"};
    }
    WriteBytes(folder_ / (room + "/report.json"), report.dump());
    WriteBytes(folder_ / (room + "/report.html"), "<!doctype html>");
  }
  CommandResult Run(const std::string& more = "") {
    return RunCommandLine("roomtex-site --input_path " + folder_.path() + " --output_path " +
                          (folder_ / "site.html") + more);
  }
  json Site() { return json::parse(ReadBytes(folder_ / "site.json")); }
  std::string Page() { return ReadBytes(folder_ / "site.html"); }

  TempFolder folder_;
};

TEST_F(SiteCommand, SaysOfEveryRoomWhatItsOwnReportsSay) {
  AddStep("hall", "align", StepState::kDone);
  AddReport("hall", "trusted");
  AddStep("closet", "align", StepState::kUntrusted, "two starts fit");
  AddReport("closet", "untrusted");
  AddStep("cellar", "mapper", StepState::kDone);
  AddReport("cellar", "trusted");  // of a run before
  AddStep("cellar", "texture", StepState::kFailed, "the disk is full");
  AddStep("stairs", "matches", StepState::kStarted);
  WriteBytes(
      folder_ / "site.csv",
      "photos,room,notes\na,hall,\"R&D, <north>\"\nb,closet,\nc,cellar\nd,stairs,\ne,attic,\n");
  const CommandResult result = Run(" --rooms_path " + (folder_ / "site.csv"));
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_THAT(result.out, HasSubstr("1 of 5 rooms is coloured"));

  const json site = Site();
  EXPECT_EQ(
      site["counts"],
      json({{"rooms", 5}, {"trusted", 1}, {"untrusted", 1}, {"failed", 1}, {"unfinished", 2}}));
  EXPECT_EQ(site["verdict"]["state"], "failed");
  const json& hall = site["rooms"][0];
  EXPECT_EQ(hall["expected_error_mm"], 4.25);
  EXPECT_EQ(hall["coverage"], 0.75);
  EXPECT_EQ(hall["num_photos"], 2);
  EXPECT_EQ(hall["num_registered"], 1);
  EXPECT_EQ(site["rooms"][2]["sentences"][0], "the disk is full");
  EXPECT_EQ(site["rooms"][4]["headline"], "Not begun");
  EXPECT_EQ(site["total"]["cpu_seconds"], 5 * 30);
  EXPECT_EQ(site["steps"].size(), 4u);

  const std::string page = Page();
  for (const char* text :
       {"R&amp;D, &lt;north&gt;", "So &lt;it&gt; is.", "href=\"closet/report.html\"",
        "<pre>roomtex-pick", "0.2 m from where a.jpg was taken, 1.5 m above the floor, tilted up",
        "4.2", "2.0 GB"}) {
    EXPECT_THAT(page, HasSubstr(text));
  }
  for (const char* text : {"http://", "https://", "<script", "<link", "url(//"}) {
    EXPECT_THAT(page, Not(HasSubstr(text)));
  }
}

// A start that was refused, as after an edit of site.csv, leaves the report of the run before.
TEST_F(SiteCommand, SaysOfARoomThatItsLastStartWasRefused) {
  AddStep("hall", "align", StepState::kDone);
  AddReport("hall", "trusted");
  const std::string step =
      "bash " ROOMTEX_SITE_FOLDER "/run_step.sh " + (folder_ / "hall/log/features.state");
  MakeFolder(folder_ / "bin");
  const auto start = [&](int exit_code, const std::string& words) {
    WriteBytes(folder_ / "bin/roomtex-auto",
               "#!/bin/sh\necho 'roomtex-auto: " + words + "'\nexit " + std::to_string(exit_code));
    WriteBytes(folder_ / "start.sh", "chmod +x " + (folder_ / "bin/roomtex-auto") +
                                         "\nPATH=" + (folder_ / "bin") + ":$PATH " + step +
                                         " roomtex-auto --until features >" +
                                         (folder_ / "hall/log/features.run.log") + " 2>&1\n");
    EXPECT_EQ(RunProgram("bash " + (folder_ / "start.sh")).exit_code,
              exit_code == 4 ? 0 : exit_code);
  };
  start(0, "all is well");
  EXPECT_EQ(Run().exit_code, 0);
  start(3, "gone.rtpi: does not exist");
  const CommandResult result = Run();
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_EQ(Site()["rooms"][0]["state"], "failed");
  EXPECT_EQ(Site()["rooms"][0]["headline"], "It could not be started");
  EXPECT_THAT(Page(), HasSubstr("gone.rtpi: does not exist"));
  // Whatever ends with an answer, also one of somebody's own start, takes it back.
  start(0, "all is well");
  EXPECT_EQ(Run().exit_code, 0);
  start(2, "--quality lowest");
  EXPECT_EQ(Run().exit_code, 4);
  std::filesystem::last_write_time(
      folder_ / "hall/report.json",
      std::filesystem::file_time_type::clock::now() + std::chrono::seconds(1));
  EXPECT_EQ(Run().exit_code, 0);

  // Of a room whose first step is another one.
  MakeFolder(folder_ / "attic/log");
  WriteBytes(folder_ / "attic/log/refused", "roomtex-auto: a.e57: is no E57\n");
  WriteBytes(folder_ / "site.csv", "room\nattic\n");
  EXPECT_EQ(Run(" --rooms_path " + (folder_ / "site.csv")).exit_code, 4);
  EXPECT_EQ(Site()["rooms"][0]["sentences"][0], "a.e57: is no E57");
}

// roomtex-auto itself ended in the middle of a step: nothing runs any more.
TEST_F(SiteCommand, SaysOfAStepThatItEndedWhereTheCommandDid) {
  AddStep("hall", "mapper", StepState::kStarted);
  EXPECT_EQ(Run().exit_code, 4);
  EXPECT_EQ(Site()["rooms"][0]["headline"], "The step mapper runs still, or was killed");
  WriteBytes(folder_ / "hall/log/refused",
             "mapper 12 s\nroomtex-auto: the disk is full\nSee somewhere\n");
  EXPECT_EQ(Run().exit_code, 4);
  const json failed = Site()["rooms"][0];
  EXPECT_EQ(failed["state"], "failed");
  EXPECT_EQ(failed["headline"], "The step mapper did not end");
  EXPECT_EQ(failed["sentences"][0], "the disk is full");
  EXPECT_EQ(failed["remedies"][0], "What it printed last: hall/log/refused");
  // Started again.
  std::filesystem::last_write_time(
      folder_ / "hall/steps.json",
      std::filesystem::file_time_type::clock::now() + std::chrono::seconds(1));
  EXPECT_EQ(Run().exit_code, 4);
  EXPECT_EQ(Site()["rooms"][0]["state"], "unfinished");
}

TEST_F(SiteCommand, TrustsASiteOfWhichEveryRoomIsTrusted) {
  for (const char* room : {"b", "a"}) {
    AddStep(room, "align", StepState::kDone);
    AddReport(room, "trusted");
  }
  const CommandResult result = Run();
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(Site()["rooms"][0]["name"], "a");
  EXPECT_THAT(Page(), HasSubstr("All 2 rooms are coloured and can be trusted"));
  EXPECT_THAT(Page(), HasSubstr("75\u00a0% of 160"));
}

// Of two rooms whose plans are known, the second turned to the left and ten metres to the right.
TEST_F(SiteCommand, ShowsTheRoomsInOnePlanAndWhatLinksThem) {
  const json identity = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (const char* room : {"a", "b"}) {
    AddStep(room, "align", StepState::kDone);
    AddReport(room, "trusted");
    WriteBytes(folder_ / (room + std::string("/log/plan.png")), "a picture");
    json report = json::parse(ReadBytes(folder_ / (room + std::string("/report.json"))));
    report["plan"] = {
        {"picture", "log/plan.png"}, {"plan_from_scan", identity}, {"low", {0, 0, 0}}};
    report["plan"]["size"] = room[0] == 'a' ? json({4, 3, 2.5}) : json({2, 1, 2.5});
    WriteBytes(folder_ / (room + std::string("/report.json")), report.dump());
  }
  const json residual = {
      {"offset_mm", 3.25}, {"offset_sigma_mm", 2}, {"turn_deg", 0.1}, {"turn_sigma_deg", 0.05}};
  json joined =
      json::parse(R"({"trusted": true, "reason": "", "reference": "a", "scene": "site.gltf",
    "rooms": [{"name": "a", "frame": "a", "trusted": true,
               "site_from_room": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]},
              {"name": "b", "frame": "a", "trusted": true,
               "site_from_room": [[0, -1, 0, 10], [1, 0, 0, 0], [0, 0, 1, 0]]},
              {"name": "attic", "frame": "attic", "trusted": true,
               "site_from_room": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]}],
    "links": [{"first": "a", "second": "b", "trusted": true, "reason": "", "num_photos": 3,
               "num_scans": 0, "num_agreeing": 3, "place": [9, 1, 1.5]}],
    "loops": [{"closes": true, "offset_mm": 4.5}]})");
  joined["links"][0]["residual"] = residual;
  MakeFolder(folder_ / "joined");
  WriteBytes(folder_ / "joined/joined.json", joined.dump());
  EXPECT_EQ(Run().exit_code, 0);
  EXPECT_EQ(Site()["joined"]["links"][0]["num_photos"], 3);
  const std::string page = Page();
  for (const char* text :
       {"href=\"b/log/plan.png\"", "M963.0,314.8 L963.0,129.6 L870.4,129.6 L870.4,314.8 Z",
        "cx=\"870.4\" cy=\"222.2\"", "a – b", "3.2", "own frame: attic.", "joined/site.gltf",
        "1 way around over several doorways: closed, at worst to 4.5 mm"}) {
    EXPECT_THAT(page, HasSubstr(text));
  }

  joined["trusted"] = joined["links"][0]["trusted"] = false;
  joined["reason"] = "a and b share <one> photo alone";
  WriteBytes(folder_ / "joined/joined.json", joined.dump());
  const CommandResult result = Run();
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_EQ(Site()["verdict"]["state"], "untrusted");
  EXPECT_THAT(Page(), HasSubstr("a and b share &lt;one&gt; photo alone"));
  EXPECT_THAT(Page(), HasSubstr("class=\"door doubted\""));

  for (const char* list : {"rooms", "links", "loops"}) {
    json broken = joined;
    broken[list] = {3};
    WriteBytes(folder_ / "joined/joined.json", broken.dump());
    EXPECT_EQ(Run().exit_code, 4) << list;
    EXPECT_THAT(Page(), Not(HasSubstr("<svg class=\"plan site\""))) << list;
  }
  WriteBytes(folder_ / "joined/joined.json", "[]");
  EXPECT_EQ(Run().exit_code, 0);
  EXPECT_TRUE(Site()["joined"].is_null());
}

// As the Snakefile writes it where the room in whose frame all should stand is not there.
TEST_F(SiteCommand, SaysWhyRoomsAreNotJoined) {
  for (const char* room : {"a", "b"}) {
    AddStep(room, "align", StepState::kDone);
    AddReport(room, "trusted");
  }
  MakeFolder(folder_ / "joined");
  WriteBytes(folder_ / "joined/joined.json",
             R"({"trusted": false, "reason": "The reference c is not aligned.", "reference": "c",
                 "rooms": [], "links": [], "loops": [], "scene": null})");
  EXPECT_EQ(Run().exit_code, 4);
  EXPECT_EQ(Site()["verdict"]["state"], "untrusted");
  EXPECT_THAT(Page(), HasSubstr("The reference c is not aligned."));
}

// Three rooms with plans of which roomtex-join linked none: each is drawn by itself, all to one
// scale, that of the largest.
TEST_F(SiteCommand, ShowsRoomsThatNothingLinksEachInAPlanOfItsOwn) {
  const std::map<std::string, json> sizes = {
      {"attic", {6, 3, 2.5}}, {"b", {2, 1, 2.5}}, {"c", {1, 1, 2.5}}, {"d", {0, 1, 2.5}}};
  for (const auto& [room, size] : sizes) {
    AddStep(room, "align", StepState::kDone);
    AddReport(room, room == "b" ? "untrusted" : "trusted");
    WriteBytes(folder_ / (room + "/log/plan.png"), "a picture");
    json report = json::parse(ReadBytes(folder_ / (room + "/report.json")));
    report["plan"] = {{"picture", "log/plan.png"},
                      {"plan_from_scan", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
                      {"low", {0, 0, 0}},
                      {"size", size}};
    WriteBytes(folder_ / (room + "/report.json"), report.dump());
  }
  EXPECT_EQ(Run().exit_code, 4);
  const std::string page = Page();
  for (const char* text :
       {"These rooms stand in no common frame", "width=\"300.0\" height=\"150.0\"",
        "width=\"100.0\" height=\"50.0\"", "href=\"attic/log/plan.png\"",
        "attic</a>, 6.0 × 3.0\u00a0m<", "b</a>, 2.0 × 1.0\u00a0m. Not to be trusted<", ">1 m<"}) {
    EXPECT_THAT(page, HasSubstr(text));
  }
  EXPECT_THAT(page, Not(HasSubstr("d/log/plan.png")));  // no size, no plan

  // With the first two linked, the third is by itself.
  json joined = json::parse(R"({"trusted": true, "reason": "", "reference": "attic",
    "scene": null, "links": [], "loops": [], "rooms": []})");
  for (const char* name : {"attic", "b", "c"}) {
    joined["rooms"].push_back({{"name", name},
                               {"frame", name[0] == 'c' ? "c" : "attic"},
                               {"trusted", true},
                               {"site_from_room", {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}});
  }
  MakeFolder(folder_ / "joined");
  WriteBytes(folder_ / "joined/joined.json", joined.dump());
  EXPECT_EQ(Run().exit_code, 4);
  const std::string linked = Page();
  EXPECT_THAT(linked, HasSubstr("A room in a frame of its own"));
  EXPECT_THAT(linked, HasSubstr("aria-label=\"Plan of c\""));
  EXPECT_THAT(linked, Not(HasSubstr("aria-label=\"Plan of b\"")));

  // A report that cannot be read links none.
  joined["links"] = {3};
  WriteBytes(folder_ / "joined/joined.json", joined.dump());
  EXPECT_EQ(Run().exit_code, 4);
  EXPECT_THAT(Page(), HasSubstr("aria-label=\"Plan of b\""));
}

// A killed run, another program: what is no report counts as none.
TEST_F(SiteCommand, GetsAlongWithFilesThatAreNoReports) {
  AddStep("a", "align", StepState::kDone);
  for (const char* bytes :
       {"", "{", "[]", "{\"verdict\": 3, \"photos\": [1], \"coverage\": []}",
        "{\"verdict\": {\"state\": \"rooms\", \"headline\": \"\", \"sentences\": []}, "
        "\"remedies\": [], \"coverage\": {\"all\": 1, \"surface_m2\": 1, "
        "\"unseen_m2\": 1}, \"places_to_photograph\": [{\"area_m2\": \"x\"}]}",
        "{\"verdict\": {\"state\": 1, \"headline\": 2, \"sentences\": 3}, "
        "\"remedies\": 4, \"coverage\": {\"all\": 1, \"surface_m2\": 1, "
        "\"unseen_m2\": 1}, \"places_to_photograph\": 5}"}) {
    WriteBytes(folder_ / "a/report.json", bytes);
    WriteBytes(folder_ / "a/log/align.json", bytes);
    EXPECT_EQ(Run().exit_code, 4) << bytes;
    EXPECT_EQ(Site()["counts"]["unfinished"], 1) << bytes;
  }
}

TEST_F(SiteCommand, RefusesTablesThatNameNoRooms) {
  AddStep("a", "align", StepState::kDone);
  for (const char* table :
       {"", "photos,notes\n", "room\n", "room\na\na\n", "room\n../a\n", "room\n\"a\n"}) {
    WriteBytes(folder_ / "site.csv", table);
    const CommandResult result = Run(" --rooms_path " + (folder_ / "site.csv"));
    EXPECT_EQ(result.exit_code, 3) << table;
    EXPECT_THAT(result.err, HasSubstr("site.csv")) << table;
  }
  const TempFolder empty;
  EXPECT_EQ(RunCommandLine("roomtex-site --input_path " + empty.path() + " --output_path " +
                           (empty / "site.html"))
                .exit_code,
            3);
}

}  // namespace
}  // namespace roomtex
