// What roomtex-mapper does with lenses, and says of them, with the installed COLMAP.

#include <cstring>
#include <filesystem>

#include "tests/colmap_ext/mapper_scene.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

// Of the numbers in a binary file of COLMAP's.
template <typename T>
std::string Bytes(T value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

class MapperLenses : public MapperCommand {
 protected:
  // Every other photo is of a calibrated camera, the others of one that was guessed.
  void SimulateTwoCameras() {
    views_ = SimulateViews(RoomOptions(8));
    told_ = views_.cameras.at(1);
    Camera& guessed = views_.cameras[2] = told_;
    guessed.camera_id = 2;
    guessed.params[0] *= 1.05;
    guessed.has_prior_focal_length = false;
    views_.cameras.at(1).has_prior_focal_length = true;
    for (auto& [image_id, image] : views_.images) image.camera_id = image_id % 2 == 0 ? 2 : 1;
    WriteSimulatedDatabase(views_, folder_.path());
  }
  // A calibrated camera with a focal length that is told too long.
  void SimulateWrongLens(int num_views, double factor) {
    SimulatedViewsOptions options = RoomOptions(num_views);
    options.distortion = false;
    views_ = SimulateViews(options);
    told_ = views_.cameras.at(1);
    SimulatedViews wrong = views_;
    for (const size_t k : {0, 1}) wrong.cameras.at(1).params[k] *= factor;
    WriteSimulatedDatabase(wrong, folder_.path());
  }
  // COLMAP's own, with the rigs and frames that 4.x adds to the models it writes.
  std::string ColmapWithFrames(const std::string& frames) {
    WriteBytes(folder_ / "no_rigs", Bytes<uint64_t>(0));
    WriteBytes(folder_ / "frames", frames);
    WriteScript("colmap-4",
                "colmap \"$@\" || exit $?\n"
                "for a in \"$@\"; do [ \"$before\" = --output_path ] && out=$a; before=$a; done\n"
                "[ -f \"$out/images.bin\" ] || exit 0\n"
                "cp " +
                    (folder_ / "no_rigs") + " \"$out/rigs.bin\"; cp " + (folder_ / "frames") +
                    " \"$out/frames.bin\"\n");
    return "--colmap " + (folder_ / "colmap-4");
  }
  Camera LensOfModel(uint32_t camera_id) const {
    return ReadSparseModel(folder_ / "sparse/0").cameras.at(camera_id);
  }

  Camera told_;  // camera 1, right
};

// COLMAP refines all cameras or none.
TEST_F(MapperLenses, OfACalibratedCameraIsHeldBesideOneThatIsNot) {
  SimulateTwoCameras();
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(Report()["refined_intrinsics"]);
  EXPECT_EQ(LensOfModel(1).params, told_.params);
  EXPECT_NEAR(LensOfModel(2).MeanFocalLength(), told_.MeanFocalLength(),
              0.005 * told_.MeanFocalLength());
}

TEST_F(MapperLenses, OfACalibratedCameraIsHeldAlsoBesideTheFramesOfColmap4) {
  SimulateTwoCameras();
  const CommandResult result = Run(ColmapWithFrames(Bytes<uint64_t>(0)));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(LensOfModel(1).params, told_.params);
  EXPECT_NEAR(LensOfModel(2).MeanFocalLength(), told_.MeanFocalLength(),
              0.005 * told_.MeanFocalLength());
  EXPECT_THAT(result.err, Not(HasSubstr("could not be held")));
  const nlohmann::json cameras = Report()["cameras"];
  ASSERT_FALSE(cameras.empty());
  for (const auto& camera : cameras) {
    EXPECT_EQ(camera["used"], camera["camera_ids"][0] == 2) << camera;
  }
}

// A frame of two photos: a rig, which an adjustment of single photos would take apart.
TEST_F(MapperLenses, ThatCannotBeHeldAreNamed) {
  SimulateTwoCameras();
  std::string frames = Bytes<uint64_t>(1) + Bytes<uint32_t>(1) + Bytes<uint32_t>(1);
  for (const double number : {1, 0, 0, 0, 0, 0, 0}) frames += Bytes(number);
  frames += Bytes<uint32_t>(2);
  for (const uint32_t id : {1, 2}) {
    frames += Bytes<int32_t>(0) + Bytes<uint32_t>(id) + Bytes<uint64_t>(id);
  }
  const CommandResult result = Run(ColmapWithFrames(frames));
  EXPECT_EQ(result.exit_code % 4, 0) << result.err;  // trusted or not
  EXPECT_NE(LensOfModel(1).params, told_.params);
  EXPECT_THAT(result.err, HasSubstr("Calibrated cameras (1) could not be held"));
}

TEST_F(MapperLenses, StandInTheReportAsTheyWereToldAndWhetherTheyAreUsed) {
  SimulateWrongLens(6, 1.03);
  const double told = 1.03 * told_.MeanFocalLength();
  for (const std::string refine : {"0", "auto", "1"}) {
    Run("--refine_intrinsics " + refine);
    const nlohmann::json cameras = Report()["cameras"];
    ASSERT_EQ(cameras.size(), 1u);
    EXPECT_EQ(cameras[0]["used"], refine != "0") << refine;
    EXPECT_NEAR(cameras[0]["focal_px"]["told"].get<double>(), told, 1e-6) << refine;
    EXPECT_NEAR(cameras[0]["focal_px"]["found"].get<double>(), told_.MeanFocalLength(),
                0.01 * told_.MeanFocalLength());
    EXPECT_GT(cameras[0]["deviations"].get<double>(), 6) << refine;
    EXPECT_EQ(LensOfModel(1).MeanFocalLength() == told, refine == "0");
  }
}

// COLMAP calls a focal length known that it has from EXIF: of a camera that may be distorted, with
// its axis in the very middle and no distortion, nobody has calibrated anything.
TEST_F(MapperLenses, ByExifAreAStartAndNoCalibration) {
  SimulatedViewsOptions options = RoomOptions(5);
  options.distortion = false;
  options.noise_px = 1;
  views_ = SimulateViews(options);
  Camera& camera = views_.cameras.at(1);
  told_ = camera;
  const double f = camera.MeanFocalLength();
  const auto map = [&](double centre_off) {
    camera.model = CameraModel::kOpenCv;
    camera.params = {1.02 * f, 1.02 * f, 0.5 * camera.width + centre_off, 0.5 * camera.height, 0, 0,
                     0,        0};
    camera.has_prior_focal_length = true;
    fs::remove(folder_ / "database.db");
    fs::remove_all(folder_ / "sparse");
    WriteSimulatedDatabase(views_, folder_.path());
    const CommandResult result = Run("--Init.min_num_inliers 15");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return LensOfModel(1).MeanFocalLength();
  };
  const double found = map(0);
  EXPECT_NE(found, 1.02 * f);
  EXPECT_NEAR(found, f, 2 * Report()["cameras"][0]["focal_px"]["sigma"].get<double>());
  // The photos know it to 0.8 %: too little to overrule who calibrated it.
  EXPECT_EQ(map(0.25), 1.02 * f);
}

TEST_F(MapperLenses, StayAsToldWherePhotosCannotBeMappedWithTheLensFound) {
  SimulateWrongLens(6, 1.15);
  WriteScript("colmap-first-pass",
              "case \"$*\" in *pass_[23]*) [ \"$1\" = mapper ] || [ \"$1\" = point_triangulator ] "
              "&& exit 1;; esac\nexec colmap \"$@\"\n");
  const CommandResult result = Run("--colmap " + (folder_ / "colmap-first-pass"));
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_EQ(LensOfModel(1).MeanFocalLength(), 1.15 * told_.MeanFocalLength());
  EXPECT_THAT(result.err, HasSubstr("The lens as told is kept. With the lens found 0 photos can be "
                                    "mapped, 6 with that told."));
  EXPECT_THAT(result.err, Not(HasSubstr("found is used")));
  EXPECT_FALSE(Report()["cameras"][0]["used"].get<bool>());
  EXPECT_THAT(ReadBytes(folder_ / "sparse/roomtex-mapper.log"), Not(HasSubstr("pass_3")));
  // The user is at auto already.
  EXPECT_THAT(result.err, HasSubstr("calibration does not fit"));
  EXPECT_THAT(result.err, HasSubstr("--refine_intrinsics 1 takes the lens"));
  EXPECT_THAT(result.err, Not(HasSubstr("--refine_intrinsics auto")));
}

// A bent room has places for photos that a straight one has not.
TEST_F(MapperLenses, AreTakenAlsoWhereOnePhotoIsLostByThat) {
  SimulateWrongLens(6, 1.03);
  WriteBytes(folder_ / "lost", views_.images.at(6).name + "\n");
  WriteScript("colmap-loses-one",
              "colmap \"$@\" || exit $?\n"
              "for a in \"$@\"; do [ \"$before\" = --output_path ] && out=$a; before=$a; done\n"
              "case \"$1$out\" in bundle_adjuster*pass_2*) colmap image_deleter --input_path "
              "\"$out\" --output_path \"$out\" --image_names_path " +
                  (folder_ / "lost") + ";; esac\n");
  const CommandResult result = Run("--Chain.enabled 0 --colmap " + (folder_ / "colmap-loses-one"));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(Report()["num_reg_images"], 5);
  EXPECT_NEAR(LensOfModel(1).MeanFocalLength(), told_.MeanFocalLength(),
              0.003 * told_.MeanFocalLength());
  EXPECT_THAT(result.err, HasSubstr("The lens found is used. With the lens found 5 photos can be "
                                    "mapped, 6 with that told."));
  EXPECT_TRUE(Report()["cameras"][0]["used"].get<bool>());
}

}  // namespace
}  // namespace roomtex
