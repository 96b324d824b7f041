// roomtex-mapper on sets that COLMAP's own mapper leaves half of: view chaining end to end.

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "colmap_ext/sparse_model.h"
#include "tests/colmap_ext/lookalike_views.h"
#include "tests/colmap_ext/simulated_database.h"
#include "tests/colmap_ext/wall_sequence.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using Scene = SimulatedViewsOptions::Scene;

class ChainingCommand : public ::testing::Test {
 protected:
  CommandResult Run(const SimulatedViews& views, const std::string& more = "") {
    std::filesystem::remove(folder_ / "database.db");
    WriteSimulatedDatabase(views, folder_.path());
    return RunCommandLine("roomtex-mapper --database_path " + (folder_ / "database.db") +
                          " --image_path " + (folder_ / "photos") + " --output_path " +
                          (folder_ / "sparse") + " --report_path " + (folder_ / "report.json") +
                          " " + more);
  }
  nlohmann::json Report() const {
    return nlohmann::json::parse(ReadBytes(folder_ / "report.json"));
  }
  SparseModel Model() const { return ReadSparseModel(folder_ / "sparse/0"); }
  int Count(const std::string& by) const {
    const nlohmann::json report = Report();
    int count = 0;
    for (const auto& image : report["images"]) count += image["by"] == by ? 1 : 0;
    return count;
  }
  TempFolder folder_;
};

// Ascending, metres, after the best similarity onto the truth.
std::vector<double> CentreErrors(const SparseModel& model, const SimulatedViews& views) {
  Eigen::Matrix3Xd found(3, model.images.size()), truth(3, model.images.size());
  int column = 0;
  for (const auto& [image_id, image] : model.images) {
    found.col(column) = image.cam_from_model.TargetOriginInSource();
    truth.col(column++) = views.cam_from_scene.at(image_id).TargetOriginInSource();
  }
  const Similarity scene_from_model = FitSimilarity(found, truth);
  std::vector<double> errors;
  for (int i = 0; i < column; ++i) {
    errors.push_back((scene_from_model * Eigen::Vector3d(found.col(i)) - truth.col(i)).norm());
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

TEST_F(ChainingCommand, RegistersEightOfEightPhotosAlongAWallWithWeakTriples) {
  int num_chained = 0;
  for (const Scene scene : {Scene::kRelief, Scene::kWall}) {
    for (int seed = 0; seed < 3; ++seed) {
      SCOPED_TRACE(std::string(scene == Scene::kWall ? "wall " : "relief ") + std::to_string(seed));
      const SimulatedViews views = WeakWallSequence(scene, seed);
      const CommandResult result = Run(views);
      ASSERT_EQ(result.exit_code, 0) << result.err;
      const SparseModel model = Model();
      EXPECT_EQ(model.images.size(), 8u);
      const std::vector<double> errors = CentreErrors(model, views);
      EXPECT_LT(errors[errors.size() / 2], 0.02);
      EXPECT_LT(errors.back(), 0.06);
      num_chained += Count("chained");
    }
  }
  EXPECT_GE(num_chained, 6);
}

TEST_F(ChainingCommand, LeavesPhotosOutWhenToldToAndSaysWhy) {
  const SimulatedViews views = WeakWallSequence(Scene::kRelief, 0);
  const CommandResult result =
      Run(views, "--Chain.enabled 0 --Groups.enabled 0 --Init.max_pairs 1");
  EXPECT_EQ(Count("chained"), 0);
  const int num_left_out = Count("none");
  ASSERT_GT(num_left_out, 0) << result.err;
  EXPECT_EQ(Model().images.size(), 8u - num_left_out);
  const nlohmann::json report = Report();
  for (const auto& image : report["images"]) {
    if (image["by"] != "none") continue;
    EXPECT_NE(image["reason"].get<std::string>().find("--Chain.enabled 0"), std::string::npos);
  }
}

TEST_F(ChainingCommand, RejectsAPhotoWhoseTwoViewGeometryIsWrong) {
  const SimulatedViews views = WithGhostView(WeakWallSequence(Scene::kRelief, 1), 8);
  // Started elsewhere: most keypoints of the ghost are consistent with its neighbour's.
  const CommandResult result =
      Run(views, "--Init.image_name1 view_002.jpg --Chain.min_num_inliers 30");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const SparseModel model = Model();
  EXPECT_EQ(model.images.size(), 7u);
  EXPECT_EQ(model.images.count(8), 0u);
  EXPECT_LT(CentreErrors(model, views).back(), 0.06);
  const nlohmann::json report = Report();
  EXPECT_EQ(report["images"][7]["by"], "none");
  EXPECT_NE(report["images"][7]["reason"], "") << report["images"][7];
}

// Two cupboards of one make: what photos of one have in common with those of the other is enough
// for a chain, and too little for COLMAP's mapper. The photos of each see each other well.
SimulatedViews BeforeTwoCupboards(int random_seed) {
  SimulatedViewsOptions options;
  options.num_views = 12;
  options.num_points = 1500;
  options.baseline = 0.1;
  options.random_seed = random_seed;
  SimulatedViews views = SimulateViews(options);
  ShowLookalikeRooms([](uint32_t image_id) { return image_id <= 7 ? 1 : 2; },
                     [](const Eigen::Vector3d& x) { return x.norm() < 0.55; }, &views);
  return views;
}

TEST_F(ChainingCommand, PhotosOfOneCupboardAreNotPutBeforeAnotherOfItsMake) {
  for (const int seed : {0, 1}) {
    SCOPED_TRACE(seed);
    const SimulatedViews views = BeforeTwoCupboards(seed);
    for (const DatabasePair& pair : views.pairs) {
      if (pair.image_id1 <= 7 && pair.image_id2 > 7) {
        ASSERT_GE(pair.matches.size(), 20u);
        ASSERT_LE(pair.matches.size(), 29u);
      }
    }
    // What takes whole rooms apart afterwards is another test's.
    const CommandResult result = Run(views, "--Rooms.enabled 0");
    ASSERT_EQ(result.exit_code, 0) << result.err;
    std::map<int, std::set<bool>> cupboards;  // by model
    const nlohmann::json report = Report();
    for (const auto& image : report["images"]) {
      if (image.contains("model")) {
        cupboards[image["model"].get<int>()].insert(image["name"].get<std::string>() >= "view_007");
      }
    }
    EXPECT_EQ(cupboards.size(), 2u);
    for (const auto& [model, shown] : cupboards) EXPECT_EQ(shown.size(), 1u) << "model " << model;

    if (seed > 0) continue;
    // Not asked, the chain makes one model of both.
    Run(views, "--Rooms.enabled 0 --Chain.min_sight_share 0");
    EXPECT_EQ(Model().images.size(), 12u);
    EXPECT_GT(Count("chained"), 0);
  }
}

TEST_F(ChainingCommand, ListsEveryBadChainOption) {
  const CommandResult result = Run(WeakWallSequence(Scene::kRelief, 0),
                                   "--Chain.min_num_inliers 2 --Chain.max_scale_spread 0");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("--Chain.min_num_inliers"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("--Chain.max_scale_spread"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace roomtex
