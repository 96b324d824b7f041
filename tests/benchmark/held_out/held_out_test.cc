// The benchmark runs, its scores mean what they say, and a pose that is off is found. Nothing here
// is timed.

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/frames.h"
#include "core/random_stream.h"
#include "core/twist.h"
#include "tests/benchmark/held_out/held_out_score.h"
#include "tests/benchmark/held_out/picture_sheet.h"
#include "tests/support/folders.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

// Two walls at a right angle with soft blotches on them.
ColoredMesh MakeCorner() {
  constexpr int kSteps = 120;
  cv::Mat3b blotches(kSteps + 1, 2 * kSteps + 1);
  RandomStream random(3);
  for (cv::Vec3b& pixel : blotches) {
    for (int k = 0; k < 3; ++k) pixel[k] = static_cast<uint8_t>(random.Uniform(0, 255));
  }
  cv::GaussianBlur(blotches, blotches, {}, 3);
  cv::normalize(blotches, blotches, 30, 220, cv::NORM_MINMAX);
  ColoredMesh mesh;
  for (int row = 0; row <= kSteps; ++row) {
    for (int column = 0; column <= 2 * kSteps; ++column) {
      const double along = 2.0 * column / kSteps - 2, y = 2.0 * row / kSteps - 1;
      mesh.points.emplace_back(along, y, 3 - 0.7 * std::abs(along));
      const cv::Vec3b& c = blotches(row, column);
      mesh.colors.emplace_back(c[2], c[1], c[0]);
      if (row == kSteps || column == 2 * kSteps) continue;
      const int a = row * (2 * kSteps + 1) + column, below = a + 2 * kSteps + 1;
      mesh.triangles.push_back({a, below, a + 1});
      mesh.triangles.push_back({a + 1, below, below + 1});
    }
  }
  return mesh;
}

Camera SmallCamera() {
  Camera camera;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = 240;
  camera.height = 160;
  camera.params = {220, 120, 80};
  return camera;
}

TEST(HeldOutScore, OfAPerfectPredictionAndOfABlurredOne) {
  const ColoredMesh mesh = MakeCorner();
  Prediction prediction = PhotoPredictor(mesh, 1).Predict(SmallCamera(), Rigid());
  const cv::Mat photo = prediction.picture.clone();
  const HeldOutScore perfect = ScorePrediction(prediction, photo);
  EXPECT_GT(perfect.psnr, 60);
  EXPECT_NEAR(perfect.gradient_energy, 1, 1e-6);
  EXPECT_NEAR(perfect.detail_correlation, 1, 1e-6);
  EXPECT_GT(perfect.share_seen, 0.5);
  cv::GaussianBlur(prediction.picture, prediction.picture, {}, 3);
  const HeldOutScore blurred = ScorePrediction(prediction, photo);
  EXPECT_LT(blurred.psnr, perfect.psnr);
  EXPECT_LT(blurred.gradient_energy, 0.7);
}

TEST(HeldOutScore, OneGainPerChannelIsForgiven) {
  const ColoredMesh mesh = MakeCorner();
  Prediction prediction = PhotoPredictor(mesh, 1).Predict(SmallCamera(), Rigid());
  const cv::Mat photo = prediction.picture.clone();
  cv::Mat darker;
  prediction.picture.convertTo(darker, CV_8UC3, 0.7);
  prediction.picture = darker;
  // A factor of bytes is nearly one of light.
  EXPECT_GT(ScorePrediction(prediction, photo).psnr, 30);
}

TEST(PhotoPredictor, FindsAPoseThatIsOff) {
  const ColoredMesh mesh = MakeCorner();
  const PhotoPredictor predictor(mesh, 1);
  const Camera camera = SmallCamera();
  const cv::Mat photo = predictor.Predict(camera, Rigid()).picture;
  Eigen::Matrix<double, 6, 1> step;
  step << 0.004, -0.006, 0.003, 0.01, -0.008, 0.012;
  const Rigid off = Moved(Rigid(), step);
  const Rigid found = predictor.RefinePose(camera, off, photo);
  EXPECT_LT(RotationAngle(found.rotation, Rigid().rotation), 1e-3);
  EXPECT_LT(found.translation.norm(), 3e-3);
}

TEST(RichestSquares, LieWhereTheDetailIsAndTheScanIsSeen) {
  cv::Mat3b photo(160, 240, cv::Vec3b(90, 90, 90));
  RandomStream random(5);
  const auto fill = [&](const cv::Rect& area, double range) {
    for (cv::Vec3b& pixel : cv::Mat3b(photo(area))) {
      pixel = cv::Vec3b::all(static_cast<uint8_t>(random.Uniform(90 - range, 90 + range)));
    }
  };
  fill({0, 0, 60, 60}, 80);     // the richest, and not seen
  fill({120, 15, 60, 60}, 60);  // both on the steps of a quarter of the square
  fill({30, 90, 60, 60}, 30);
  cv::Mat1b seen(photo.size(), uint8_t{255});
  seen(cv::Rect(0, 0, 60, 60)).setTo(0);
  const std::vector<cv::Rect> squares = RichestSquares(photo, seen, 2);
  ASSERT_EQ(squares.size(), 2u);
  EXPECT_EQ(squares[0], cv::Rect(120, 15, 60, 60));
  EXPECT_EQ(squares[1], cv::Rect(30, 90, 60, 60));
}

TEST(PictureSheet, HasAColumnForThePhotoAndEachMethod) {
  const ColoredMesh mesh = MakeCorner();
  const Prediction prediction = PhotoPredictor(mesh, 1).Predict(SmallCamera(), Rigid());
  Prediction plain = prediction;
  plain.picture = cv::Mat3b(plain.picture.size(), cv::Vec3b(128, 128, 128));
  PictureSheet sheet;
  EXPECT_TRUE(sheet.Draw(6).empty());
  sheet.Add("same", "a.png", prediction.picture, prediction);
  sheet.Add("plain", "a.png", prediction.picture, plain);
  const cv::Mat3b drawn = sheet.Draw(1);
  ASSERT_FALSE(drawn.empty());
  constexpr int kGap = 6;
  const int width = (drawn.cols - kGap) / 3;
  const auto panel = [&](int column) {
    return drawn(cv::Rect(width * column + kGap, drawn.rows / 4, width - kGap, drawn.rows / 2));
  };
  EXPECT_EQ(cv::norm(panel(0), panel(1), cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(panel(0), panel(2), cv::NORM_INF), 30);
}

TEST(HeldOut, PrintsARowForEveryMethod) {
  const TempFolder folder;
  const CommandResult capture = RunCommandLine(
      "roomtex-simulate --quiet --seed 3 --num_photos 8 --photo_width 240 --photo_height 160 "
      "--scan_columns 400 --scan_rows 150 --output_path " +
      (folder / "capture"));
  ASSERT_EQ(capture.exit_code, 0) << capture.err;
  // The last is another program, which writes colours at the vertices.
  WriteBytes(folder / "methods",
             "# name: options\ndefault:\nblurred: --Blend.footprint 4\nother! '" + BinFolder() +
                 "/roomtex-texture' --quiet\n");
  const CommandResult result = RunCommandLine(
      "held_out --quiet --input_path " + (folder / "capture/truth") + " --image_path " +
      (folder / "capture/photos") + " --scan_path " + (folder / "capture/scan.rtpi") +
      " --hold_out 002,005 --methods_path " + (folder / "methods") + " --report_path " +
      (folder / "report.json") + " --sheet_path " + (folder / "sheet.png"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("| default |"), std::string::npos) << result.out;
  // Six rows would be more places than two photos have.
  const cv::Mat sheet = cv::imread(folder / "sheet.png");
  EXPECT_EQ(sheet.cols / 320, 4);
  EXPECT_EQ(sheet.rows / 340, 4);
  const auto report = nlohmann::json::parse(ReadBytes(folder / "report.json"));
  ASSERT_EQ(report["methods"].size(), 3u);
  for (const auto& method : report["methods"]) {
    ASSERT_EQ(method["photos"].size(), 2u);
    EXPECT_GT(method["cpu_seconds"].get<double>(), 0);
    for (const auto& photo : method["photos"]) EXPECT_GT(photo["psnr"].get<double>(), 10);
  }
  EXPECT_GT(report["methods"][0]["photos"][0]["gradient_energy"].get<double>(),
            report["methods"][1]["photos"][0]["gradient_energy"].get<double>());
}

TEST(HeldOut, RefusesNamesThatAreInNoModel) {
  const TempFolder folder;
  const CommandResult capture = RunCommandLine(
      "roomtex-simulate --quiet --num_photos 2 --photo_width 96 --photo_height 64 --scan_columns "
      "60 --scan_rows 30 --output_path " +
      (folder / "capture"));
  ASSERT_EQ(capture.exit_code, 0) << capture.err;
  const CommandResult result =
      RunCommandLine("held_out --quiet --input_path " + (folder / "capture/truth") +
                     " --image_path " + (folder / "capture/photos") + " --hold_out nobody");
  EXPECT_EQ(result.exit_code, 2) << result.err;
}

}  // namespace
}  // namespace roomtex
