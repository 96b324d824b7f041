// roomtex-dense as a user calls it, on a room that knows every surface.

#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "capture/simulation/capture_writer.h"
#include "colmap_ext/dense_workspace.h"
#include "core/option_fields.h"
#include "dense/dense.h"
#include "dense/scan_space.h"
#include "importers/scan_reader.h"
#include "tests/dense/dense_truth.h"
#include "tests/support/option_check.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class DenseCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    SimulatedRoomOptions options;
    options.random_seed = 5;
    options.num_photos = 12;
    options.photo_width = 420;
    options.photo_height = 280;
    options.scan_columns = 900;
    options.scan_rows = 340;
    room_ = new SimulatedRoom(options);
    Progress progress(true);
    WriteCapture(*room_, *folder_ / "capture", &progress);
    result_ = Dense("dense", "");
  }
  static void TearDownTestSuite() {
    delete room_;
    delete folder_;
    folder_ = nullptr;
  }
  static CommandResult Dense(const std::string& output, const std::string& more) {
    const std::string capture = *folder_ / "capture";
    return RunCommandLine("roomtex-dense --quiet --input_path " + capture + "/truth --image_path " +
                          capture + "/photos --scan_path " + capture + "/scan.rtpi --output_path " +
                          (*folder_ / output) + " " + more);
  }
  static std::string Path(const std::string& name) { return *folder_ / name; }

  static TempFolder* folder_;
  static SimulatedRoom* room_;
  static CommandResult result_;
};

TempFolder* DenseCommand::folder_ = nullptr;
SimulatedRoom* DenseCommand::room_ = nullptr;
CommandResult DenseCommand::result_;

TEST_F(DenseCommand, AddsWhatTheStationMissedAndLittleElse) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  const Scan supplement = ReadScan(Path("dense/supplement.ply"), {});
  EXPECT_EQ(supplement.kind(), Scan::Kind::kMesh);
  const DenseScore score = DenseTruth(*room_, 8).Score(supplement.points);
  std::printf("%zu points, %.3f within 20 mm; %.3f of what was missed\n", score.num_points,
              score.accurate_20mm, score.complete_20mm);
  EXPECT_GT(score.num_points, 400);
  EXPECT_GT(score.accurate_20mm, 0.93);
  EXPECT_LE(score.in_free_space, 0.005);
  EXPECT_GT(score.complete_20mm, 0.05);
}

TEST_F(DenseCommand, WritesTheWorkspaceOfColmap) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  const DenseWorkspace workspace{Path("dense")};
  const auto depth = ReadDenseArray(workspace.DepthMapPath("photo_000.jpg", "geometric"));
  const auto normals = ReadDenseArray(workspace.NormalMapPath("photo_000.jpg", "geometric"));
  EXPECT_EQ(depth.size(), 1u);
  EXPECT_EQ(normals.size(), 3u);
  EXPECT_EQ(depth[0].size(), normals[0].size());
  for (const char* name : {"sparse/images.bin", "stereo/fusion.cfg", "stereo/patch-match.cfg",
                           "images/photo_000.jpg", "report.json"}) {
    EXPECT_TRUE(fs::exists(Path("dense/") + name)) << name;
  }
  EXPECT_FALSE(fs::exists(Path("dense/aside")));
}

TEST_F(DenseCommand, TheSupplementIsColouredBehindTheScan) {
  const CommandResult result = RunCommandLine(
      "roomtex-texture --quiet --Texture.scale 1 --input_path " + Path("capture/truth") +
      " --image_path " + Path("capture/photos") + " --scan_path " + Path("capture/scan.rtpi") +
      " --supplement_path " + Path("dense/supplement.ply") + " --output_path " + Path("textured"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json report = json::parse(ReadBytes(Path("textured/report.json")));
  const json& supplement = report["supplement"];
  EXPECT_EQ(supplement["first_vertex"].get<size_t>() + supplement["num_vertices"].get<size_t>(),
            report["num_vertices"].get<size_t>());
  EXPECT_GT(supplement["num_colored"], 0.8 * supplement["num_vertices"].get<double>());
}

// The smallest distance of a vertex from the scan's own surface, metres; `most` if none is as near.
double NearestToScan(const std::string& supplement, const std::string& scan, double most) {
  const ScanSpace space({ReadScan(scan, {})}, 1);
  double nearest = most;
  for (const Eigen::Vector3d& vertex : ReadScan(supplement, {}).points) {
    nearest = std::min(nearest, space.surface().DistanceTo(vertex, most).value_or(most));
  }
  return nearest;
}

TEST_F(DenseCommand, KeepsTwiceWhatPhotosPlacedOneByOneMayBeOff) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  // As roomtex-align writes it without a model: no room moves as a whole.
  fs::copy(Path("capture/truth"), Path("one_by_one"), fs::copy_options::recursive);
  WriteBytes(Path("one_by_one/alignment.json"),
             R"({"trusted": true,
                 "expected_error": {"at_far_corner_mm": null, "at_cameras_mm": 16}})");
  const CommandResult result =
      RunCommandLine("roomtex-dense --quiet --input_path " + Path("one_by_one") + " --image_path " +
                     Path("capture/photos") + " --scan_path " + Path("capture/scan.rtpi") +
                     " --output_path " + Path("one_by_one_dense"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json report = json::parse(ReadBytes(Path("one_by_one_dense/report.json")));
  EXPECT_DOUBLE_EQ(report["distance_to_scan"].get<double>(), 0.032);
  EXPECT_NE(report["warnings"].dump().find("only what is 32 mm and more away"), std::string::npos)
      << report["warnings"];
  ASSERT_GT(report["num_vertices"], 150);
  // The positions are written in single precision.
  const std::string scan = Path("capture/scan.rtpi");
  EXPECT_GE(NearestToScan(Path("one_by_one_dense/supplement.ply"), scan, 0.1), 0.032 - 1e-5);
  // At their true places they are believed nearer to the scan.
  EXPECT_LT(NearestToScan(Path("dense/supplement.ply"), scan, 0.1), 0.03);
}

TEST_F(DenseCommand, SameBytesForAnyNumberOfThreads) {
  const std::string coarse = "--max_image_size 160 --Fusion.min_support 2 --num_threads ";
  ASSERT_EQ(Dense("one", coarse + "1").exit_code, 0);
  ASSERT_EQ(Dense("three", coarse + "3").exit_code, 0);
  EXPECT_EQ(ReadBytes(Path("one/supplement.ply")), ReadBytes(Path("three/supplement.ply")));
}

TEST_F(DenseCommand, SaysWhyTheAlignmentWasRefused) {
  fs::create_directory(Path("refused"));
  WriteBytes(
      Path("refused/alignment.json"),
      R"({"command": "roomtex-align", "trusted": false, "reason": "The picks lie on a line."})");
  const CommandResult result =
      RunCommandLine("roomtex-dense --quiet --input_path " + Path("refused") + " --image_path " +
                     Path("capture/photos") + " --scan_path " + Path("capture/scan.rtpi") +
                     " --output_path " + Path("none"));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("refused to align: The picks lie on a line."), std::string::npos)
      << result.err;
}

TEST_F(DenseCommand, RefusesAForeignFolderAndChecksItsOptions) {
  fs::create_directory(Path("precious"));
  WriteBytes(Path("precious/thesis.txt"), "years of work");
  EXPECT_EQ(Dense("precious", "").exit_code, 3);
  EXPECT_TRUE(fs::exists(Path("precious/thesis.txt")));
  DenseOptions options;
  ExpectChecksItsOptions(
      "roomtex-dense", "--input_path none --image_path none --output_path none",
      {FieldsOf(&options), FieldsOf(&options.patch_match), FieldsOf(&options.fusion)});
}

}  // namespace
}  // namespace roomtex
