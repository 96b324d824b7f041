#include "align/pick/align_job.h"

#include <chrono>
#include <filesystem>
#include <thread>

#include "colmap_ext/sparse_model.h"
#include "core/error.h"
#include "importers/rtpi_header.h"
#include "tests/align/pick/pick_page.h"
#include "tests/support/folders.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

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
  EXPECT_EQ(idle["command"], "");
  ASSERT_EQ(Put(1, ToJson(TruePicks(8))).status, 200);
  const Json state = Align();
  EXPECT_EQ(state["exit_code"], 0) << state.dump(1);
  EXPECT_THAT(state["command"].get<std::string>(),
              HasSubstr("roomtex-align --input_path " + ThePickRoom().input().input_paths[0]));
  EXPECT_THAT(state["command"].get<std::string>(), HasSubstr("--picks_path " + picks_path_));
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
  EXPECT_TRUE(Get("state").json()["session"]["found"].is_null()) << "nothing was searched for";
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
  void ServeWith(const std::string& script, size_t num_picks = 1) {
    const std::string program = folder_ / "program";
    WriteBytes(program, "#!/bin/sh\n" + script);
    std::filesystem::permissions(program, std::filesystem::perms::owner_all);
    Serve("", program);
    Put(1, ToJson(TruePicks(num_picks)));
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

// A run that finds the model where it is, without a pick.
class FoundPlace : public FakeProgram {
 protected:
  void SetUp() override {
    const SimulatedRoom& room = ThePickRoom().room();
    SparseModel model = room.MakeSparseModel(1500, 0.0);
    TransformModel(room.ScanFromSparse(), &model);
    std::filesystem::create_directories(folder_ / "aligned");
    WriteSparseModel(model, folder_ / "aligned");
    ServeWith("exit 4\n", 0);
    photo_ = ThePickRoom().scene().photos()[ThePickRoom().clicked_photo()].name();
  }
  // Runs it with this report; the session afterwards.
  Json Find(const Json& report) {
    WriteBytes(folder_ / "aligned/alignment.json", report.dump());
    EXPECT_EQ(Post("align").status, 200);
    done_ = WaitFor("state", "done");
    EXPECT_EQ(done_["exit_code"], 4);
    return Get("state").json()["session"];
  }
  static Json Undecided() {
    return {{"trusted", false},
            {"reason", "Only geometry speaks for it."},
            {"images", Json::array()},
            {"search", {{"verdict", "unconfirmed"}, {"hint_decides", true}}},
            {"scans", {{{"azimuth", ThePickRoom().scene().azimuth()}}}}};
  }
  std::string BackTile(int solution) const {
    return "tile?back=" + std::to_string(ThePickRoom().clicked_photo()) +
           "&scan=0&level=0&x=0&y=0&solution=" + std::to_string(solution);
  }
  std::string photo_;
  Json done_;
};

TEST_F(FoundPlace, IsShownUntilPicksPlaceThePhotos) {
  Json session = Get("state").json()["session"];
  const int before = session["solution_number"], revision = session["revision"];
  EXPECT_TRUE(session["found"].is_null());
  EXPECT_EQ(session["photos"][photo_]["solved"], false);
  EXPECT_EQ(Get(BackTile(before)).status, 404);

  session = Find(Undecided());
  EXPECT_THAT(done_["command"].get<std::string>(), Not(HasSubstr("--picks_path")));
  EXPECT_EQ(session["revision"], revision) << "the picks are the same";
  EXPECT_EQ(session["solution_number"], before + 1);
  EXPECT_EQ(session["found"]["trusted"], false);
  EXPECT_EQ(session["photos"][photo_]["by"], "search");
  EXPECT_EQ(session["photos"][photo_]["solved"], true);
  EXPECT_TRUE(session["photos"][photo_]["rms_px"].is_null());
  EXPECT_TRUE(session["photos"][photo_]["focal_length_px"].is_null()) << "no picks found it";
  EXPECT_TRUE(session["similarities"][0].is_null());
  EXPECT_EQ(Get(BackTile(before + 1)).status, 200);
  EXPECT_EQ(Get(BackTile(before)).status, 404);
  const Json edges = Get("edges?photo=" + std::to_string(ThePickRoom().clicked_photo()) +
                         "&solution=" + std::to_string(before + 1))
                         .json();
  EXPECT_GT(edges.size(), 30u);
  const Json photos = Get("state").json()["photos"];
  for (const Json& photo : photos) EXPECT_GT(photo["scan_share"], 0.01);

  // Six picks of one's own take over; without them it is back.
  session = Put(revision, ToJson(TruePicks(6))).json();
  EXPECT_EQ(session["photos"][photo_]["by"], "picks");
  for (const auto& [name, photo] : session["photos"].items()) EXPECT_NE(photo["by"], "search");
  EXPECT_THAT(session["next"].get<std::string>(), HasSubstr("Enough picks"));
  session = Put(revision + 1, Json::array()).json();
  EXPECT_EQ(session["photos"][photo_]["by"], "search");
}

TEST_F(FoundPlace, ThatIsUndecidedIsConfirmedByOnePairAndDoesNotSayItself) {
  Json session = Find(Undecided());
  const std::string confirm_in = session["found"]["confirm_in"];
  const PickPhoto* const photo = ThePickRoom().scene().FindPhoto(confirm_in);
  ASSERT_NE(photo, nullptr);
  EXPECT_FALSE(photo->missing);
  EXPECT_THAT(session["next"].get<std::string>(), HasSubstr("set it in " + confirm_in));
  // The other half is not shown: it would confirm whatever was found.
  Json half = ToJson(TruePicks(1), true);
  half[0].erase("scan");
  const int revision = session["revision"];
  session = Put(revision, half).json();
  EXPECT_TRUE(session["picks"][0]["predicted_scan"].is_null());
  session = Put(revision + 1, ToJson(TruePicks(1))).json();
  EXPECT_EQ(session["picks"][0]["status"], "waiting") << "nothing rests on it yet";
  EXPECT_LT(session["picks"][0]["residual_px"], 0.01) << "how far off the search has it";
  EXPECT_EQ(session["photos"][photo_]["num_used"], 0);
  EXPECT_THAT(session["next"].get<std::string>(), HasSubstr("Align again"));

  session = Find(Undecided());
  EXPECT_THAT(done_["command"].get<std::string>(), HasSubstr("--picks_path " + picks_path_));
  // Of a run that no pick would help nobody asks for one.
  Json contradicted = Undecided();
  contradicted["search"] = {{"verdict", "photos contradict"}, {"hint_decides", false}};
  session = Find(contradicted);
  EXPECT_TRUE(session["found"]["confirm_in"].is_null());
}

TEST_F(FoundPlace, OfSeveralModelsIsConfirmedInAPhotoOfTheUndecidedOne) {
  const Json decided = {{"search", {{"verdict", "none"}, {"hint_decides", false}}}};
  const Json undecided = {{"search", Undecided()["search"]}};
  Json report = Undecided();
  report["models"] = {undecided, decided};
  EXPECT_TRUE(Find(report)["found"]["confirm_in"].is_string());
  report["models"] = {decided, undecided};  // the page shows no photo of the second
  EXPECT_TRUE(Find(report)["found"]["confirm_in"].is_null());
  report["models"] = {undecided, decided};
  report["trusted"] = true;
  EXPECT_TRUE(Find(report)["found"]["confirm_in"].is_null());
}

TEST_F(FoundPlace, IsNotThatOfAnotherRun) {
  EXPECT_FALSE(Find(Undecided())["found"].is_null());
  // The scan was turned into its mirror image, which is not what the page shows.
  Json turned = Undecided();
  turned["scans"][0]["azimuth"] = OtherAzimuth(ThePickRoom().scene().azimuth());
  EXPECT_TRUE(Find(turned)["found"].is_null());
  EXPECT_THAT(done_["sentences"].dump(), HasSubstr("press Mirror"));
  EXPECT_FALSE(Find(Undecided())["found"].is_null());
  // A refusal leaves the model of the run before it in the folder.
  Json refused = Undecided();
  refused.erase("images");
  const Json session = Find(refused);
  EXPECT_TRUE(session["found"].is_null());
  EXPECT_EQ(session["photos"][photo_]["solved"], false);
  EXPECT_THAT(done_["headline"].get<std::string>(), HasSubstr("the search found no place"));
  // Six picks place the photos without a search.
  Json by_picks = Undecided();
  by_picks["search"] = nullptr;
  EXPECT_TRUE(Find(by_picks)["found"].is_null());
}

TEST_F(FoundPlace, OfABrokenModelIsSaid) {
  WriteBytes(folder_ / "aligned/images.bin", "nonsense");
  EXPECT_TRUE(Find(Undecided())["found"].is_null());
  EXPECT_THAT(done_["sentences"].dump(), HasSubstr("images.bin"));
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
