// roomtex-mapper as users call it, with the installed COLMAP.

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "colmap_ext/initializer.h"
#include "colmap_ext/sparse_model.h"
#include "tests/colmap_ext/mapper_scene.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using Scene = SimulatedViewsOptions::Scene;

TEST_F(MapperCommand, RegistersEveryPhotoOfARoomNearTheTruth) {
  SimulatedViewsOptions options = RoomOptions(7);
  options.two_cameras = true;
  Simulate(options);
  const std::string before = ReadBytes(folder_ / "database.db");
  const auto time_before = fs::last_write_time(folder_ / "database.db");
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("7 of 7"), std::string::npos) << result.out;

  const SparseModel model = ReadSparseModel(folder_ / "sparse/0");
  EXPECT_EQ(model.images.size(), 7u);
  ExpectNearTruth(model, 0.02, 0.01);
  const nlohmann::json report = Report();
  EXPECT_EQ(report["num_reg_images"], 7);
  EXPECT_EQ(report["num_images"], 7);
  EXPECT_EQ(report["num_points"], model.points.size());
  EXPECT_EQ(report["pairs_tried"], 1);
  EXPECT_EQ(report["pair"].size(), 2u);
  EXPECT_FALSE(report["degenerate"].get<bool>());
  EXPECT_TRUE(report["trusted"].get<bool>());
  EXPECT_GE(report["check"]["num_pairs"].get<int>(), 3);
  EXPECT_TRUE(report["check"]["contradicting"].empty());
  EXPECT_GT(report["num_f_inliers"].get<int>(), report["num_h_inliers"].get<int>());
  EXPECT_GT(report["mean_reprojection_error_px"].get<double>(), 0.2);
  EXPECT_LT(report["mean_reprojection_error_px"].get<double>(), 0.9);

  // The two-view model holds the pair of the report, with points.
  const SparseModel init = ReadSparseModel(folder_ / "sparse/init");
  ASSERT_EQ(init.images.size(), 2u);
  EXPECT_GT(init.points.size(), 50u);
  for (const auto& name : report["pair"]) {
    EXPECT_NE(init.FindImage(name.get<std::string>()), nullptr);
  }
  // Intrinsics stay as they were, the user's database byte for byte.
  for (const auto& [camera_id, camera] : model.cameras) {
    EXPECT_EQ(camera.params, views_.cameras.at(camera_id).params);
  }
  EXPECT_EQ(ReadBytes(folder_ / "database.db"), before);
  EXPECT_EQ(fs::last_write_time(folder_ / "database.db"), time_before);
  EXPECT_FALSE(fs::exists(folder_ / "database.db-wal"));
  ExpectNoScratch();
}

TEST_F(MapperCommand, IsRightBeforeAWall) {
  SimulatedViewsOptions options;
  options.scene = Scene::kWall;
  options.num_views = 5;
  options.random_seed = 3;
  Simulate(options);
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(Report()["degenerate"].get<bool>());
  const SparseModel model = ReadSparseModel(folder_ / "sparse/0");
  EXPECT_EQ(model.images.size(), 5u);
  ExpectNearTruth(model, 0.05, 0.02);
}

TEST_F(MapperCommand, MapsTwoPhotosOfARoom) {
  Simulate(RoomOptions(2));
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const SparseModel model = ReadSparseModel(folder_ / "sparse/0");
  ASSERT_EQ(model.images.size(), 2u);
  EXPECT_GT(model.points.size(), 100u);
  const Rigid found =
      model.images.at(2).cam_from_model * model.images.at(1).cam_from_model.Inverse();
  const Rigid truth = views_.TrueRelativePose(1, 2);
  EXPECT_LT(RotationAngle(found.rotation, truth.rotation), 0.01);
  EXPECT_LT(BaselineAngle(found.translation, truth.translation), 0.05);
}

TEST_F(MapperCommand, SaysThatTwoPhotosOfAWallAreAmbiguous) {
  SimulatedViewsOptions options;
  options.scene = Scene::kWall;
  for (options.random_seed = 0; options.random_seed < 3; ++options.random_seed) {
    fs::remove(folder_ / "database.db");
    Simulate(options);
    const CommandResult result = Run();
    EXPECT_EQ(result.exit_code, 4) << result.err;
    EXPECT_NE(result.err.find("planar-ambiguous: view_000.jpg and view_001.jpg"), std::string::npos)
        << result.err;
    EXPECT_NE(result.err.find("Add a photo that"), std::string::npos) << result.err;
    EXPECT_FALSE(Report()["trusted"].get<bool>());
    EXPECT_EQ(Report()["init"]["num_third_views"], 0);
  }
}

TEST_F(MapperCommand, DoesNotTrustABentModel) {
  Simulate(RoomOptions(5));
  SparseModel bent;  // what COLMAP's last step is made to give: the photos turn more and more
  bent.cameras = views_.cameras;
  for (const auto& [image_id, image] : views_.images) {
    Rigid bend;
    bend.rotation = Eigen::AngleAxisd(0.12 * image_id, Eigen::Vector3d::UnitY());
    SparseImage& entry = bent.images[image_id];
    entry.image_id = image_id;
    entry.camera_id = image.camera_id;
    entry.name = image.name;
    entry.cam_from_model = bend * views_.cam_from_scene.at(image_id);
  }
  WriteSparseModel(bent, folder_ / "bent");
  WriteScript("colmap-bends",
              "if [ \"$1\" = bundle_adjuster ] && [ \"$2\" != -h ]; then\n"
              "  while [ \"$1\" != --output_path ]; do shift; done\n"
              "  cp " +
                  (folder_ / "bent") + "/* \"$2\"; exit 0\nfi\nexec colmap \"$@\"\n");
  const CommandResult result = Run("--colmap " + (folder_ / "colmap-bends"));
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_NE(result.err.find("contradicted by its own photos"), std::string::npos) << result.err;
  EXPECT_FALSE(Report()["check"]["contradicting"].empty());
}

// A photo of another room with the same pictures on the walls: some of its matches put it here, the
// others there. Wherever it was registered, the rest of its matches disobeys.
SimulatedViews WithStranger(SimulatedViews views, uint32_t stranger, double times = 1) {
  const CameraProjection projection(views.cameras.at(1));
  Rigid elsewhere = views.cam_from_scene.at(stranger);
  elsewhere.translation += times * Eigen::Vector3d(0.35, -0.2, 0.3);
  std::vector<Eigen::Vector2d>& keypoints = views.keypoints.at(stranger);
  for (size_t row = 0; row < keypoints.size(); ++row) {
    const int point = views.point_of_keypoint.at(stranger)[row];
    if (point < 0 || point % 5 > 1) continue;
    const auto img = projection.ImgFromCam(elsewhere * views.points_in_scene[point]);
    if (img) keypoints[row] = *img;
  }
  return views;
}

TEST_F(MapperCommand, LeavesOutAPhotoThatItsOwnMatchesContradict) {
  const uint32_t stranger = 5;
  views_ = WithStranger(SimulateViews(RoomOptions(8)), stranger);
  WriteSimulatedDatabase(views_, folder_.path());
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string name = views_.images.at(stranger).name;
  EXPECT_NE(result.err.find(name + " is left out"), std::string::npos) << result.err;
  const SparseModel model = ReadSparseModel(folder_ / "sparse/0");
  EXPECT_EQ(model.images.size(), 7u);
  EXPECT_EQ(model.FindImage(name), nullptr);
  ExpectNearTruth(model, 0.02, 0.01);
  const nlohmann::json report = Report();
  EXPECT_EQ(report["num_reg_images"], 7);
  for (const auto& image : report["images"]) {
    EXPECT_EQ(image["registered"].get<bool>(), image["name"] != name);
    if (image["name"] != name) continue;
    EXPECT_NE(image["reason"].get<std::string>().find("of its own matches"), std::string::npos);
  }
}

// Of six photos one may be left out. Another is in doubt as long as the first is there: most of its
// matches are with that one.
TEST_F(MapperCommand, ThePhotoThatPutsAnotherInDoubtGoesFirst) {
  const uint32_t stranger = 5, neighbor = 4;
  views_ = WithStranger(SimulateViews(RoomOptions(6)), stranger);
  for (DatabasePair& pair : views_.pairs) {
    const std::set<uint32_t> both = {pair.image_id1, pair.image_id2};
    if (both.count(neighbor) == 0 || both.count(stranger) > 0) continue;
    pair.matches.resize(pair.matches.size() / 10);
  }
  WriteSimulatedDatabase(views_, folder_.path());
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const SparseModel model = ReadSparseModel(folder_ / "sparse/0");
  EXPECT_EQ(model.images.size(), 5u);
  EXPECT_EQ(model.images.count(stranger), 0u);
  ExpectNearTruth(model, 0.02, 0.01);
}

// Of six with two strangers one may be left out: nobody knows which are right, and all stay.
TEST_F(MapperCommand, WhereTooManyPhotosAreInDoubtAllStay) {
  views_ = WithStranger(WithStranger(SimulateViews(RoomOptions(6)), 5), 2, -1);
  WriteSimulatedDatabase(views_, folder_.path());
  const CommandResult result = Run();
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_THAT(result.err, testing::Not(testing::HasSubstr("is left out")));
  EXPECT_EQ(Report()["num_reg_images"], 6);
  EXPECT_GT(Report()["check"]["doubtful_images"].size(), 1u);
}

// Before a wall poses and points take up a wrong lens, and the model is bent.
TEST_F(MapperCommand, SaysThatTheCalibrationDoesNotFit) {
  SimulatedViewsOptions options;
  options.scene = Scene::kWall;
  options.num_views = 6;
  options.distortion = true;
  views_ = SimulateViews(options);
  const Camera lens = views_.cameras.at(1);
  views_.cameras.at(1).model = CameraModel::kPinhole;  // the database knows nothing of k1
  views_.cameras.at(1).params.resize(4);
  WriteSimulatedDatabase(views_, folder_.path());
  CommandResult result = Run("--refine_intrinsics 0");
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_NE(result.err.find("calibration does not fit"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("--refine_intrinsics auto"), std::string::npos) << result.err;
  const nlohmann::json check = Report()["check"]["calibration"];
  EXPECT_LT(check["rms_free_px"].get<double>(), 0.8 * check["rms_fixed_px"].get<double>());

  fs::remove(folder_ / "database.db");
  views_.cameras.at(1) = lens;
  WriteSimulatedDatabase(views_, folder_.path());
  result = Run();
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json right = Report()["check"]["calibration"];
  EXPECT_GT(right["rms_free_px"].get<double>(), 0.97 * right["rms_fixed_px"].get<double>());
}

TEST_F(MapperCommand, SaysWhenFewerThanHalfOfThePhotosRegister) {
  Simulate(RoomOptions(4));
  {  // five photos that nothing is known of
    SQLite::Database database(folder_ / "database.db", SQLite::OPEN_READWRITE);
    for (int k = 0; k < 5; ++k) {
      const std::string name = "lonely_" + std::to_string(k) + ".jpg";
      database.exec("INSERT INTO images (name, camera_id) VALUES ('" + name + "', 1)");
      WriteBytes(folder_ / ("photos/" + name), "");
    }
  }
  const CommandResult result = Run("--Init.max_pairs 1");
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_NE(result.err.find("only 4 of 9 photos"), std::string::npos) << result.err;
  // All that can be mapped are in the seed: it has not failed.
  EXPECT_EQ(result.err.find("starting from"), std::string::npos) << result.err;
  EXPECT_EQ(Report()["pair_trials"][0]["outcome"], "4 photos registered, all of them of the seed");
  EXPECT_EQ(ReadSparseModel(folder_ / "sparse/0").images.size(), 4u);
}

TEST_F(MapperCommand, TriesTheNextPairWhenTheMapperFails) {
  Simulate(RoomOptions(5));
  WriteScript("colmap-once-broken", "if [ \"$1\" = mapper ] && [ \"$2\" != -h ] && [ ! -e " +
                                        (folder_ / "failed") + " ]; then touch " +
                                        (folder_ / "failed") +
                                        "; echo out of luck; exit 1; fi\nexec colmap \"$@\"\n");
  const CommandResult result =
      Run("--Init.max_third_views 1 --colmap " + (folder_ / "colmap-once-broken"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.err.find("out of luck"), std::string::npos) << result.err;
  const nlohmann::json report = Report();
  EXPECT_EQ(report["pairs_tried"], 2);
  EXPECT_NE(report["pair_trials"][0]["pair"], report["pair_trials"][1]["pair"]);
  EXPECT_EQ(report["pair"], report["pair_trials"][1]["pair"]);
  EXPECT_EQ(report["num_reg_images"], 5);
  ExpectNearTruth(ReadSparseModel(folder_ / "sparse/0"), 0.02, 0.01);
}

TEST_F(MapperCommand, LeavesTheOldModelWhenEveryPairFails) {
  Simulate(RoomOptions(3));
  fs::create_directories(folder_ / "sparse/0");
  WriteBytes(folder_ / "sparse/0/cameras.bin", "old");
  WriteScript("colmap-broken",
              "if [ \"$1\" = mapper ] && [ \"$2\" != -h ]; then echo out of luck; exit 1; fi\nexec "
              "colmap \"$@\"\n");
  const CommandResult result =
      Run("--Init.max_third_views 0 --colmap " + (folder_ / "colmap-broken"));
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_NE(result.err.find("out of luck"), std::string::npos) << result.err;
  EXPECT_EQ(ReadBytes(folder_ / "sparse/0/cameras.bin"), "old");
  EXPECT_FALSE(fs::exists(folder_ / "sparse/init"));
  EXPECT_NE(ReadBytes(folder_ / "sparse/roomtex-mapper.log").find("out of luck"),
            std::string::npos);
  ExpectNoScratch();
}

TEST_F(MapperCommand, SaysWhyColmapAborts) {
  Simulate(RoomOptions(3));
  WriteScript("colmap-aborts",
              "if [ \"$1\" = point_triangulator ] && [ \"$2\" != -h ]; then\n"
              "  echo 'Check failed: sense > nonsense'; echo '*** Check failure stack trace: ***'\n"
              "  for i in 1 2 3 4 5 6 7 8 9 10 11 12; do echo '    @ 0x7fe6 Fail()'; done\n"
              "  kill -6 $$\nfi\nexec colmap \"$@\"\n");
  const CommandResult result = Run("--colmap " + (folder_ / "colmap-aborts"));
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_NE(result.err.find("its last lines: Check failed: sense > nonsense (all"),
            std::string::npos)
      << result.err;
  EXPECT_EQ(result.err.find("ulimit"), std::string::npos) << result.err;
}

TEST_F(MapperCommand, ACameraModelThatColmapDoesNotKnowIsSaidBeforeAnythingIsTried) {
  views_ = SimulateViews(RoomOptions(3));
  Camera& camera = views_.cameras.at(1);
  camera.model = CameraModel::kEucm;
  camera.params = {camera.params[0], camera.params[1], camera.params[2], camera.params[3], 0.6, 1};
  WriteSimulatedDatabase(views_, folder_.path());
  WriteScript("colmap-3.8", "colmap \"$@\" | sed 's/^COLMAP [0-9.]*/COLMAP 3.8/'\n");
  const CommandResult result = Run("--colmap " + (folder_ / "colmap-3.8"));
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_NE(result.err.find("camera 1: is EUCM, which COLMAP 3.8 does not know"), std::string::npos)
      << result.err;
  EXPECT_NE(result.err.find("Name COLMAP 4.0 or newer by --colmap"), std::string::npos)
      << result.err;
  EXPECT_EQ(result.err.find("signal"), std::string::npos) << result.err;
}

TEST_F(MapperCommand, ReplacesAnOldModelAsAWhole) {
  Simulate(RoomOptions(3));
  fs::create_directories(folder_ / "sparse/0");
  WriteBytes(folder_ / "sparse/0/rigs.bin", "old");
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_FALSE(fs::exists(folder_ / "sparse/0/rigs.bin"));
  EXPECT_EQ(ReadSparseModel(folder_ / "sparse/0").images.size(), 3u);
}

TEST_F(MapperCommand, RefusesToReplaceAFolderThatIsNoModel) {
  Simulate(RoomOptions(3));
  fs::create_directories(folder_ / "sparse/0");
  WriteBytes(folder_ / "sparse/0/thesis.tex", "years of work");
  const CommandResult result = Run();
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("thesis.tex"), std::string::npos) << result.err;
  EXPECT_EQ(ReadBytes(folder_ / "sparse/0/thesis.tex"), "years of work");
}

TEST_F(MapperCommand, HandsMapperOptionsOn) {
  Simulate(RoomOptions(3));
  ASSERT_EQ(Run().exit_code, 0);
  const nlohmann::json usual = Report();
  ASSERT_EQ(Run("--Mapper.filter_max_reproj_error 0.5").exit_code, 0);
  const nlohmann::json strict = Report();
  EXPECT_LT(strict["mean_reprojection_error_px"], 0.5);
  EXPECT_LT(strict["num_points"], usual["num_points"]);
}

TEST_F(MapperCommand, RefinesACalibrationThatThePhotosContradictUnlessForbidden) {
  SimulatedViewsOptions options = RoomOptions(6);
  options.distortion = false;
  views_ = SimulateViews(options);
  const double true_f = views_.cameras.at(1).params[0];
  SimulatedViews wrong = views_;  // the database believes a focal length 3 % off
  wrong.cameras.at(1).params[0] = wrong.cameras.at(1).params[1] = 1.03 * true_f;
  WriteSimulatedDatabase(wrong, folder_.path());
  ASSERT_EQ(Run("--refine_intrinsics 0").exit_code % 4, 0);  // trusted or not
  EXPECT_EQ(ReadSparseModel(folder_ / "sparse/0").cameras.at(1).params[0], 1.03 * true_f);
  EXPECT_FALSE(Report()["refined_intrinsics"]);
  for (const std::string refine : {"1", "auto"}) {
    const CommandResult result = Run("--refine_intrinsics " + refine);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NEAR(ReadSparseModel(folder_ / "sparse/0").cameras.at(1).params[0], true_f,
                0.003 * true_f);
    EXPECT_TRUE(Report()["refined_intrinsics"]);
    if (refine == "auto") {
      EXPECT_NE(result.err.find("standard deviations"), std::string::npos) << result.err;
    }
  }
  // What it thinks of the model stands beside it, and the model can be replaced.
  EXPECT_TRUE(fs::exists(folder_ / "sparse/0/roomtex-mapper.json"));
}

// COLMAP gives every photo a camera of its own unless told otherwise.
TEST_F(MapperCommand, PhotosThatAreToldTheSameShareALens) {
  views_ = SimulateViews(RoomOptions(6));
  const Camera camera = views_.cameras.at(1);
  for (auto& [image_id, image] : views_.images) {
    image.camera_id = 10 + image_id;
    views_.cameras[image.camera_id] = camera;
    views_.cameras[image.camera_id].camera_id = image.camera_id;
    views_.cameras[image.camera_id].has_prior_focal_length = false;
  }
  views_.cameras.erase(1);
  WriteSimulatedDatabase(views_, folder_.path());
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const SparseModel model = ReadSparseModel(folder_ / "sparse/0");
  ASSERT_EQ(model.cameras.size(), 6u);
  for (const auto& [image_id, image] : model.images) {
    EXPECT_EQ(image.camera_id, 10 + image_id);
    EXPECT_EQ(model.cameras.at(image.camera_id).params, model.cameras.begin()->second.params);
  }
}

TEST_F(MapperCommand, GivesTheSameTwice) {
  Simulate(RoomOptions(5));
  ASSERT_EQ(Run("--num_threads 1").exit_code, 0);
  const SparseModel once = ReadSparseModel(folder_ / "sparse/0");
  const std::string init_once = ReadBytes(folder_ / "sparse/init/points3D.bin");
  ASSERT_EQ(Run("--num_threads 2").exit_code, 0);
  const SparseModel again = ReadSparseModel(folder_ / "sparse/0");
  EXPECT_EQ(ReadBytes(folder_ / "sparse/init/points3D.bin"), init_once);
  ASSERT_EQ(once.points.size(), again.points.size());
  for (const auto& [image_id, image] : once.images) {
    EXPECT_THAT(image.cam_from_model,
                IsNearRigid(again.images.at(image_id).cam_from_model, 1e-7, 1e-7));
  }
}

TEST_F(MapperCommand, RefusesOptionsThatColmapDoesNotKnow) {
  Simulate(RoomOptions(3));
  CommandResult result = Run("--Mapper.no_such_option 1");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("--Mapper.no_such_option is not an option of colmap mapper"),
            std::string::npos)
      << result.err;
  result = Run("--Mapper.multiple_models 1");
  EXPECT_EQ(result.exit_code, 2);
  result = Run("--Mapper.min_num_matches many");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("min_num_matches"), std::string::npos) << result.err;
  result = Run("--Mapper.abs_pose_min_num_inliers -5");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("refuses: Check failed: abs_pose_min_num_inliers > 0"),
            std::string::npos)
      << result.err;
  EXPECT_FALSE(fs::exists(folder_ / "sparse/0"));
  ExpectNoScratch();
}

TEST_F(MapperCommand, ListsEveryBadInitOption) {
  Simulate(RoomOptions(3));
  const CommandResult result = Run("--Init.min_num_inliers 2 --Init.min_tri_angle_deg -1");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("--Init.min_num_inliers"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("--Init.min_tri_angle_deg"), std::string::npos) << result.err;
}

TEST_F(MapperCommand, SaysWhatIsWrongWithTheDatabase) {
  CommandResult result = Run();  // nothing there at all
  EXPECT_EQ(result.exit_code, 3);
  Simulate(RoomOptions(3), /*with_pairs=*/false);
  result = Run();
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("exhaustive_matcher"), std::string::npos) << result.err;
  EXPECT_FALSE(fs::exists(folder_ / "sparse")) << "nothing was to be written";

  fs::remove(folder_ / "database.db");
  DatabaseMaker(folder_ / "database.db", DatabaseMaker::Schema::k38);
  result = Run();
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("holds no images"), std::string::npos) << result.err;
}

TEST_F(MapperCommand, SaysWhichPhotoIsMissing) {
  Simulate(RoomOptions(3));
  fs::remove(folder_ / "photos/view_001.jpg");
  CommandResult result = Run();
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("view_001.jpg"), std::string::npos) << result.err;
  fs::remove_all(folder_ / "photos");
  result = Run();
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("photos: does not exist"), std::string::npos) << result.err;
}

TEST_F(MapperCommand, SaysThatAnInitialPhotoIsUnknownOrAPairTooThin) {
  Simulate(RoomOptions(3));
  CommandResult result = Run("--Init.image_name1 nobody.jpg");
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("holds no image nobody.jpg"), std::string::npos) << result.err;
  result = Run("--Init.min_num_inliers 100000");
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("no pair to start from"), std::string::npos) << result.err;
}

TEST_F(MapperCommand, RefusesAnOutputThatCannotBeWritten) {
  Simulate(RoomOptions(3));
  const CommandResult among = RunCommandLine(
      "roomtex-mapper --database_path " + (folder_ / "database.db") + " --image_path " +
      (folder_ / "photos") + " --output_path " + (folder_ / "photos/sparse"));
  EXPECT_EQ(among.exit_code, 2);
  EXPECT_NE(among.err.find("lies in the folder of the photos"), std::string::npos) << among.err;
  WriteBytes(folder_ / "sparse", "a file");
  const CommandResult result = Run();
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("is a file"), std::string::npos) << result.err;
}

TEST_F(MapperCommand, WarnsOfACameraWithoutPriorFocalLengthThatIsNotRefined) {
  SimulatedViewsOptions options = RoomOptions(3);
  Simulate(options);
  SQLite::Database(folder_ / "database.db", SQLite::OPEN_READWRITE)
      .exec("UPDATE cameras SET prior_focal_length = 0");
  const CommandResult result = Run("--refine_intrinsics 0");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  ASSERT_EQ(Report()["warnings"].size(), 1u);
  EXPECT_NE(Report()["warnings"][0].get<std::string>().find("prior_focal_length"),
            std::string::npos);
}

TEST_F(MapperCommand, SaysThatColmapIsNotThere) {
  Simulate(RoomOptions(3));
  CommandResult result = Run("--colmap /nowhere/colmap");
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("/nowhere/colmap: does not exist"), std::string::npos) << result.err;
  result = Run("--colmap no-such-program");
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("is not on the PATH"), std::string::npos) << result.err;
  result = Run("--colmap true");  // a program, but not this one
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("as COLMAP does"), std::string::npos) << result.err;
  ExpectNoScratch();
}

bool ProcessLives(pid_t pid) {
  const std::string status = ReadBytes("/proc/" + std::to_string(pid) + "/stat");
  return !status.empty() && status.find(") Z") == std::string::npos;
}

// Waits up to ten seconds.
template <typename Condition>
bool WaitFor(const Condition& condition) {
  for (int i = 0; i < 1000 && !condition(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return condition();
}

TEST_F(MapperCommand, KillsColmapAndTidiesUpWhenStopped) {
  Simulate(RoomOptions(5));
  const std::string pid_path = folder_ / "pid";
  WriteScript("colmap-slow",
              "if [ \"$1\" = mapper ] && [ \"$2\" != -h ]; then sleep 100 & echo $! >" + pid_path +
                  ".new; mv " + pid_path + ".new " + pid_path + "; wait; fi\nexec colmap \"$@\"\n");
  for (const int signal : {SIGTERM, SIGINT}) {
    fs::remove(pid_path);
    const pid_t command = fork();
    if (command == 0) {
      ::signal(SIGINT, SIG_DFL);  // ignored when the tests run in the background
      const std::string line = "exec " + BinFolder() + "/" + Arguments() +
                               "--quiet --Init.max_third_views 1 --colmap " +
                               (folder_ / "colmap-slow") + " 2>" + (folder_ / "said");
      execl("/bin/sh", "sh", "-c", line.c_str(), nullptr);
      _exit(127);
    }
    ASSERT_TRUE(WaitFor([&] { return fs::exists(pid_path); }));
    const pid_t sleeper = std::stoi(ReadBytes(pid_path));
    EXPECT_TRUE(ProcessLives(sleeper));
    kill(command, signal);
    int status = 0;
    ASSERT_EQ(waitpid(command, &status, 0), command);
    EXPECT_TRUE(WIFSIGNALED(status)) << "exit code " << WEXITSTATUS(status);
    EXPECT_EQ(WTERMSIG(status), signal);
    EXPECT_TRUE(WaitFor([&] { return !ProcessLives(sleeper); }));
    EXPECT_FALSE(fs::exists(folder_ / "sparse/0"));
    const std::string said = ReadBytes(folder_ / "said");
    EXPECT_NE(said.find("unchanged, but for the log " + (folder_ / "sparse/roomtex-mapper.log")),
              std::string::npos)
        << said;
    ExpectNoScratch();
  }
}

}  // namespace
}  // namespace roomtex
