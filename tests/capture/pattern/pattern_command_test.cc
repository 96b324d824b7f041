#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "capture/simulation/room_pictures.h"
#include "tests/capture/pattern/pattern_camera.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using Json = nlohmann::json;

class PatternCommand : public ::testing::Test {
 protected:
  CommandResult Run(const std::string& options) {
    return RunCommandLine("roomtex-pattern --quiet --output_path " + (folder_ / "pattern.png") +
                          " --report_path " + (folder_ / "report.json") +
                          " --width 960 --height 540 " + options);
  }
  Json Report() const { return Json::parse(ReadBytes(folder_ / "report.json")); }
  TempFolder folder_;
};

TEST_F(PatternCommand, WritesAPatternAndWhatItIsWorth) {
  const CommandResult result = Run("");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.out, (folder_ / "pattern.png") + "\n");
  const cv::Mat pattern = cv::imread(folder_ / "pattern.png", cv::IMREAD_UNCHANGED);
  EXPECT_EQ(pattern.size(), cv::Size(960, 540));
  EXPECT_EQ(pattern.type(), CV_8UC1);
  const Json report = Report();
  EXPECT_GT(report["num_distinct"].get<int>(), report["num_distinct_wanted"].get<int>());
  EXPECT_GE(report["features"].get<int>(), report["num_distinct"].get<int>());
  EXPECT_NEAR(report["brightness"].get<double>(), 0.65, 0.02);
  EXPECT_LT(report["distinctness"]["ratio_median"].get<double>(), 0.8);
  EXPECT_LT(report["cross_seed"]["matched_share"].get<double>(), 0.02);
  EXPECT_EQ(report["similar_neighbours"], 0);
}

TEST_F(PatternCommand, GivesTheSameBytesForEveryNumberOfThreads) {
  ASSERT_EQ(Run("--num_threads 1 --random_seed 3").exit_code, 0);
  const std::string pattern = ReadBytes(folder_ / "pattern.png");
  const Json report = Report();
  ASSERT_EQ(Run("--num_threads 2 --random_seed 3").exit_code, 0);
  EXPECT_EQ(ReadBytes(folder_ / "pattern.png"), pattern);
  EXPECT_EQ(Report()["num_distinct"], report["num_distinct"]);
  EXPECT_EQ(Report()["cross_seed"], report["cross_seed"]);
}

// Of two pictures of one size: -1..1.
double Correlation(const cv::Mat1b& a, const cv::Mat1b& b) {
  cv::Mat1f score;
  cv::matchTemplate(a, b, score, cv::TM_CCOEFF_NORMED);
  return score(0, 0);
}

TEST_F(PatternCommand, TakesAPhotoOfDetail) {
  const cv::Mat map = DrawMap(1400, 900, "PLAN", 2);
  cv::imwrite(folder_ / "map.png", map);
  const auto pattern = [&](const std::string& options) {
    EXPECT_EQ(Run(options).exit_code, 0);
    EXPECT_TRUE(Report()["warnings"].empty()) << Report()["warnings"];
    return cv::Mat1b(cv::imread(folder_ / "pattern.png", cv::IMREAD_GRAYSCALE));
  };
  const std::string photo = "--input_path " + (folder_ / "map.png");
  const cv::Mat1b shuffled = pattern(photo);
  // Not shuffled, half of it is the map, inverted: the middle of it that has the projector's shape.
  const cv::Mat1b whole = pattern(photo + " --blocks 1");
  cv::Mat1b grey;
  cv::cvtColor(map, grey, cv::COLOR_BGR2GRAY);
  const int height = 1400 * 540 / 960;
  cv::resize(grey(cv::Rect(0, (900 - height) / 2, 1400, height)), grey, {960, 540}, 0, 0,
             cv::INTER_AREA);
  EXPECT_LT(Correlation(whole, grey), -0.45);  // measured: -0.53, and 0.00
  EXPECT_LT(std::abs(Correlation(shuffled, grey)), 0.1);
}

TEST_F(PatternCommand, SaysWhenAPhotoIsSmallPlainOrNone) {
  cv::imwrite(folder_ / "small.png", DrawMap(500, 400, "PLAN", 2));
  Run("--input_path " + (folder_ / "small.png"));
  EXPECT_NE(Report()["warnings"].dump().find("is enlarged"), std::string::npos);
  cv::imwrite(folder_ / "tiny.png", DrawMap(120, 400, "PLAN", 2));
  CommandResult result = Run("--input_path " + (folder_ / "tiny.png"));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("has 120 x 400 pixels"), std::string::npos) << result.err;
  cv::imwrite(folder_ / "plain.png", cv::Mat(800, 1200, CV_8UC3, cv::Scalar(90, 120, 150)));
  result = Run("--input_path " + (folder_ / "plain.png"));
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("is plain"), std::string::npos) << result.err;
  WriteBytes(folder_ / "text.jpg", "no picture");
  EXPECT_EQ(Run("--input_path " + (folder_ / "text.jpg")).exit_code, 3);
  for (const char* option : {"--input_path", "--evaluate_path"}) {
    result = Run(std::string(option) + " " + (folder_ / "none.jpg"));
    EXPECT_EQ(result.exit_code, 3);
    EXPECT_NE(result.err.find(std::string("Check ") + option), std::string::npos) << result.err;
  }
  EXPECT_EQ(Run("--blocks 0 --brightness 2").exit_code, 2);
  result = RunCommandLine("roomtex-pattern --output_path " + (folder_ / "pattern.gif"));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("must end in .png"), std::string::npos) << result.err;
}

TEST_F(PatternCommand, EvaluatesAPhotoOfTheWall) {
  ASSERT_EQ(Run("").exit_code, 0);
  const cv::Mat1b pattern = cv::imread(folder_ / "pattern.png", cv::IMREAD_GRAYSCALE);
  WallView view;
  view.distance = 2;
  cv::imwrite(folder_ / "wall.jpg", TakePhoto(pattern, view, 1));
  EXPECT_EQ(Run("--evaluate_path " + (folder_ / "wall.jpg")).exit_code, 0);
  const Json photo = Report()["photo"];
  EXPECT_TRUE(photo["usable"].get<bool>());
  EXPECT_GT(photo["on_planes"].get<int>(), 500);
}

// The pattern is being projected: a look at a photo of it must not replace it by another.
TEST_F(PatternCommand, EvaluatingAPhotoReplacesNoPattern) {
  ASSERT_EQ(Run("--random_seed 1").exit_code, 0);
  const std::string pattern = ReadBytes(folder_ / "pattern.png");
  cv::imwrite(folder_ / "wall.jpg",
              TakePhoto(cv::imread(folder_ / "pattern.png", cv::IMREAD_GRAYSCALE), WallView(), 1));
  const std::string evaluate = " --evaluate_path " + (folder_ / "wall.jpg");
  CommandResult result = Run(evaluate);
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("is not the pattern of these options (--random_seed 0, --width 960"),
            std::string::npos)
      << result.err;
  EXPECT_EQ(ReadBytes(folder_ / "pattern.png"), pattern);
  EXPECT_EQ(Run("--random_seed 1" + evaluate).exit_code, 0);
  EXPECT_EQ(ReadBytes(folder_ / "pattern.png"), pattern);
  // Without a pattern nothing is written; another projector's photo is not taken for this one's.
  const std::string line =
      "roomtex-pattern --quiet --width 960 --height 540 --report_path " + (folder_ / "report.json");
  result = RunCommandLine(line + " --random_seed 9" + evaluate);
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_NE(Report()["reason"].get<std::string>().find("cannot be used"), std::string::npos);
  EXPECT_EQ(result.out, "");
  result = RunCommandLine(line);
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("--output_path is required"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace roomtex
