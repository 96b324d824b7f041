// The main job in small, as a user types it: simulate, COLMAP, roomtex-mapper, roomtex-align,
// roomtex-texture; judged against the simulation's truth. Label `e2e`.

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "colmap_ext/sparse_model.h"
#include "core/frames.h"
#include "core/similarity.h"
#include "tests/e2e/furnished_capture.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using nlohmann::json;

json ReadJson(const std::string& path) { return json::parse(ReadBytes(path)); }

class Pipeline : public testing::Test {
 protected:
  // All tests look at one run of the whole chain, from the matches on.
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    const FurnishedCapture& made = FurnishedCapture::Get();
    const std::string& capture = made.capture;
    database_before_ = ReadBytes(made.database);
    mapper_ = RunCommandLine("roomtex-mapper --database_path " + made.database + " --image_path " +
                             capture + "/photos --output_path " + (*folder_ / "sparse") +
                             " --report_path " + (*folder_ / "mapper.json"));
    align_ =
        RunCommandLine("roomtex-align --input_path " + (*folder_ / "sparse/0") + " --scan_path " +
                       capture + "/scan.rtpi --picks_path " + capture + "/picks.csv --image_path " +
                       capture + "/photos --output_path " + (*folder_ / "aligned"));
    texture_ = RunCommandLine("roomtex-texture --input_path " + (*folder_ / "aligned") +
                              " --image_path " + capture + "/photos --scan_path " + capture +
                              "/scan.rtpi --output_path " + (*folder_ / "textured"));
    evaluate_ =
        RunCommandLine("roomtex-evaluate --truth_path " + capture + "/truth --input_path " +
                       (*folder_ / "aligned") + " --ply_path " + (*folder_ / "textured/model.ply"));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static TempFolder* folder_;
  static CommandResult mapper_, align_, texture_, evaluate_;
  static std::string database_before_;
};

TempFolder* Pipeline::folder_ = nullptr;
CommandResult Pipeline::mapper_, Pipeline::align_, Pipeline::texture_, Pipeline::evaluate_;
std::string Pipeline::database_before_;

TEST_F(Pipeline, MapperRegistersEveryPhoto) {
  ASSERT_EQ(mapper_.exit_code, 0) << mapper_.err;
  const json report = ReadJson(*folder_ / "mapper.json");
  EXPECT_EQ(report["num_images"], 14);
  EXPECT_EQ(report["num_reg_images"], 14);
  EXPECT_LT(report["mean_reprojection_error_px"], 0.4);  // measured: 0.25
  EXPECT_EQ(ReadSparseModel(*folder_ / "sparse/0").images.size(), 14u);
  EXPECT_EQ(ReadSparseModel(*folder_ / "sparse/init").images.size(), 2u);
}

TEST_F(Pipeline, DatabaseOfTheUserStaysAsItWas) {
  EXPECT_EQ(ReadBytes(FurnishedCapture::Get().database), database_before_);
}

TEST_F(Pipeline, AlignedPosesAreNearTheTruth) {
  ASSERT_EQ(align_.exit_code, 0) << align_.err;
  ASSERT_EQ(evaluate_.exit_code, 0) << evaluate_.err;
  const json truth = json::parse(evaluate_.out);
  // Six clicks of 1.5 px in one photo of 960 x 640.
  EXPECT_LT(truth["poses"]["position_median_mm"], 4.0);    // measured: 1.0 to 1.7
  EXPECT_LT(truth["poses"]["rotation_median_deg"], 0.08);  // measured: 0.02 to 0.04
  EXPECT_EQ(truth["poses"]["num_registered"], 14);
}

TEST_F(Pipeline, ColoursAreNearTheTruth) {
  ASSERT_EQ(texture_.exit_code, 0) << texture_.err;
  ASSERT_EQ(evaluate_.exit_code, 0) << evaluate_.err;
  const json truth = json::parse(evaluate_.out);
  EXPECT_GT(truth["color"]["psnr_db"], 27.0);  // measured: 28.7 to 29.2
  EXPECT_GT(ReadJson(*folder_ / "textured/report.json")["coverage"], 0.7);  // measured: 0.746
}

TEST_F(Pipeline, WritesEveryFileOfTheContract) {
  for (const char* name :
       {"sparse/0/cameras.bin", "sparse/0/images.bin", "sparse/0/points3D.bin",
        "sparse/init/images.bin", "aligned/cameras.bin", "aligned/images.bin",
        "aligned/points3D.bin", "aligned/alignment.json", "aligned/scan_from_sparse.txt",
        "textured/model.ply", "textured/model.glb", "textured/texture.png", "textured/model.rtpi",
        "textured/report.json"}) {
    EXPECT_TRUE(std::filesystem::is_regular_file(*folder_ / name)) << name;
  }
}

}  // namespace
}  // namespace roomtex
