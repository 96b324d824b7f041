#include "align/pick/pick_server.h"

#include <atomic>
#include <filesystem>
#include <thread>

#include <opencv2/imgcodecs.hpp>

#include "align/pick/back_projection.h"
#include "align/pick/scan_picture.h"
#include "core/command_line.h"
#include "core/photo.h"
#include "tests/align/pick/pick_page.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

cv::Mat Decode(const std::string& bytes) {
  return cv::imdecode(std::vector<uchar>(bytes.begin(), bytes.end()), cv::IMREAD_UNCHANGED);
}

TEST_F(PickPage, StateSaysWhatThereIs) {
  const Json state = Get("state").json();
  EXPECT_EQ(state["version"], Version());
  EXPECT_EQ(state["min_picks"], 6);
  EXPECT_EQ(state["picks_path"], picks_path_);
  EXPECT_EQ(state["aligned_path"], folder_ / "aligned");
  EXPECT_EQ(state["ready"], true);
  ASSERT_EQ(state["scans"].size(), 1u);
  const Json& scan = state["scans"][0];
  EXPECT_EQ(scan["id"], 0);
  EXPECT_EQ(scan["name"], "room.rtpi");
  EXPECT_EQ(scan["width"], 1000);
  EXPECT_EQ(scan["height"], 500);
  EXPECT_EQ(scan["tile_size"], 512);
  EXPECT_EQ(scan["num_levels"], 2);
  EXPECT_NEAR(scan["aspect"], 135.0 / 500 / (360.0 / 1000), 0.01);
  EXPECT_EQ(scan["pictures"], Json({"intensity", "local", "shaded"}));
  ASSERT_EQ(state["photos"].size(), 8u);
  for (size_t i = 0; i < 8; ++i) {
    const Json& photo = state["photos"][i];
    EXPECT_EQ(photo["rank"], i + 1);
    EXPECT_EQ(photo["width"], 968);
    EXPECT_EQ(photo["height"], 644);
    EXPECT_EQ(photo["missing"], i >= 2);
    EXPECT_EQ(photo["num_levels"], i < 2 ? 2 : 0);
    EXPECT_TRUE(photo["scan_share"].is_null());
  }
  EXPECT_EQ(state["selected_photo"], state["photos"][0]["id"]);
  const Json& session = state["session"];
  EXPECT_EQ(session["revision"], 1);
  EXPECT_EQ(session["saved"], true);
  EXPECT_EQ(session["save_error"], "");
  EXPECT_EQ(session["picks"], Json::array());
  EXPECT_EQ(session["photos"].size(), 8u);
  EXPECT_TRUE(session["similarities"][0].is_null());
  EXPECT_THAT(session["next"].get<std::string>(), HasSubstr("Click a point"));
  EXPECT_FALSE(std::filesystem::exists(picks_path_));  // nothing was changed yet
}

TEST_F(PickPage, ThePageAndItsFilesAreServed) {
  EXPECT_EQ(Get("").body, "<p>page</p>");
  EXPECT_EQ(Get("pick.js").body, "1");
}

TEST_F(PickPage, TilesShowPhotoAndScan) {
  const int photo = ThePickRoom().clicked_photo();
  const std::string of_photo = "tile?photo=" + std::to_string(photo);
  const Answer tile = Get(of_photo + "&level=0&x=1&y=1");
  ASSERT_EQ(tile.status, 200);
  EXPECT_EQ(tile.type, "image/jpeg");
  const cv::Mat picture = ReadPhoto(ThePickRoom().photo_path(photo));
  const cv::Mat shown = Decode(tile.body);
  ASSERT_EQ(shown.size(), cv::Size(968 - 512, 644 - 512));
  EXPECT_LT(cv::norm(shown, picture(cv::Rect(512, 512, shown.cols, shown.rows)), cv::NORM_L1) /
                shown.total(),
            12);
  EXPECT_EQ(Decode(Get(of_photo + "&level=1&x=0&y=0").body).size(), cv::Size(484, 322));
  for (const std::string& name : ScanPictureNames()) {
    const Answer scan = Get("tile?scan=0&picture=" + name + "&level=0&x=0&y=0");
    ASSERT_EQ(scan.status, 200) << name;
    EXPECT_EQ(Decode(scan.body).size(), cv::Size(512, 500));
  }
  const Answer thumbnail = Get("thumbnail?photo=" + std::to_string(photo));
  ASSERT_EQ(thumbnail.status, 200);
  EXPECT_EQ(Decode(thumbnail.body).cols, 240);
  EXPECT_EQ(Decode(thumbnail.body).rows, 160);
}

TEST_F(PickPage, APhotoThatIsCutOffIsSaidAndNotShownInHalf) {
  const int photo = ThePickRoom().other_photo();
  const std::string path = ThePickRoom().photo_path(photo), whole = ReadBytes(path);
  WriteBytes(path, whole.substr(0, whole.size() / 2));
  for (const std::string picture :
       {"tile?level=0&x=0&y=0&photo=", "thumbnail?photo=", "corner?x=300&y=200&reach=8&photo="}) {
    const Answer answer = Get(picture + std::to_string(photo));
    EXPECT_EQ(answer.status, 422) << picture;
    EXPECT_THAT(answer.json()["error"].get<std::string>(),
                HasSubstr("the file ends before the picture does"));
  }
  WriteBytes(path, whole);
}

TEST_F(PickPage, WhatIsNotThereIsNotFound) {
  for (const char* path : {"tile",
                           "tile?photo=2",
                           "tile?photo=0&level=0&x=0&y=0",
                           "tile?photo=99&level=0&x=0&y=0",
                           "tile?photo=-1&level=0&x=0&y=0",
                           "tile?photo=2&level=9&x=0&y=0",
                           "tile?photo=2&level=0&x=2&y=0",
                           "tile?photo=2&level=0&x=-1&y=0",
                           "tile?photo=2x&level=0&x=0&y=0",
                           "tile?photo=../../etc/passwd&level=0&x=0&y=0",
                           "tile?scan=0&picture=../intensity&level=0&x=0&y=0",
                           "tile?scan=1&picture=intensity&level=0&x=0&y=0",
                           "tile?scan=0&level=0&x=0&y=0",
                           "tile?back=2&scan=0&solution=1&level=0&x=0&y=0",  // nothing is solved
                           "tile?back=99&scan=0&solution=1&level=0&x=0&y=0",
                           "thumbnail",
                           "thumbnail?photo=0",
                           "thumbnail?photo=-1",
                           "thumbnail?photo=8",
                           "overlay",
                           "overlay?name=",
                           "overlay?name=../alignment.json",
                           "overlay?name=/etc/passwd",
                           "picks.csv",
                           "images"}) {
    const Answer answer = Get(path);
    EXPECT_EQ(answer.status, 404) << path;
    EXPECT_THAT(answer.body, Not(HasSubstr("root:")));
  }
}

TEST_F(PickPage, AScanPointIsSaidOrRefusedWithAnOffer) {
  const SessionPick pick = TruePicks(1)[0];
  const auto ask = [&](double x, double y) {
    return Get("scan_point?scan=0&x=" + std::to_string(x) + "&y=" + std::to_string(y));
  };
  const Json found = ask(pick.spot->place.x(), pick.spot->place.y()).json();
  EXPECT_EQ(found["ok"], true);
  EXPECT_EQ(found["reason"], "");
  EXPECT_TRUE(found["snap"].is_null());
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(found["point"][k], (*pick.x_in_scan)[k], 1e-5);
  EXPECT_NEAR(found["range"], pick.x_in_scan->norm(), 1e-5);
  // Somewhere in the window nothing was measured.
  bool missing = false, edge = false;
  const ScanPlaces& places = ThePickRoom().places();
  for (int row = 5; row < 490; row += 3) {
    for (int column = 5; column < 990; column += 3) {
      const auto reason = places.PointAt({column + 0.3, row + 0.4}).reason;
      const bool is_missing = reason == ScanPlaces::Reason::kMissing;
      const bool is_edge = reason == ScanPlaces::Reason::kDepthEdge;
      if (!(is_missing && !missing) && !(is_edge && !edge)) continue;
      const Json refused = ask(column + 0.3, row + 0.4).json();
      EXPECT_EQ(refused["ok"], false);
      EXPECT_EQ(refused["reason"], is_missing ? "missing" : "depth_edge");
      EXPECT_NE(refused["message"], "");
      EXPECT_TRUE(refused["point"].is_null());
      (is_missing ? missing : edge) = true;
      if (refused["snap"].is_null()) continue;
      const Json& snap = refused["snap"];
      const Json snapped = ask(snap["x"], snap["y"]).json();
      EXPECT_EQ(snapped["ok"], true);
    }
  }
  EXPECT_TRUE(missing && edge);
  EXPECT_EQ(ask(-1, 5).json()["reason"], "outside");
  for (const char* path : {"scan_point", "scan_point?scan=1&x=1&y=1", "scan_point?scan=0&x=1",
                           "scan_point?scan=0&x=nan&y=1", "scan_point?scan=0&x=a&y=1"}) {
    const Answer answer = Get(path);
    EXPECT_EQ(answer.status, 422) << path;
    EXPECT_TRUE(answer.json()["error"].is_string());
  }
}

TEST_F(PickPage, PicksAreSolvedAndSaved) {
  const Answer answer = Put(1, ToJson(TruePicks(6), true));
  ASSERT_EQ(answer.status, 200) << answer.body;
  const Json session = answer.json();
  EXPECT_EQ(session["revision"], 2);
  EXPECT_EQ(session["saved"], true);
  ASSERT_EQ(session["picks"].size(), 6u);
  for (const Json& pick : session["picks"]) {
    EXPECT_EQ(pick["complete"], true);
    EXPECT_EQ(pick["used"], true);
    EXPECT_EQ(pick["status"], "used");
    EXPECT_LT(pick["residual_px"], 1e-3);
    EXPECT_LT(pick["residual_mm"], 1e-2);
    EXPECT_EQ(pick["residual"].size(), 2u);
    EXPECT_LT(pick["leave_one_out_px"], 0.1);
    EXPECT_TRUE(pick["predicted_img"].is_null());
    EXPECT_TRUE(pick["predicted_scan"].is_null());
    EXPECT_EQ(pick["point"].size(), 3u);
  }
  const Json& photo = session["photos"][ClickedName()];
  EXPECT_EQ(photo["solved"], true);
  EXPECT_EQ(photo["by"], "picks");
  EXPECT_EQ(photo["num_complete"], 6);
  EXPECT_EQ(photo["num_used"], 6);
  EXPECT_LT(photo["rms_px"], 1e-3);
  EXPECT_EQ(photo["ambiguous"], false);
  const Json& other = session["photos"][ThePickRoom().room().PhotoName(0)];
  EXPECT_EQ(other["by"], "sparse_model");
  EXPECT_TRUE(other["rms_px"].is_null());
  EXPECT_EQ(session["similarities"][0]["num_photos"], 1);
  EXPECT_LT(session["similarities"][0]["relative_mad"], 0.02);
  EXPECT_GT(session["milliseconds"], 0);

  const std::vector<Pick> saved = ReadPicks(picks_path_);
  ASSERT_EQ(saved.size(), 6u);
  for (size_t i = 0; i < 6; ++i) {
    const Json& pick = session["picks"][i];
    EXPECT_EQ(saved[i].image_name, ClickedName());
    for (int k = 0; k < 2; ++k) EXPECT_EQ(saved[i].x_in_img[k], pick["img"][k].get<double>());
    for (int k = 0; k < 3; ++k) EXPECT_EQ(saved[i].x_in_scan[k], pick["point"][k].get<double>());
  }
  const Json state = Get("state").json();
  EXPECT_EQ(state["session"]["picks"], session["picks"]);
  EXPECT_EQ(state["selected_photo"], ThePickRoom().clicked_photo());
  for (const Json& one : state["photos"]) {
    EXPECT_GT(one["scan_share"], 0.01);
    EXPECT_LT(one["scan_share"], 0.6);
  }
}

TEST_F(PickPage, OfAPickThatIsSentBackThePointCounts) {
  Json picks = ToJson(TruePicks(6));
  const double x = picks[0]["point"][0];
  picks[0]["point"][0] = x + 0.25;
  picks[0]["scan"]["x"] = 12.5;  // drawn somewhere else: no matter
  const Json session = Put(1, picks).json();
  EXPECT_EQ(session["picks"][0]["point"][0], x + 0.25);
  EXPECT_EQ(session["picks"][0]["scan"]["x"], 12.5);
  // By hand, without a place: it is found.
  picks[0].erase("scan");
  const Json by_hand = Put(2, picks).json();
  EXPECT_TRUE(by_hand["picks"][0]["scan"].is_object());
}

TEST_F(PickPage, HalfPairsAreKeptButNotSaved) {
  Json picks = ToJson(TruePicks(7), true);
  picks[6].erase("img");
  const Json session = Put(1, picks).json();
  EXPECT_EQ(session["picks"][6]["status"], "half");
  EXPECT_EQ(session["picks"][6]["complete"], false);
  EXPECT_TRUE(session["picks"][6]["img"].is_null());
  const Eigen::Vector2d truth = *TruePicks(7)[6].x_in_img;
  EXPECT_NEAR(session["picks"][6]["predicted_img"][0], truth.x(), 0.1);
  EXPECT_NEAR(session["picks"][6]["predicted_img"][1], truth.y(), 0.1);
  EXPECT_EQ(ReadPicks(picks_path_).size(), 6u);

  picks = ToJson(TruePicks(7), true);
  picks[6].erase("scan");
  const Json other = Put(2, picks).json();
  const SessionPick pick = TruePicks(7)[6];
  EXPECT_NEAR(other["picks"][6]["predicted_scan"]["x"], pick.spot->place.x(), 0.2);
  EXPECT_NEAR(other["picks"][6]["predicted_scan"]["y"], pick.spot->place.y(), 0.2);
  EXPECT_EQ(other["picks"][6]["predicted_scan"]["id"], 0);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(other["picks"][6]["predicted_scan"]["point"][k], (*pick.x_in_scan)[k], 2e-3);
  }
}

TEST_F(PickPage, AnotherTabsRevisionIsRefused) {
  EXPECT_EQ(Put(1, ToJson(TruePicks(2))).status, 200);
  for (const int revision : {1, 3, 0}) {
    const Answer answer = Put(revision, Json::array());
    EXPECT_EQ(answer.status, 422);
    EXPECT_THAT(answer.body, HasSubstr("another tab"));
  }
  EXPECT_EQ(ReadPicks(picks_path_).size(), 2u);
  EXPECT_EQ(Put(2, Json::array()).json()["revision"], 3);
  EXPECT_THAT(ReadPicks(picks_path_), IsEmpty());
}

TEST_F(PickPage, WhatThePageNeverSendsIsRefusedInASentence) {
  const Json good = ToJson(TruePicks(1)[0]);
  std::vector<Json> bad(20, good);
  int i = 0;
  bad[i++]["image_name"] = "no_such_photo.jpg";
  bad[i++]["image_name"] = 7;
  bad[i++].erase("image_name");
  bad[i++]["img"] = {1};
  bad[i++]["img"] = {1, 2, 3};
  bad[i++]["img"] = {"1", "2"};
  bad[i++]["img"] = {-1, 5};
  bad[i++]["img"] = {5, 645};
  bad[i++]["img"] = {1e300, 5};
  bad[i++]["img"] = true;
  bad[i++]["scan"] = {{"id", 1}, {"x", 5}, {"y", 5}};
  bad[i++]["scan"] = {{"id", 0.5}, {"x", 5}, {"y", 5}};
  bad[i++]["scan"] = {{"id", 0}, {"x", 5}};
  bad[i++]["scan"] = {{"id", 0}, {"x", 5}, {"y", 1e9}};
  bad[i++]["scan"] = Json::array({0, 5, 5});
  bad[i++]["point"] = {1, 2};
  bad[i++]["point"] = {1, 2, 1e30};
  bad[i++]["weight"] = -1;
  bad[i++]["weight"] = 1e9;
  bad[i++]["weight"] = "heavy";
  bad.push_back({{"image_name", ClickedName()}, {"weight", 1}});
  bad.push_back(Json(5));
  for (const Json& pick : bad) {
    const Answer answer = Put(1, Json::array({pick}));
    EXPECT_EQ(answer.status, 422) << pick;
    ASSERT_TRUE(answer.json()["error"].is_string()) << answer.body;
    EXPECT_EQ(answer.json()["error"].get<std::string>().back(), '.') << answer.body;
  }
  for (const char* body :
       {"[]", "{}", "5", "{\"revision\": 1}", "{\"revision\": \"1\", \"picks\": []}",
        "{\"revision\": 1, \"picks\": {}}", "{\"revision\": 1.5, \"picks\": []}"}) {
    EXPECT_EQ(Send("PUT", "picks", body).status, 422) << body;
  }
  for (const char* body : {"{\"revision\": 1, \"picks\": [{\"img\": [NaN, 1]}]}",
                           "{\"revision\":", "{\"revision\": 1e999, \"picks\": []}"}) {
    EXPECT_EQ(Send("PUT", "picks", body).status, 400) << body;
  }
  EXPECT_EQ(Put(1, Json::array_t(2001, good)).status, 422);
  EXPECT_EQ(Put(1, Json::array({good, good})).status, 422);  // twice the same
  EXPECT_EQ(Get("state").json()["session"]["revision"], 1);
  EXPECT_FALSE(std::filesystem::exists(picks_path_));
}

TEST_F(PickPage, APlaceThatCannotBePickedIsRefused) {
  Json pick = ToJson(TruePicks(1)[0], true);
  const ScanPlaces& places = ThePickRoom().places();
  for (int i = 0; i < 500000; i += 7) {
    if (!places.scan().IsMissing(places.SampleAt(i % 1000, i / 1000))) continue;
    pick["scan"] = {{"id", 0}, {"x", i % 1000 + 0.5}, {"y", i / 1000 + 0.5}};
    break;
  }
  const Answer answer = Put(1, Json::array({pick}));
  EXPECT_EQ(answer.status, 422);
  EXPECT_THAT(answer.body, HasSubstr("measured nothing"));
}

TEST_F(PickPage, AFileIsContinuedAndKeptAsItWas) {
  ASSERT_EQ(Put(1, ToJson(TruePicks(6))).status, 200);
  const std::string first = "# by hand\n" + ReadBytes(picks_path_);
  WriteBytes(picks_path_, first);
  Serve();
  const Json session = Get("state").json()["session"];
  ASSERT_EQ(session["picks"].size(), 6u);
  EXPECT_LT(session["photos"][ClickedName()]["rms_px"], 1e-3);
  for (size_t i = 0; i < 6; ++i) {  // drawn where they were clicked
    EXPECT_NEAR(session["picks"][i]["scan"]["x"], TruePicks(6)[i].spot->place.x(), 1e-4);
    EXPECT_NEAR(session["picks"][i]["scan"]["y"], TruePicks(6)[i].spot->place.y(), 1e-4);
  }
  EXPECT_EQ(ReadBytes(picks_path_), first);
  EXPECT_FALSE(std::filesystem::exists(picks_path_ + ".bak"));
  ASSERT_EQ(Put(1, ToJson(TruePicks(3))).status, 200);
  EXPECT_EQ(ReadBytes(picks_path_ + ".bak"), first);
  ASSERT_EQ(Put(2, ToJson(TruePicks(2))).status, 200);
  EXPECT_EQ(ReadBytes(picks_path_ + ".bak"), first);  // of this session's begin
  EXPECT_EQ(ReadPicks(picks_path_).size(), 2u);
}

TEST_F(PickPage, ThePhotoOfTheCommandLineIsSelected) {
  Serve(ThePickRoom().room().PhotoName(5));
  EXPECT_EQ(Get("state").json()["selected_photo"], 5);
}

TEST_F(PickPage, PicksThatCannotBeSavedAreSaidAndNotLost) {
  std::filesystem::create_directories(picks_path_ + "/in the way");
  const Json session = Put(1, ToJson(TruePicks(4))).json();
  EXPECT_EQ(session["saved"], false);
  EXPECT_THAT(session["save_error"].get<std::string>(), HasSubstr("could not be saved"));
  EXPECT_EQ(session["picks"].size(), 4u);
  EXPECT_EQ(Post("align").status, 422);  // would run on other picks
  std::filesystem::remove_all(picks_path_);
  EXPECT_EQ(Get("state").json()["session"]["saved"], true) << "tried again";
  EXPECT_EQ(ReadPicks(picks_path_).size(), 4u);
  const Json saved = Put(2, ToJson(TruePicks(5))).json();
  EXPECT_EQ(saved["saved"], true);
  EXPECT_EQ(saved["save_error"], "");
  EXPECT_EQ(ReadPicks(picks_path_).size(), 5u);
}

// It is kept beside the file; to be asked how things stand is no reason to replace it.
TEST_F(PickPage, AFileThatWasEditedMeanwhileIsReplacedByTheNextChangeOnly) {
  const Json picks = ToJson(TruePicks(6));
  ASSERT_EQ(Put(1, picks).json()["saved"], true);
  WriteBytes(picks_path_, "by hand");
  EXPECT_EQ(Put(2, picks).json()["saved"], false);
  for (int k = 0; k < 2; ++k) {
    const Json session = Get("state").json()["session"];
    EXPECT_EQ(session["saved"], false);
    EXPECT_THAT(session["save_error"].get<std::string>(), HasSubstr("changed by somebody else"));
    EXPECT_EQ(ReadBytes(picks_path_), "by hand");
  }
  EXPECT_EQ(Put(3, picks).json()["saved"], true);
  EXPECT_EQ(ReadPicks(picks_path_).size(), 6u);
  EXPECT_EQ(ReadBytes(picks_path_ + ".other"), "by hand");
}

TEST(PickSession, RefusesAPicksFileOfAnotherModel) {
  const TempFolder folder;
  WriteBytes(folder / "picks.csv", "image_name,x,y,scan_x,scan_y,scan_z\nphoto_02.jpg,1,2,3,4,5\n");
  EXPECT_INPUT_ERROR(PickSession(ThePickRoom().scene(), folder / "picks.csv"),
                     "nearest name: photo_00");
  WriteBytes(folder / "picks.csv", "nonsense\n");
  EXPECT_INPUT_ERROR(PickSession(ThePickRoom().scene(), folder / "picks.csv"), "line 1");
}

TEST_F(PickPage, ThePhotoIsSeenOnTheScan) {
  ASSERT_EQ(Put(1, ToJson(TruePicks(6))).status, 200);
  const int photo = ThePickRoom().clicked_photo();
  const std::string path = "tile?back=" + std::to_string(photo) + "&scan=0&solution=2&level=0&";
  cv::Mat4b whole(500, 1000);
  for (int x = 0; x < 2; ++x) {
    const Answer tile = Get(path + "y=0&x=" + std::to_string(x));
    ASSERT_EQ(tile.status, 200);
    EXPECT_EQ(tile.type, "image/png");
    const cv::Mat4b part = Decode(tile.body);
    part.copyTo(whole(cv::Rect(512 * x, 0, part.cols, part.rows)));
  }
  const cv::Mat3b picture = ReadPhoto(ThePickRoom().photo_path(photo));
  double difference = 0;
  int count = 0;
  for (const SessionPick& pick : ThePickRoom().SmoothPicks(photo, 200)) {
    const cv::Vec4b seen =
        whole(static_cast<int>(pick.spot->place.y()), static_cast<int>(pick.spot->place.x()));
    EXPECT_EQ(seen[3], 255);
    cv::Mat3b around;
    const cv::Rect2d window(pick.x_in_img->x() - 3, pick.x_in_img->y() - 3, 6, 6);
    const cv::Rect inside = cv::Rect(window) & cv::Rect(0, 0, picture.cols, picture.rows);
    const cv::Scalar mean = cv::mean(picture(inside));
    for (int k = 0; k < 3; ++k) difference += std::abs(mean[k] - seen[k]) / 3;
    ++count;
  }
  ASSERT_EQ(count, 200);
  EXPECT_LT(difference / count, 12);
  // What lies behind the camera or is hidden is transparent.
  const Rigid cam_from_scan = ThePickRoom().room().CamFromScan(photo);
  int hidden = 0, wrong = 0;
  for (int row = 0; row < 500; row += 5) {
    for (int column = 0; column < 1000; column += 5) {
      const int sample = ThePickRoom().places().SampleAt(column, row);
      const Eigen::Vector3d& x = ThePickRoom().places().scan().points[sample];
      if (!((cam_from_scan * x).z() < -0.01)) continue;
      ++hidden;
      wrong += whole(row, column)[3] != 0;
    }
  }
  EXPECT_GT(hidden, 3000);
  EXPECT_EQ(wrong, 0);
  // Forgotten with its solution.
  ASSERT_EQ(Put(2, ToJson(TruePicks(5))).status, 200);
  EXPECT_EQ(Get(path + "x=0&y=0").status, 404);
}

TEST(BackProjection, LevelsWeightColoursByTheirAlpha) {
  cv::Mat4b image(3, 3, cv::Vec4b(0, 0, 0, 0));
  image(0, 0) = {200, 100, 50, 255};
  image(2, 2) = {10, 20, 30, 255};
  const cv::Mat4b half = HalvedWithAlpha(image);
  ASSERT_EQ(half.size(), cv::Size(2, 2));
  EXPECT_EQ(half(0, 0), cv::Vec4b(200, 100, 50, 64));
  EXPECT_EQ(half(1, 1), cv::Vec4b(10, 20, 30, 255));
  EXPECT_EQ(half(0, 1)[3], 0);
}

TEST_F(PickPage, EdgesOfTheScanLieOnThoseOfThePhoto) {
  ASSERT_EQ(Put(1, ToJson(TruePicks(6))).status, 200);
  const std::string photo = std::to_string(ThePickRoom().clicked_photo());
  const Json edges = Get("edges?photo=" + photo + "&solution=2").json();
  ASSERT_TRUE(edges.is_array());
  ASSERT_GT(edges.size(), 30u);
  std::map<std::string, int> kinds;
  for (const Json& edge : edges) {
    ++kinds[edge["kind"].get<std::string>()];
    EXPECT_GE(edge["points"].size(), 2u);
    for (const Json& point : edge["points"]) {
      EXPECT_TRUE(point[0] >= 0 && point[0] <= 968 && point[1] >= 0 && point[1] <= 644) << point;
    }
  }
  EXPECT_EQ(kinds.size(), 3u);
  for (const std::string& path : {"edges?photo=" + photo + "&solution=1", std::string("edges"),
                                  std::string("edges?photo=99&solution=2")}) {
    EXPECT_EQ(Get(path).status, 422) << path;
  }
}

TEST_F(PickPage, ManyRequestsAtOnceAllGetTheirAnswer) {
  ASSERT_EQ(Put(1, ToJson(TruePicks(6))).status, 200);
  const std::string photo = std::to_string(ThePickRoom().clicked_photo());
  std::atomic<int> odd{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 6; ++i) {
        const std::string solution = std::to_string(session_->Now()->solution_number);
        const int status[] = {
            Get("tile?back=" + photo + "&scan=0&level=1&x=0&y=0&solution=" + solution).status,
            Get("edges?photo=" + photo + "&solution=" + solution).status,
            Get("tile?scan=0&picture=local&level=0&x=1&y=0").status,
            Get("state").status,
        };
        // What the picks have overtaken is refused, nothing fails.
        odd += status[0] != 200 && status[0] != 404;
        odd += status[1] != 200 && status[1] != 422;
        odd += status[2] != 200;
        odd += status[3] != 200;
        if (t == 0) odd += Put(2 + i, ToJson(TruePicks(4 + i % 3))).status != 200;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(odd, 0);
  EXPECT_EQ(session_->Now()->revision, 8);
  EXPECT_EQ(ReadPicks(picks_path_).size(), 6u);
}

// The same room as a mesh without a grid beside the scan: a page with two scans.
TEST(PickScene, TakesAMeshAndSeveralScans) {
  const TempFolder folder;
  const Scan& scan = ThePickRoom().scene().scans()[0];
  WriteScan(scan, BuildScanMesh(scan, ScanMeshOptions()), folder / "room.ply");
  WriteBytes(folder / "poses.txt", "room.rtpi 1 0 0 0 0 0 0\nroom.ply 1 0 0 0 0 0 0\n");
  PickSceneInput input = ThePickRoom().input();
  input.scan_paths.push_back(folder / "room.ply");
  input.scan_poses = folder / "poses.txt";
  Progress progress(true);
  PickScene scene(input, &progress);
  ASSERT_EQ(scene.num_scans(), 2);
  EXPECT_FALSE(scene.scans()[1].organised);
  EXPECT_EQ(scene.places(1).width(), 2048);
  scene.Prepare();
  const auto never = [] { return false; };
  const ScanRays* rays = scene.WaitForRays(never);
  ASSERT_NE(scene.WaitForEdges(never), nullptr);
  const int photo = ThePickRoom().clicked_photo();
  const std::vector<SessionPick> truth = ThePickRoom().SmoothPicks(photo, 8);
  std::vector<SessionPick> picks = truth;
  int num_on_mesh = 0;
  for (SessionPick& pick : picks) {  // every other one on the mesh's picture
    const auto place = scene.places(1).PlaceOf(*pick.x_in_scan);
    if (!place || num_on_mesh == 4) continue;
    const ScanPlaces::Found found = scene.places(1).PointAt(*place);
    if (found.reason != ScanPlaces::Reason::kNone) continue;
    if (!((found.x_in_scan - *pick.x_in_scan).norm() < 0.003)) continue;  // hidden from there
    pick.x_in_scan = found.x_in_scan;
    pick.spot = ScanSpot{1, *place};
    ++num_on_mesh;
  }
  ASSERT_GE(num_on_mesh, 2);
  const PickSolution solution = PickSolver(scene).Solve(picks);
  EXPECT_LT(solution.photos.at(picks[0].image_name).rms_px, 1.0);
  EXPECT_THAT(solution.photos.at(picks[0].image_name).cam_from_scan,
              IsNearRigid(ThePickRoom().room().CamFromScan(photo), 5e-3, 5e-3));
  // The photo on the picture of the mesh.
  const Rigid cam_from_scan = ThePickRoom().room().CamFromScan(photo);
  const cv::Mat4b back =
      DrawBackProjection(scene, *rays, scene.photos()[photo], *scene.photos()[photo].projection,
                         cam_from_scan, 1, [] { return false; });
  ASSERT_EQ(back.size(), cv::Size(2048, 1024));
  int seen = 0;
  for (const cv::Vec4b& color : back) seen += color[3] != 0;
  EXPECT_GT(seen, 20000);
  EXPECT_LT(seen, 1024 * 2048 / 3);
  EXPECT_TRUE(DrawBackProjection(scene, *rays, scene.photos()[photo],
                                 *scene.photos()[photo].projection, cam_from_scan, 1,
                                 [] { return true; })
                  .empty());
}

}  // namespace
}  // namespace roomtex
