// roomtex-mapper on photos of several rooms: models of their own.

#include <algorithm>
#include <filesystem>

#include "tests/colmap_ext/lookalike_views.h"
#include "tests/colmap_ext/mapper_scene.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

class MapperModels : public MapperCommand {
 protected:
  // Photos up to `last_of_first`, and the rest, that no pair connects.
  void Separate(uint32_t last_of_first) {
    views_.pairs.erase(std::remove_if(views_.pairs.begin(), views_.pairs.end(),
                                      [&](const DatabasePair& pair) {
                                        return (pair.image_id1 <= last_of_first) !=
                                               (pair.image_id2 <= last_of_first);
                                      }),
                       views_.pairs.end());
    fs::remove(folder_ / "database.db");
    WriteSimulatedDatabase(views_, folder_.path());
  }
  void SimulateRoom(int num_views) {
    SimulatedViewsOptions options = RoomOptions(num_views);
    options.baseline = 0.2;
    views_ = SimulateViews(options);
  }
  SparseModel Model(int number) const {
    return ReadSparseModel(folder_ / ("sparse/" + std::to_string(number)));
  }
};

// The models appear with the report, and so does what is told of them.
TEST_F(MapperModels, NothingIsSaidOfThoseThatAreNotWritten) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "this system has no /dev/full";
  Simulate(RoomOptions(4));
  const std::string database = folder_ / "database.db", photos = folder_ / "photos";
  const CommandResult result =
      RunCommandLine("roomtex-mapper --database_path " + database + " --image_path " + photos +
                     " --output_path " + (folder_ / "sparse") + " --report_path /dev/full");
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_FALSE(fs::exists(folder_ / "sparse/0"));
  EXPECT_EQ(result.out, "");
}

// Matching puts them into one model, as the same furniture stands in both.
TEST_F(MapperModels, GivesRoomsThatAreAlikeModelsOfTheirOwn) {
  SimulatedViewsOptions options = RoomOptions(13);
  options.num_points = 1500;
  options.baseline = 0.1;
  views_ = SimulateViews(options);
  const auto room_of = [](uint32_t id) { return id % 3 == 0 ? 2 : 1; };
  ShowLookalikeRooms(
      room_of, [](const Eigen::Vector3d& x) { return x.x() > 0; }, &views_);
  WriteSimulatedDatabase(views_, folder_.path());
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.err.find("2 rooms that are alike"), std::string::npos) << result.err;
  for (const int room : {1, 2}) {
    const SparseModel model = ReadSparseModel(folder_ / ("sparse/" + std::to_string(room - 1)));
    EXPECT_EQ(model.images.size(), room == 1 ? 9u : 4u);
    for (const auto& [id, image] : model.images) EXPECT_EQ(room_of(id), room) << image.name;
    ExpectNearTruth(model, 0.01, 0.01);
    const nlohmann::json rooms = Report()["rooms"]["models"];
    EXPECT_EQ(rooms[static_cast<size_t>(room - 1)]["images"].size(), model.images.size());
    EXPECT_EQ(rooms[static_cast<size_t>(room - 1)]["num_points"], model.points.size());
  }
  EXPECT_EQ(Report()["num_reg_images"], 9);
  EXPECT_EQ(Report()["images"][2]["registered"], false);
  EXPECT_NE(Report()["images"][2]["reason"].get<std::string>().find("model 1"), std::string::npos);
  const auto of_room = nlohmann::json::parse(ReadBytes(folder_ / "sparse/1/roomtex-mapper.json"));
  EXPECT_GE(of_room["check"]["num_pairs"].get<int>(), 2) << of_room;
  EXPECT_TRUE(of_room["check"]["contradicting"].empty());
  EXPECT_TRUE(of_room["reasons"].empty());
  EXPECT_TRUE(of_room["is_alike"].get<bool>());
  EXPECT_TRUE(Report()["is_alike"].get<bool>());
  EXPECT_GT(Report()["images"][2]["match_support"].get<double>(), 0.9) << "by those of its room";
  ExpectNoScratch();

  EXPECT_THAT(result.out, HasSubstr("sparse/1: 4 of 13 photos, of another room that is alike"));

  // The next run takes its own rooms away, and leaves a copy that somebody made.
  fs::copy(folder_ / "sparse/0", folder_ / "sparse/2");
  ASSERT_EQ(Run("--Rooms.enabled 0").exit_code, 0);
  EXPECT_EQ(Report()["num_reg_images"], 13);
  EXPECT_FALSE(fs::exists(folder_ / "sparse/1"));
  EXPECT_TRUE(fs::exists(folder_ / "sparse/2/images.bin"));

  fs::remove(folder_ / "database.db");
  fs::remove_all(folder_ / "photos");
  Simulate(RoomOptions(7));
  ASSERT_EQ(Run().exit_code, 0);
  EXPECT_EQ(Report()["num_reg_images"], 7);
  EXPECT_EQ(Report().count("rooms"), 0u);
}

TEST_F(MapperModels, GivesPhotosThatNothingConnectsModelsOfTheirOwn) {
  SimulateRoom(12);
  Separate(5);
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string first = views_.images.at(1).name, last = views_.images.at(12).name;
  EXPECT_THAT(result.err, HasSubstr("make 2 models that too little connects"));
  EXPECT_THAT(result.err, HasSubstr("1 holds 5 photos, e.g. " + first));
  EXPECT_THAT(result.out, HasSubstr("sparse/1: 5 of 12 photos"));
  const nlohmann::json report = Report();
  EXPECT_EQ(report["num_reg_images"], 7);
  EXPECT_EQ(report["num_images"], 12);
  ASSERT_THAT(report["models"], SizeIs(2));
  for (const int number : {0, 1}) {
    const SparseModel model = Model(number);
    EXPECT_EQ(model.images.size(), number == 0 ? 7u : 5u);
    for (const auto& [id, image] : model.images) EXPECT_EQ(id > 5, number == 0) << image.name;
    ExpectNearTruth(model, 0.01, 0.01);
    const nlohmann::json one = report["models"][static_cast<size_t>(number)];
    EXPECT_EQ(one["num_reg_images"], model.images.size());
    EXPECT_EQ(one["num_points"], model.points.size());
    EXPECT_THAT(one["images"], Contains(number == 0 ? last : first));
    EXPECT_FALSE(one["is_alike"].get<bool>());
  }
  EXPECT_EQ(report["images"][0]["registered"], false);
  EXPECT_THAT(report["images"][0]["reason"].get<std::string>(), HasSubstr("model 1"));
  EXPECT_GT(report["images"][0]["match_support"].get<double>(), 0.9);
  const auto own = nlohmann::json::parse(ReadBytes(folder_ / "sparse/1/roomtex-mapper.json"));
  EXPECT_EQ(own["num_reg_images"], 5);
  EXPECT_GE(own["check"]["num_pairs"].get<int>(), 2);
  EXPECT_GT(own["check"]["calibration"]["rms_fixed_px"].get<double>(), 0.2);
  EXPECT_TRUE(own["reasons"].empty()) << own["reasons"];
  ExpectNoScratch();

  // One only, and the other is taken away, as it was made by an earlier run.
  const CommandResult one = Run("--Groups.enabled 0");
  EXPECT_EQ(one.exit_code, 0) << one.err;
  EXPECT_THAT(one.err, HasSubstr("2 groups that nothing connects"));
  EXPECT_THAT(one.err, HasSubstr("5 photos (e.g. " + first + ")"));
  EXPECT_EQ(Report().count("models"), 0u);
  EXPECT_FALSE(fs::exists(folder_ / "sparse/1"));
}

TEST_F(MapperModels, OfManyRoomsAllCount) {
  SimulateRoom(14);
  for (const uint32_t last : {4, 9}) Separate(last);
  const CommandResult result = Run();  // none of the rooms has half of the photos
  ASSERT_EQ(result.exit_code, 0) << result.err;
  ASSERT_THAT(Report()["models"], SizeIs(3));
  size_t num_photos = 0;
  for (const int number : {0, 1, 2}) {
    num_photos += Model(number).images.size();
    ExpectNearTruth(Model(number), 0.02, 0.02);
  }
  EXPECT_EQ(num_photos, 14u);
}

TEST_F(MapperModels, ThePairThatIsToldIsThatOfItsOwnGroup) {
  SimulateRoom(12);
  Separate(5);
  const std::string name1 = views_.images.at(2).name, name2 = views_.images.at(3).name;
  const CommandResult result = Run("--Init.image_name1 " + name1 + " --Init.image_name2 " + name2);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(Report()["models"], SizeIs(2));
  const nlohmann::json trials = Report()["pair_trials"];
  EXPECT_TRUE(std::any_of(trials.begin(), trials.end(), [&](const nlohmann::json& trial) {
    return trial["pair"] == nlohmann::json({name1, name2});
  })) << trials;
}

TEST_F(MapperModels, PhotosToStartFromThatNoGroupHoldsTogetherAreAnError) {
  SimulateRoom(12);
  Separate(5);
  const std::string names[] = {views_.images.at(2).name, views_.images.at(8).name};
  CommandResult result = Run("--Init.image_name1 " + names[0] + " --Init.image_name2 " + names[1]);
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_THAT(result.err, HasSubstr("no verified matches that connect " + names[0] +
                                    " (of a group of 5 photos, e.g. " + views_.images.at(1).name));
  EXPECT_THAT(result.err, HasSubstr(names[1] + " (of a group of 7 photos"));

  Separate(10);  // two photos alone
  const std::string lonely = views_.images.at(12).name;
  result = Run("--Init.image_name1 " + lonely);
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_THAT(result.err,
              HasSubstr(lonely + ": is connected by verified matches with fewer than 4"));
  EXPECT_FALSE(fs::exists(folder_ / "sparse/0"));
}

TEST_F(MapperModels, ThreePhotosAloneAreNoRoom) {
  SimulateRoom(12);
  Separate(9);
  ASSERT_EQ(Run().exit_code, 0);
  EXPECT_EQ(Report()["num_reg_images"], 9);
  EXPECT_TRUE(Report()["warnings"].empty()) << Report()["warnings"];
  EXPECT_TRUE(Report()["images"][10]["model"].is_null());
  EXPECT_FALSE(fs::exists(folder_ / "sparse/1"));
}

// Few photos tell a lens worse than many.
TEST_F(MapperModels, ALensThatOneGroupDeterminesIsTheOthersToo) {
  SimulateRoom(13);
  const double focal_length = views_.cameras.at(1).params[0];
  views_.cameras.at(1).has_prior_focal_length = false;
  for (const int k : {0, 1}) views_.cameras.at(1).params[static_cast<size_t>(k)] *= 1.1;
  Separate(8);
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json models = Report()["models"];
  ASSERT_THAT(models, SizeIs(2));
  EXPECT_TRUE(models[0]["refined_intrinsics"].get<bool>());
  EXPECT_FALSE(models[1]["refined_intrinsics"].get<bool>()) << "calibrated by the others";
  for (const int number : {0, 1}) {
    EXPECT_NEAR(Model(number).cameras.at(1).params[0], focal_length, 0.01 * focal_length);
  }
  ExpectNearTruth(Model(1), 0.02, 0.02);
}

TEST_F(MapperModels, WhatIsInTheWayIsFoundBeforeAnythingIsMapped) {
  SimulateRoom(10);
  Separate(5);
  fs::create_directories(folder_ / "sparse/1");
  WriteBytes(folder_ / "sparse/1/diary.txt", "mine");
  const CommandResult result = Run();
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_THAT(result.err, HasSubstr("sparse/1"));
  EXPECT_THAT(result.err, Not(HasSubstr("colmap mapper")));
  EXPECT_FALSE(fs::exists(folder_ / "sparse/0"));
  EXPECT_EQ(ReadBytes(folder_ / "sparse/1/diary.txt"), "mine");
}

// COLMAP may not reach all of a group, and rooms may be alike: that is known at the end only.
TEST_F(MapperModels, AlsoWhatMayComeToBeInTheWayIsFoundBefore) {
  Simulate(RoomOptions(8));
  fs::create_directories(folder_ / "sparse/1");
  WriteBytes(folder_ / "sparse/1/diary.txt", "mine");
  const CommandResult result = Run();
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_THAT(result.err, HasSubstr("sparse/1: holds diary.txt"));
  EXPECT_THAT(result.err, Not(HasSubstr("colmap mapper")));

  // Five photos make one model only.
  fs::remove(folder_ / "database.db");
  fs::remove_all(folder_ / "photos");
  Simulate(RoomOptions(5));
  EXPECT_EQ(Run().exit_code, 0);
  EXPECT_EQ(ReadBytes(folder_ / "sparse/1/diary.txt"), "mine");
}

}  // namespace
}  // namespace roomtex
