// The command lines that roomtex-auto chooses, with programs of several versions in COLMAP's place.

#include <algorithm>
#include <filesystem>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "core/child_program.h"
#include "core/photo.h"
#include "tests/support/temp_folder.h"
#include "workflow/step.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr char kColmap38[] =
    "#!/bin/sh\n"
    "case $1 in\n"
    "help) echo 'COLMAP 3.8 -- Structure-from-Motion'; echo '(Commit x on y without CUDA)';;\n"
    "*) for o in database_path SiftExtraction.use_gpu SiftExtraction.max_image_size \\\n"
    "  SiftMatching.use_gpu SiftMatching.guided_matching SiftMatching.num_threads \\\n"
    "  SiftExtraction.num_threads; do echo \"  --$o arg (=1)\"; done;;\n"
    "esac\n";
constexpr char kColmap41[] =
    "#!/bin/sh\n"
    "case $1 in\n"
    "help) echo 'COLMAP 4.1 (Commit x on y with CUDA)';;\n"
    "*) for o in database_path FeatureExtraction.use_gpu FeatureExtraction.max_image_size \\\n"
    "  FeatureMatching.use_gpu FeatureMatching.guided_matching; do echo \"  --$o arg (=1)\"; "
    "done;;\n"
    "esac\n";

class StepTableTest : public testing::Test {
 protected:
  void SetUp() override {
    WriteBytes(folder_ / "colmap", kColmap38);
    fs::permissions(folder_ / "colmap", fs::perms::owner_all);
    fs::create_directories(folder_ / "photos");
    options_.colmap = folder_ / "colmap";
    options_.image_path = folder_ / "photos";
    options_.scan_paths = {"room.e57"};
    options_.output_path = folder_ / "result";
    options_.patterned = "0";
  }

  void AddPhotos(const std::string& name, int count, int width) {
    for (int i = 0; i < count; ++i) {
      cv::imwrite(folder_ / ("photos/" + name + std::to_string(100 + i) + ".jpg"),
                  cv::Mat3b(40, width, cv::Vec3b(9, 9, 9)));
    }
  }

  Step Make(const std::string& name) {
    Chain chain(options_);
    for (const StepRow& row : StepTable()) {
      if (row.name == name) return row.make(&chain);
    }
    ADD_FAILURE() << name;
    return {};
  }
  std::string Line(const std::string& name, size_t index = 0) {
    return CommandText(Make(name).commands.at(index));
  }
  // The steps that this run has.
  std::vector<std::string> Applying() {
    Chain chain(options_);
    std::vector<std::string> names;
    for (const StepRow& row : StepTable()) {
      if (row.applies(&chain)) names.emplace_back(row.name);
    }
    return names;
  }

  TempFolder folder_;
  AutoOptions options_;
};

TEST_F(StepTableTest, HasEachNameOnceAndInTheOrderOfTheWork) {
  const std::vector<std::string> names = StepNames();
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
  EXPECT_THAT(names, ElementsAre("frames", "faces", "associate", "features", "matches", "mapper",
                                 "align", "texture", "pictures", "report"));
  AddPhotos("a", 3, 60);
  EXPECT_THAT(Applying(), ElementsAre("features", "matches", "mapper", "align", "texture",
                                      "pictures", "report"));
}

TEST_F(StepTableTest, OneCameraIsToldToColmapAsOne) {
  AddPhotos("a", 12, 60);
  const Step step = Make("features");
  ASSERT_EQ(step.commands.size(), 1u);
  const std::string line = CommandText(step.commands[0]);
  EXPECT_THAT(line, HasSubstr("--ImageReader.single_camera 1"));
  EXPECT_THAT(line, HasSubstr("--ImageReader.camera_model OPENCV"));
  EXPECT_THAT(line, HasSubstr("--SiftExtraction.use_gpu 0"));
  EXPECT_THAT(line, Not(HasSubstr("image_list_path")));
}

TEST_F(StepTableTest, AFewPhotosGetALensOfFewParameters) {
  AddPhotos("a", 4, 60);
  EXPECT_THAT(Line("features"), HasSubstr("--ImageReader.camera_model SIMPLE_RADIAL"));
}

TEST_F(StepTableTest, TwoCamerasGetACommandEach) {
  AddPhotos("a", 5, 60);
  AddPhotos("b", 3, 80);
  const Step step = Make("features");
  ASSERT_EQ(step.commands.size(), 2u);
  ASSERT_EQ(step.files.size(), 2u);
  EXPECT_EQ(step.files[1].second, "b100.jpg\nb101.jpg\nb102.jpg\n");
  EXPECT_THAT(step.commands[1], Contains(step.files[1].first));
}

TEST_F(StepTableTest, PhotosThatAllDifferGetACameraEach) {
  for (int i = 0; i < 6; ++i) AddPhotos("a" + std::to_string(i), 1, 60 + 2 * i);
  EXPECT_THAT(Line("features"), Not(HasSubstr("single_camera")));
}

TEST_F(StepTableTest, ACalibrationGoesToThePhotosOfItsSize) {
  AddPhotos("a", 5, 60);
  AddPhotos("b", 3, 80);
  WriteBytes(folder_ / "cameras.txt", "1 PINHOLE 80 40 70 70 40 20\n");
  options_.cameras_path = folder_ / "cameras.txt";
  EXPECT_THAT(Line("features", 0), Not(HasSubstr("camera_params")));
  EXPECT_THAT(Line("features", 1), HasSubstr("--ImageReader.camera_params 70,70,40,20"));
  options_.cameras_path.clear();
  options_.camera_model = "PINHOLE";
  options_.camera_params = "9,9,9,9";
  EXPECT_THAT(Line("features", 0), HasSubstr("--ImageReader.camera_params 9,9,9,9"));
  EXPECT_THAT(Line("features", 1), Not(HasSubstr("camera_params")));
}

TEST_F(StepTableTest, SpeaksTheDialectOfTheColmapThatIsThere) {
  AddPhotos("a", 4, 60);
  WriteBytes(folder_ / "colmap", kColmap41);
  options_.use_gpu = "1";
  options_.quality = "high";
  EXPECT_THAT(Line("features"), HasSubstr("--FeatureExtraction.use_gpu 1"));
  EXPECT_THAT(Line("features"), HasSubstr("--FeatureExtraction.max_image_size 6400"));
  EXPECT_THAT(Line("matches"), HasSubstr("--FeatureMatching.use_gpu 1"));
  EXPECT_THAT(Line("matches"), HasSubstr("--FeatureMatching.guided_matching 1"));
}

TEST_F(StepTableTest, OptionsHandedOnTakeThePlaceOfOurs) {
  AddPhotos("a", 4, 60);
  options_.passed.features = {"--SiftExtraction.max_num_features", "123"};
  options_.passed.texture = {"--Texture.scale", "2"};
  EXPECT_THAT(Line("features"), HasSubstr("--SiftExtraction.max_num_features 123"));
  EXPECT_THAT(Line("features"), Not(HasSubstr("8192")));
  EXPECT_THAT(Line("texture"), HasSubstr("--Texture.scale 2"));
  EXPECT_THAT(Line("texture"), Not(HasSubstr("auto")));
}

TEST_F(StepTableTest, LoosePhotosAreAllMatchedThoseInARowWithNeighbours) {
  AddPhotos("a", 4, 60);
  EXPECT_THAT(Line("matches"), HasSubstr("exhaustive_matcher"));
  options_.sequence = "1";
  EXPECT_THAT(Line("matches"), HasSubstr("sequential_matcher"));
}

TEST_F(StepTableTest, OfManyPhotosThePairsWorthMatchingAreMatched) {
  AddPhotos("a", 4, 60);
  options_.pairs = "1";
  options_.passed.pairs = {"--Pairs.max_neighbors", "7"};
  EXPECT_THAT(Line("matches"), HasSubstr("roomtex-pairs"));
  EXPECT_THAT(Line("matches"), HasSubstr("--Pairs.max_neighbors 7"));
  EXPECT_THAT(Line("matches", 1), HasSubstr("matches_importer"));
  EXPECT_THAT(Line("matches", 1), HasSubstr("--match_type pairs"));
  AddPhotos("blank ", 1, 60);
  EXPECT_THAT(Line("matches"), HasSubstr("exhaustive_matcher"));
  EXPECT_THAT(Make("matches").notes[0], HasSubstr("names with blanks"));

  fs::remove(folder_ / "photos/blank 100.jpg");
  options_.pairs = "auto";
  EXPECT_THAT(Line("matches"), HasSubstr("exhaustive_matcher"));
  AddPhotos("b", 60, 60);
  EXPECT_THAT(Line("matches"), HasSubstr("roomtex-pairs"));
  options_.passed.matches = {"--ExhaustiveMatching.block_size", "9"};
  EXPECT_THAT(Line("matches"), HasSubstr("exhaustive_matcher"));
}

TEST_F(StepTableTest, ThePicksThatAreThereAreUsed) {
  fs::create_directories(folder_ / "result");
  EXPECT_THAT(Line("align"), Not(HasSubstr("picks_path")));
  WriteBytes(folder_ / "result/picks.csv", "");
  EXPECT_THAT(Line("align"), HasSubstr("--picks_path " + (folder_ / "result/picks.csv")));
  options_.picks_path = "mine.csv";
  EXPECT_THAT(Line("align"), HasSubstr("--picks_path mine.csv"));
}

TEST_F(StepTableTest, FramesOfAVideoAndFacesOfPanoramasComeFirst) {
  options_.image_path.clear();
  options_.video_path = "walk.mp4";
  EXPECT_EQ(Applying().front(), "frames");
  EXPECT_EQ(Chain(options_).ColorFolder(), folder_ / "result/frames");
  options_.video_path.clear();
  options_.panoramas_path = "panoramas";
  EXPECT_EQ(Applying().front(), "faces");
  const Chain chain(options_);
  EXPECT_EQ(chain.ColmapFolder(), folder_ / "result/faces");
  EXPECT_EQ(chain.ColorFolder(), "panoramas");
  EXPECT_THAT(CommandText(chain.PickCommand()), HasSubstr("--panoramas_path"));
}

TEST_F(StepTableTest, TheColoursComeFromThePhotosWithoutThePattern) {
  options_.patterned = "1";
  EXPECT_EQ(Chain(options_).ColmapFolder(), folder_ / "photos");
  fs::create_directories(folder_ / "result/linked/patterned");
  fs::create_directories(folder_ / "result/log");
  WriteBytes(folder_ / "result/log/associate.json", R"({"trusted": true})");
  EXPECT_EQ(Chain(options_).ColmapFolder(), folder_ / "result/linked/patterned");
  EXPECT_EQ(Chain(options_).ColorFolder(), folder_ / "result/linked/plain");
  WriteBytes(folder_ / "result/log/associate.json", R"({"trusted": false})");
  EXPECT_EQ(Chain(options_).ColmapFolder(), folder_ / "photos");
}

TEST(AutoOptions, SaysEveryProblem) {
  AutoOptions options;
  options.camera_params = "1,2,3";
  options.only = "mapper";
  options.from = "sparse";
  const std::vector<std::string> problems = options.Problems();
  EXPECT_THAT(problems, Contains(HasSubstr("give one of --image_path")));
  EXPECT_THAT(problems, Contains(HasSubstr("--camera_params needs --camera_model")));
  EXPECT_THAT(problems, Contains(HasSubstr("--only goes with neither")));
  EXPECT_THAT(problems, Contains(HasSubstr("--from is \"sparse\", expected one of frames")));
}

TEST(AutoOptions, StepsThatEndBeforeTheyBeginAndScansGivenTwiceAreSaid) {
  AutoOptions options;
  options.image_path = "photos";
  options.scan_paths = {"a.e57", "b.e57"};
  options.from = "align";
  options.until = "align";
  EXPECT_THAT(options.Problems(), IsEmpty());
  options.until = "mapper";
  options.scan_paths.push_back("a.e57");
  const std::vector<std::string> problems = options.Problems();
  EXPECT_THAT(problems, Contains(HasSubstr("--from align comes after --until mapper")));
  EXPECT_THAT(problems, Contains(HasSubstr("--scan_path a.e57 is given twice")));
}

}  // namespace
}  // namespace roomtex
