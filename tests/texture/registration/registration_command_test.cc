// roomtex-texture as users call it, on photos that are off and on photos that are not.

#include <cmath>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "colmap_ext/sparse_model.h"
#include "core/frames.h"
#include "core/random_stream.h"
#include "core/twist.h"
#include "tests/texture/texture_command.h"

namespace roomtex {
namespace {

class RegistrationCommandTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    Simulate("room", "");
    Disturb("room", 0.1, 0.005, "disturbed");
    // What there is to be had: true poses, nothing to correct.
    Texture("room", "room/truth", "best", "--Registration.mode none");
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static void Simulate(const std::string& name, const std::string& more) {
    const CommandResult result = RunCommandLine(
        "roomtex-simulate --quiet --seed 5 --num_photos 14 --photo_width 720 --photo_height 480 "
        "--scan_columns 1000 --scan_rows 375 --finest_detail 0.006 --output_path " +
        Path(name) + " " + more);
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }
  // A model whose poses are turned and moved at random.
  static void Disturb(const std::string& capture, double turn_deg, double move,
                      const std::string& name) {
    SparseModel model = ReadSparseModel(Path(capture + "/truth"));
    for (auto& [id, image] : model.images) {
      RandomStream random(MixBits(11, id));
      Eigen::Matrix<double, 6, 1> step;
      for (int k = 0; k < 3; ++k) step[k] = RadFromDeg(turn_deg) * random.Gaussian();
      for (int k = 3; k < 6; ++k) step[k] = move * random.Gaussian();
      image.cam_from_model = Moved(image.cam_from_model, step);
    }
    WriteSparseModel(model, Path(name));
  }
  // Returns the report.
  static json Texture(const std::string& capture, const std::string& model,
                      const std::string& output, const std::string& more = "") {
    const CommandResult result = RunCommandLine(
        "roomtex-texture --quiet --Texture.scale 1 --output_web 0 --input_path " + Path(model) +
        " --image_path " + Path(capture + "/photos") + " --scan_path " +
        Path(capture + "/scan.rtpi") + " --output_path " + Path(output) + " " + more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return ReadJson(Path(output + "/report.json"));
  }
  static double PsnrOf(const std::string& capture, const std::string& output) {
    return Psnr(ReadPly(Path(output + "/model.ply")),
                ReadPly(Path(capture + "/truth/true_colors.ply")));
  }
  static std::string Path(const std::string& name) { return *folder_ / name; }

  static inline TempFolder* folder_ = nullptr;
};

TEST_F(RegistrationCommandTest, PhotosThatAgreeGiveTheSameFiles) {
  const json report = Texture("room", "room/truth", "clean");
  for (const char* name : {"model.ply", "model.glb", "texture.png", "model.rtpi"}) {
    EXPECT_EQ(ReadBytes(Path("clean/") + name), ReadBytes(Path("best/") + name)) << name;
  }
  // How far they are off is said all the same.
  ASSERT_EQ(report["images"].size(), 14u);
  for (const json& image : report["images"]) {
    EXPECT_FALSE(image["corrected"].get<bool>());
    EXPECT_LT(image["shift_px"]["before"].get<double>(), 0.3);
  }
  EXPECT_EQ(report["registration"]["applied"], "none");
}

TEST_F(RegistrationCommandTest, PhotosThatAreOffAreBroughtBack) {
  Texture("room", "disturbed", "off_none", "--Registration.mode none");
  const json report = Texture("room", "disturbed", "off", "--num_threads 1");
  const double best = PsnrOf("room", "best"), without = PsnrOf("room", "off_none");
  EXPECT_LT(without, best - 4);
  EXPECT_GT(PsnrOf("room", "off"), best - 0.3);
  EXPECT_NE(report["registration"]["applied"], "none");
  for (const json& image : report["images"]) {
    EXPECT_LT(image["shift_px"]["after"].get<double>(),
              0.5 * image["shift_px"]["before"].get<double>() + 0.1);
  }
  // The number of threads changes nothing.
  Texture("room", "disturbed", "off_three", "--num_threads 3");
  for (const char* name : {"model.ply", "model.glb", "texture.png"}) {
    EXPECT_EQ(ReadBytes(Path("off/") + name), ReadBytes(Path("off_three/") + name)) << name;
  }
}

// Faults of the capture, each with half of what it costs brought back.
TEST_F(RegistrationCommandTest, DriftOfTheScanAndRollingShuttersAreFollowed) {
  const double best = PsnrOf("room", "best");
  for (const char* fault : {"--bend 0.008", "--rolling_shutter_ms 30"}) {
    const std::string name = std::string("fault") + fault[2];
    Simulate(name, fault);
    Texture(name, name + "/truth", name + "_none", "--Registration.mode none");
    Texture(name, name + "/truth", name + "_auto");
    const double without = PsnrOf(name, name + "_none");
    EXPECT_LT(without, best - 1) << fault;
    EXPECT_GT(PsnrOf(name, name + "_auto"), 0.5 * (best + without)) << fault;
  }
}

}  // namespace
}  // namespace roomtex
