#pragma once
// roomtex-mapper run on a simulated set of views, with the installed COLMAP.

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "colmap_ext/sparse_model.h"
#include "tests/colmap_ext/simulated_database.h"
#include "tests/support/folders.h"
#include "tests/support/matchers.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {

class MapperCommand : public ::testing::Test {
 protected:
  void Simulate(const SimulatedViewsOptions& options, bool with_pairs = true) {
    views_ = SimulateViews(options);
    WriteSimulatedDatabase(views_, folder_.path(), with_pairs);
  }
  std::string Arguments() const {
    return "roomtex-mapper --database_path " + (folder_ / "database.db") + " --image_path " +
           (folder_ / "photos") + " --output_path " + (folder_ / "sparse") + " --report_path " +
           (folder_ / "report.json") + " ";
  }
  CommandResult Run(const std::string& more = "") const {
    return RunCommandLine(Arguments() + more);
  }
  nlohmann::json Report() const {
    return nlohmann::json::parse(ReadBytes(folder_ / "report.json"));
  }
  // Centre errors (metres) and rotation errors (radians) after the best similarity onto the truth.
  void ExpectNearTruth(const SparseModel& model, double metres, double radians) const {
    Eigen::Matrix3Xd found(3, model.images.size()), truth(3, model.images.size());
    int column = 0;
    for (const auto& [image_id, image] : model.images) {
      found.col(column) = image.cam_from_model.TargetOriginInSource();
      truth.col(column++) = views_.cam_from_scene.at(image_id).TargetOriginInSource();
    }
    const Similarity scene_from_model = FitSimilarity(found, truth);
    for (const auto& [image_id, image] : model.images) {
      const Rigid pose = CamFromScan(image.cam_from_model, scene_from_model);
      const Rigid& expected = views_.cam_from_scene.at(image_id);
      EXPECT_LE(RotationAngle(pose.rotation, expected.rotation), radians) << image.name;
      EXPECT_LE((pose.TargetOriginInSource() - expected.TargetOriginInSource()).norm(), metres)
          << image.name;
    }
  }
  // Nothing of the work on the way is left.
  void ExpectNoScratch() const {
    if (!std::filesystem::exists(folder_ / "sparse")) return;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "sparse")) {
      EXPECT_EQ(entry.path().filename().string().find(".roomtex"), std::string::npos)
          << entry.path();
    }
  }
  void WriteScript(const std::string& name, const std::string& body) const {
    WriteBytes(folder_ / name, "#!/bin/sh\n" + body);
    std::filesystem::permissions(folder_ / name, std::filesystem::perms::owner_all);
  }

  TempFolder folder_;
  SimulatedViews views_;
};

inline SimulatedViewsOptions RoomOptions(int num_views) {
  SimulatedViewsOptions options;
  options.num_views = num_views;
  options.num_points = 500;
  options.baseline = 0.4;
  options.distortion = true;
  return options;
}

}  // namespace roomtex
