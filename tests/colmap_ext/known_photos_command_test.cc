// roomtex-mapper with a scanner's own photos among the user's, with the installed COLMAP.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "colmap_ext/mapper_verdict.h"
#include "colmap_ext/sparse_model.h"
#include "tests/colmap_ext/simulated_database.h"
#include "tests/support/matchers.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

class KnownPhotosCommand : public testing::Test {
 protected:
  // Every other photo is the scanner's, by a camera of its own, of which the database knows
  // nothing.
  KnownPhotosCommand() {
    SimulatedViewsOptions options;
    options.num_views = 8;
    options.num_points = 600;
    options.baseline = 0.4;
    options.two_cameras = true;
    views_ = SimulateViews(options);
    scan_from_scene_ = {Eigen::Quaterniond(0.8, 0.1, -0.5, 0.3).normalized(), {412e3, 5.3e6, 110}};
    for (const auto& [id, image] : views_.images) {
      if (image.camera_id == 2) known_.images[id] = Told(id);
    }
    known_.cameras[1] = views_.cameras.at(2);
    known_.cameras[1].camera_id = 1;
    views_.cameras.at(2).params[0] = views_.cameras.at(2).params[1] *= 1.3;
    views_.cameras.at(2).has_prior_focal_length = false;
  }

  Rigid CamFromScan(uint32_t id) const {
    return views_.cam_from_scene.at(id) * scan_from_scene_.Inverse();
  }
  SparseImage Told(uint32_t id) const {
    SparseImage image;
    image.image_id = 100 + id;  // ids are another model's
    image.camera_id = 1;
    image.name = views_.images.at(id).name;
    image.cam_from_model = CamFromScan(id);
    return image;
  }
  CommandResult Run(const std::string& more = "") {
    SparseModel known = known_;
    known.images.clear();
    for (const auto& [id, image] : known_.images) known.images[image.image_id] = image;
    WriteSparseModel(known, folder_ / "known");
    std::filesystem::remove(folder_ / "database.db");
    WriteSimulatedDatabase(views_, folder_.path());
    return RunCommandLine("roomtex-mapper --database_path " + (folder_ / "database.db") +
                          " --image_path " + (folder_ / "photos") + " --output_path " +
                          (folder_ / "sparse") + " --known_path " + (folder_ / "known") +
                          " --report_path " + (folder_ / "report.json") + " " + more);
  }
  SparseModel Model() const { return ReadSparseModel(folder_ / "sparse/0"); }
  nlohmann::json Report() const {
    return nlohmann::json::parse(ReadBytes(folder_ / "report.json"));
  }
  // In the scan's frame itself, without a similarity.
  void ExpectNearTruth(const SparseModel& model, double metres) const {
    for (const auto& [id, image] : model.images) {
      const Rigid truth = CamFromScan(id);
      EXPECT_LE((image.cam_from_model.TargetOriginInSource() - truth.TargetOriginInSource()).norm(),
                metres)
          << image.name;
      EXPECT_LE(RotationAngle(image.cam_from_model.rotation, truth.rotation), metres) << image.name;
    }
  }

  TempFolder folder_;
  SimulatedViews views_;
  Rigid scan_from_scene_;
  SparseModel known_;
};

TEST_F(KnownPhotosCommand, PutTheModelWhereTheyStand) {
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const SparseModel model = Model();
  ASSERT_EQ(model.images.size(), 8u);
  ExpectNearTruth(model, 0.005);
  for (const auto& [id, image] : known_.images) {
    EXPECT_THAT(model.images.at(id).cam_from_model, IsNearRigid(image.cam_from_model, 1e-9, 1e-6));
    EXPECT_EQ(model.cameras.at(model.images.at(id).camera_id).params, known_.cameras.at(1).params);
  }
  const nlohmann::json known = Report()["known"];
  EXPECT_TRUE(known["placed"]);
  EXPECT_TRUE(known["held"]);
  EXPECT_EQ(known["num_agreeing"], 4);
  EXPECT_LT(known["position_rms_m"], 0.005);
  ASSERT_TRUE(ReadMapperVerdict(folder_ / "sparse/0", model).known_rms);
}

TEST_F(KnownPhotosCommand, PutEveryGroupWhereTheyStand) {
  views_.pairs.erase(std::remove_if(views_.pairs.begin(), views_.pairs.end(),
                                    [](const DatabasePair& pair) {
                                      return (pair.image_id1 <= 4) != (pair.image_id2 <= 4);
                                    }),
                     views_.pairs.end());
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  std::set<uint32_t> photos;
  for (const char* name : {"sparse/0", "sparse/1"}) {
    const SparseModel model = ReadSparseModel(folder_ / name);
    ASSERT_EQ(model.images.size(), 4u);
    for (const auto& [id, image] : model.images) photos.insert(id);
    ExpectNearTruth(model, 0.02);
    EXPECT_TRUE(ReadMapperVerdict(folder_ / name, model).known_rms) << name;
  }
  EXPECT_EQ(photos.size(), 8u);
}

TEST_F(KnownPhotosCommand, OneThatIsToldWronglyIsNamed) {
  known_.images.at(4).cam_from_model.translation += Eigen::Vector3d(0.8, 0, 0);
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("were not taken where --known_path has them, as the others "
                                    "tell: view_003.jpg"));
  ExpectNearTruth(Model(), 0.005);
  EXPECT_THAT(Report()["known"]["contradicting"], ElementsAre("view_003.jpg"));
}

TEST_F(KnownPhotosCommand, OneThatIsRoughIsAdjusted) {
  known_.images.at(6).cam_from_model.translation += Eigen::Vector3d(0.04, 0.03, 0);
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(Report()["known"]["rough"], ElementsAre("view_005.jpg"));
  EXPECT_TRUE(Report()["known"]["held"]);
  ExpectNearTruth(Model(), 0.005);
}

// Poses of a handheld scanner, good to a few centimetres: holding them would bend the rest.
TEST_F(KnownPhotosCommand, PosesThatAreRoughMoveTheModelAndNoMore) {
  for (auto& [id, image] : known_.images) {
    const Eigen::Vector3d shift(0.03 * std::cos(2.1 * id), 0.02, 0.03 * std::sin(2.1 * id));
    image.cam_from_model.translation -= image.cam_from_model.rotation * shift;
  }
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("The model was moved to them"));
  ExpectNearTruth(Model(), 0.06);
  EXPECT_TRUE(Report()["known"]["placed"]);
  EXPECT_FALSE(Report()["known"]["held"]);
}

TEST_F(KnownPhotosCommand, AKnownPhotoWithFewMatchesIsTakenAsItStands) {
  for (DatabasePair& pair : views_.pairs) {
    if (pair.image_id1 != 8 && pair.image_id2 != 8) continue;
    std::vector<Eigen::Vector2i> few;  // of the same 24 points in all pairs
    for (const Eigen::Vector2i& match : pair.matches) {
      const uint32_t id = pair.image_id1 == 8 ? pair.image_id1 : pair.image_id2;
      const int row = pair.image_id1 == 8 ? match.x() : match.y();
      const int point = views_.point_of_keypoint.at(id)[row];
      if (point >= 0 && point % 20 == 0) few.push_back(match);
    }
    pair.matches = few;
  }
  const CommandResult result = Run("--Chain.enabled 0");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const SparseModel model = Model();
  ASSERT_EQ(model.images.size(), 8u);
  ExpectNearTruth(model, 0.005);
  EXPECT_EQ(Report()["images"][7]["by"], "known");
  EXPECT_THAT(Report()["known"]["photos_held"], Contains("view_007.jpg"));
}

TEST_F(KnownPhotosCommand, OneOfThemDoesNotTellTheScale) {
  while (known_.images.size() > 1) known_.images.erase(known_.images.begin());
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("Fewer than two"));
  EXPECT_THAT(result.err, HasSubstr("by what the scan shows in these photos"));
  EXPECT_FALSE(Report()["known"]["placed"]);
  const MapperVerdict verdict = ReadMapperVerdict(folder_ / "sparse/0", Model());
  EXPECT_FALSE(verdict.known_rms);
  // What roomtex-align goes by.
  const SparseImage& told = known_.images.begin()->second;
  ASSERT_EQ(verdict.told_poses.size(), 1u);
  EXPECT_EQ(verdict.told_poses[0].first, told.name);
  EXPECT_THAT(verdict.told_poses[0].second, IsNearRigid(told.cam_from_model, 1e-12, 1e-6));
}

TEST_F(KnownPhotosCommand, PosesOfAnotherPlaceAreNotTrusted) {
  double turn = 0;
  for (auto& [id, image] : known_.images) {
    image.cam_from_model = Rigid{Eigen::Quaterniond(Eigen::AngleAxisd(
                                     turn += 0.9, Eigen::Vector3d(1, 2, 0).normalized())),
                                 Eigen::Vector3d(turn, 0, 0)} *
                           image.cam_from_model;
  }
  const CommandResult result = Run();
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_THAT(result.err, HasSubstr("the known poses contradict the photos"));
}

TEST_F(KnownPhotosCommand, ThoseOfAnotherDatabaseGetASentence) {
  for (auto& [id, image] : known_.images) image.name = "other/" + image.name;
  CommandResult result = Run();
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.err, HasSubstr("holds no photo that is in the database"));
  for (auto& [id, image] : known_.images) image.name = image.name.substr(6);
  known_.cameras.at(1).width = 640;
  known_.cameras.at(1).params[2] = 320;
  result = Run();
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(result.err,
              HasSubstr("is 640 x 900 pixels, view_001.jpg of the database 1200 x 900"));
}

}  // namespace
}  // namespace roomtex
