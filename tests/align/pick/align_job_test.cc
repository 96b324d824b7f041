#include "align/pick/align_job.h"

#include <chrono>
#include <filesystem>
#include <thread>

#include "core/error.h"
#include "tests/align/pick/pick_page.h"
#include "tests/support/folders.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

const std::string kAlign = BinFolder() + "/roomtex-align";

class AlignButton : public PickPage {
 protected:
  void SetUp() override { Serve("", kAlign); }

  // Presses the button and waits for the end.
  Json Align() {
    EXPECT_EQ(Post("align").status, 200);
    for (int i = 0; i < 6000; ++i) {  // five minutes: a sanitizer takes one
      const Json state = Get("align").json();
      if (state["state"] == "done") return state;
      EXPECT_EQ(state["state"], "running");
      EXPECT_GE(state["share"], 0.0);
      EXPECT_LE(state["share"], 1.0);
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return {};
  }
};

TEST_F(AlignButton, AlignsAndSaysHowGoodItIs) {
  const Json idle = Get("align").json();
  EXPECT_EQ(idle["state"], "idle");
  EXPECT_TRUE(idle["exit_code"].is_null());
  EXPECT_EQ(Post("align").status, 422);  // there are no pairs yet
  EXPECT_THAT(idle["command"].get<std::string>(),
              HasSubstr("roomtex-align --input_path " + ThePickRoom().input().input_paths[0]));
  ASSERT_EQ(Put(1, ToJson(TruePicks(8))).status, 200);
  const Json state = Align();
  EXPECT_EQ(state["exit_code"], 0) << state.dump(1);
  EXPECT_EQ(state["verdict"], "trusted");
  EXPECT_THAT(state["headline"].get<std::string>(), HasSubstr("Trusted: the photos are placed to"));
  EXPECT_EQ(state["share"], 1.0);
  EXPECT_GE(state["facts"].size(), 8u);
  for (const Json& fact : state["facts"]) {
    EXPECT_NE(fact["name"], "");
    EXPECT_NE(fact["value"], "");
  }
  EXPECT_GE(state["log"].size(), 8u);
  ASSERT_FALSE(state["overlays"].empty());
  const Answer overlay = Get("overlay?name=" + state["overlays"][0].get<std::string>());
  EXPECT_EQ(overlay.status, 200);
  EXPECT_EQ(overlay.type, "image/jpeg");
  EXPECT_EQ(overlay.body.substr(0, 2), "\xff\xd8");
  for (const char* name : {"../alignment.json", "alignment.json", "..%2falignment.json", "."}) {
    EXPECT_EQ(Get(std::string("overlay?name=") + name).status, 404) << name;
  }
  EXPECT_TRUE(std::filesystem::exists(folder_ / "aligned/images.bin"));
  // The same numbers on the page and in the report.
  const Json report = Json::parse(ReadBytes(folder_ / "aligned/alignment.json"));
  const Json session = Get("state").json()["session"];
  EXPECT_NEAR(report["picks"]["rms_px"], session["similarities"][0]["rms_px"].get<double>(), 1e-9);
  for (size_t i = 0; i < 8; ++i) {
    EXPECT_NEAR(report["picks"]["per_pick"][i]["residual_px"],
                session["picks"][i]["residual_px"].get<double>(), 1e-9);
  }
}

TEST_F(AlignButton, ARefusalIsToldInItsOwnWords) {
  // Clicked in one photo, noted as another one.
  std::vector<SessionPick> picks = TruePicks(7);
  for (SessionPick& pick : picks) {
    pick.image_name = ThePickRoom().room().PhotoName(ThePickRoom().other_photo());
  }
  ASSERT_EQ(Put(1, ToJson(picks)).status, 200);
  const Json state = Align();
  EXPECT_EQ(state["exit_code"], 4) << state.dump(1);
  EXPECT_EQ(state["verdict"], "untrusted");
  EXPECT_FALSE(state["sentences"].empty());
}

// They say where to search (align/search).
TEST_F(AlignButton, FewerThanSixPicksAreAHint) {
  ASSERT_EQ(Put(1, ToJson(TruePicks(4))).status, 200);
  const Json state = Align();
  EXPECT_EQ(state["exit_code"], 0) << state.dump(1);
  EXPECT_EQ(state["verdict"], "trusted");
  const Json report = Json::parse(ReadBytes(folder_ / "aligned/alignment.json"));
  EXPECT_FALSE(report["search"].is_null());
  EXPECT_LT(report["expected_error"]["at_cameras_mm"], 5);
  for (const Json& pick : report["picks"]["per_pick"]) {
    EXPECT_LT(pick["refined_residual_px"], 2) << pick;
  }
}

// Programs in the place of roomtex-align.
class FakeProgram : public PickPage {
 protected:
  void SetUp() override {}
  void ServeWith(const std::string& script) {
    const std::string program = folder_ / "program";
    WriteBytes(program, "#!/bin/sh\n" + script);
    std::filesystem::permissions(program, std::filesystem::perms::owner_all);
    Serve("", program);
    Put(1, ToJson(TruePicks(1)));
  }
  Json WaitFor(const std::string& key, const Json& value) {
    for (int i = 0; i < 400; ++i) {
      const Json state = Get("align").json();
      if (state[key] == value) return state;
      std::this_thread::sleep_for(std::chrono::milliseconds(25));
    }
    return Get("align").json();
  }
};

TEST_F(FakeProgram, ARunningOneIsFollowedAndEnded) {
  ServeWith("echo $$ > " + (folder_ / "pid") +
            "\necho 'read model                   0.09 s' >&2\nsleep 100 & wait\n");
  ASSERT_EQ(Post("align").status, 200);
  Json state = WaitFor("stage", "read scan");
  EXPECT_EQ(state["state"], "running");
  EXPECT_GT(state["share"], 0);
  EXPECT_THAT(state["log"].dump(), HasSubstr("read model"));
  EXPECT_EQ(Post("align").status, 422);  // one at a time
  const auto start = std::chrono::steady_clock::now();
  state = Send("DELETE", "align", "{}").json();
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(2));
  EXPECT_EQ(state["state"], "done");
  EXPECT_EQ(state["verdict"], "failed");
  EXPECT_THAT(state["headline"].get<std::string>(), HasSubstr("Ended"));
  const pid_t pid = std::stoi(ReadBytes(folder_ / "pid"));
  EXPECT_NE(kill(pid, 0), 0);
  EXPECT_EQ(Post("align").status, 200);  // again
  server_.reset();                       // the server's end is the program's end
}

TEST_F(FakeProgram, OneThatDoesNotListenIsKilled) {
  ServeWith("trap '' TERM\necho ready >&2\nwhile true; do sleep 0.05; done\n");
  ASSERT_EQ(Post("align").status, 200);
  WaitFor("log", Json::array({"ready"}));
  const Json state = Send("DELETE", "align", "{}").json();
  EXPECT_EQ(state["state"], "done");
  EXPECT_EQ(state["exit_code"], 128 + 9);
}

TEST_F(FakeProgram, OddOutputDoesNoHarm) {
  ServeWith(
      "head -c 300000 /dev/zero | tr '\\0' x >&2\necho >&2\nfor i in $(seq 1000); do echo line "
      "$i >&2; done\nprintf '\\377\\376 end' >&2\nexit 1\n");
  ASSERT_EQ(Post("align").status, 200);
  const Json state = WaitFor("state", "done");
  EXPECT_EQ(state["exit_code"], 1);
  EXPECT_EQ(state["verdict"], "failed");
  EXPECT_LE(state["log"].size(), 300u);
}

TEST_F(FakeProgram, ABrokenReportIsNoCrash) {
  for (const char* report : {"", "5",
                             "{\"picks\": 7, \"warnings\": [3], \"reason\": 4, \"overlays\": "
                             "[5, \"/etc/passwd\"], \"scale\": {\"value\": \"x\"}}"}) {
    std::filesystem::create_directories(folder_ / "aligned");
    WriteBytes(folder_ / "aligned/alignment.json", report);
    ServeWith("exit 4\n");
    ASSERT_EQ(Post("align").status, 200);
    EXPECT_EQ(WaitFor("state", "done")["verdict"], "untrusted");
    EXPECT_EQ(Get("overlay?name=passwd").status, 404);
  }
}

TEST_F(FakeProgram, AReportOfAnEarlierRunIsNotThisOnes) {
  std::filesystem::create_directories(folder_ / "aligned");
  WriteBytes(folder_ / "aligned/alignment.json", "{\"expected_error\": {\"at_cameras_mm\": 1}}");
  ServeWith("echo 'roomtex-align: too few picks' >&2\nexit 3\n");
  ASSERT_EQ(Post("align").status, 200);
  const Json state = WaitFor("state", "done");
  EXPECT_EQ(state["exit_code"], 3);
  EXPECT_EQ(state["verdict"], "failed");
  EXPECT_THAT(state["sentences"].dump(), HasSubstr("too few picks"));
  EXPECT_THAT(state["facts"], IsEmpty());
}

TEST_F(FakeProgram, OneThatIsNotThereIsSaid) {
  Serve("", folder_ / "nothing");
  Put(1, ToJson(TruePicks(1)));
  const Answer answer = Post("align");
  EXPECT_EQ(answer.status, 422);
  EXPECT_THAT(answer.body, HasSubstr("does not exist. It belongs beside roomtex-pick."));
  EXPECT_EQ(Get("align").json()["state"], "idle");
}

TEST(AlignVerdict, SaysWhatTheExitCodeMeans) {
  const AlignVerdict killed = JudgeRun(128 + 9, Json(), {});
  EXPECT_EQ(killed.verdict, "failed");
  EXPECT_THAT(killed.headline, HasSubstr("killed"));
  const AlignVerdict usage = JudgeRun(kExitUsage, Json(), {"--x is wrong"});
  EXPECT_THAT(usage.sentences, Contains("--x is wrong"));
  const Json report = {{"expected_error", {{"at_cameras_mm", 3.4}}},
                       {"reason", "Few points lie on the surface."},
                       {"scan_from_sparse", {{"scale", 1}}},
                       {"warnings", {"A warning."}}};
  const AlignVerdict trusted = JudgeRun(kExitDone, report, {});
  EXPECT_EQ(trusted.headline, "Trusted: the photos are placed to about 3.4 mm.");
  EXPECT_THAT(trusted.sentences, Contains("A warning."));
  Json of_two = report;
  of_two["models"] = {{{"num_images", 7}, {"joined", true}},
                      {{"num_images", 5}, {"joined", false}}};
  EXPECT_EQ(JudgeRun(kExitDone, of_two, {}).headline,
            "Trusted: 7 of 12 photos are placed to about 3.4 mm.");
  const AlignVerdict untrusted = JudgeRun(kExitUntrusted, report, {});
  EXPECT_EQ(untrusted.verdict, "untrusted");
  EXPECT_THAT(untrusted.sentences, Contains("Few points lie on the surface."));
}

}  // namespace
}  // namespace roomtex
