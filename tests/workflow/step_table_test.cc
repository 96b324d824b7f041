// The command lines that roomtex-auto chooses, with programs of several versions in COLMAP's place.

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "core/child_program.h"
#include "core/error.h"
#include "core/photo.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"
#include "tests/workflow/step_table_fixture.h"
#include "workflow/output_folder.h"
#include "workflow/scanner_photos.h"
#include "workflow/step.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr char kColmap41[] =
    "#!/bin/sh\n"
    "case $1 in\n"
    "help) echo 'COLMAP 4.1 (Commit x on y with CUDA)';;\n"
    "*) for o in database_path FeatureExtraction.use_gpu FeatureExtraction.max_image_size \\\n"
    "  FeatureMatching.use_gpu FeatureMatching.guided_matching; do echo \"  --$o arg (=1)\"; "
    "done;;\n"
    "esac\n";

// Features take hours: they are not made anew since somebody has looked at the photos, or written
// notes beside them.
TEST_F(StepTableTest, OnlyPhotosInTheFolderOfPhotosCount) {
  WriteBytes(folder_ / "colmap", std::string(kColmap38) +
                                     "for word; do [ \"$last\" = --database_path ] && echo >$word; "
                                     "last=$word; done\ntrue\n");
  AddPhotos("a", 3, 64);
  const auto start = [this, scan = AddScan("room.xyz")] {
    const CommandResult result = RunCommandLine(
        "roomtex-auto --until features --image_path " + options_.image_path + " --scan_path " +
        scan + " --output_path " + options_.output_path + " --colmap " + options_.colmap);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.err;
  };
  EXPECT_THAT(start(), Not(HasSubstr("features: ")));  // for the first time
  for (const char* name : {".DS_Store", "Thumbs.db", "notes.txt"}) {
    WriteBytes(folder_ / (std::string("photos/") + name), "x");
  }
  EXPECT_THAT(start(), HasSubstr("features: done before, nothing has changed"));
  AddPhotos("b", 1, 64);
  EXPECT_THAT(start(), HasSubstr("features: once more, changed: photos"));
}

// Which of two alignments is the last is no question of the times of files, which a copy turns
// about.
TEST_F(StepTableTest, ColoursFromTheLastAlignment) {
  const auto chosen = [this] { return Chain(options_).AlignedPath(); };
  const std::string aligned = folder_ / "result/aligned", aside = aligned + ".untrusted";
  options_.accept_untrusted = true;
  AddAligned("aligned", false);
  EXPECT_EQ(chosen(), aligned);
  AddAligned("aligned", true);
  AddAligned("aligned.untrusted", false);
  EXPECT_EQ(chosen(), aside);
  options_.accept_untrusted = false;
  EXPECT_EQ(chosen(), aligned);
  options_.accept_untrusted = true;
  AddAligned("aligned", true);  // a later run, which leaves the one aside there
  const auto later = fs::file_time_type::clock::now() + std::chrono::hours(1);
  fs::last_write_time(aside + "/images.bin", later);
  EXPECT_EQ(chosen(), aligned);
  AddAligned("aligned.untrusted", false);
  fs::last_write_time(aligned + "/alignment.json", later);
  EXPECT_EQ(chosen(), aside);
}

TEST_F(StepTableTest, HasEachNameOnceAndInTheOrderOfTheWork) {
  const std::vector<std::string> names = StepNames();
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
  EXPECT_THAT(names, ElementsAre("frames", "faces", "associate", "scanner", "features", "matches",
                                 "mapper", "align", "texture", "pictures", "report"));
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

TEST_F(StepTableTest, CopiesThatAnotherProgramHidesAreNotForColmap) {
  AddPhotos("a", 3, 64);
  fs::create_directories(folder_ / "photos/.originals");
  fs::copy(folder_ / "photos/a100.jpg", folder_ / "photos/.originals/a100.jpg");
  const Step step = Make("features");
  EXPECT_THAT(CommandText(step.commands.at(0)), HasSubstr("--image_list_path"));
  ASSERT_EQ(step.files.size(), 1u);
  EXPECT_EQ(step.files[0].second, "a100.jpg\na101.jpg\na102.jpg\n");
}

TEST_F(StepTableTest, PhotosThatCannotBeReadAreNamedAndNotForColmap) {
  AddPhotos("a", 3, 64);
  WriteBytes(folder_ / "photos/empty.jpg", "");
  WriteBytes(folder_ / "photos/text.png", "no picture");
  const Step step = Make("features");
  ASSERT_EQ(step.commands.size(), 1u);
  EXPECT_THAT(CommandText(step.commands[0]), HasSubstr("--image_list_path"));
  EXPECT_EQ(step.files.at(0).second, "a100.jpg\na101.jpg\na102.jpg\n");
  EXPECT_THAT(step.notes, Contains("left out, since they cannot be read: empty.jpg, text.png"));
  for (const char* name : {"a100.jpg", "a101.jpg", "a102.jpg"}) {
    fs::remove(folder_ / (std::string("photos/") + name));
  }
  EXPECT_THROW(Make("features"), InputError);
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

TEST_F(StepTableTest, PhotosThatAllDifferHaveTheLensThatIsTold) {
  for (int i = 0; i < 6; ++i) AddPhotos("a" + std::to_string(i), 1, 60 + 2 * i);
  options_.camera_model = "RADIAL";
  EXPECT_THAT(Line("features"), HasSubstr("--ImageReader.camera_model RADIAL"));
  options_.camera_model.clear();
  WriteBytes(folder_ / "cameras.txt", "1 PINHOLE 64 40 70 70 32 20\n");
  options_.cameras_path = folder_ / "cameras.txt";
  const Step step = Make("features");
  ASSERT_EQ(step.commands.size(), 2u);
  EXPECT_EQ(step.files[0].second, "a2100.jpg\n");
  EXPECT_THAT(CommandText(step.commands[0]), HasSubstr("--ImageReader.camera_params 70,70,32,20"));
  EXPECT_THAT(CommandText(step.commands[1]), Not(HasSubstr("camera_params")));
  EXPECT_THAT(CommandText(step.commands[1]), HasSubstr("--ImageReader.camera_model SIMPLE_RADIAL"));
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

TEST_F(StepTableTest, HowScansAreReadAndTheLensGoesToEveryCommandThatAsks) {
  AddPhotos("a", 4, 64);
  for (const char* step : {"mapper", "align", "texture"}) {
    for (const char* option : {"max_range", "E57", "refine", "register", "strict"}) {
      EXPECT_THAT(Line(step), Not(HasSubstr(option))) << step;
    }
  }
  options_.max_range = 12.5;
  options_.e57_check = false;
  options_.refine_intrinsics = "0";
  options_.register_stations = options_.strict = true;
  EXPECT_THAT(Line("mapper"), HasSubstr("--refine_intrinsics 0"));
  for (const char* option : {"--max_range 12.5", "--E57.check 0", "--refine_intrinsics 0",
                             "--register_stations 1", "--strict 1"}) {
    EXPECT_THAT(Line("align"), HasSubstr(option));
    EXPECT_THAT(CommandText(Chain(options_).AutoCommand()), HasSubstr(option));
  }
  EXPECT_THAT(Line("texture"), HasSubstr("--E57.check 0"));
  EXPECT_THAT(Line("texture"), HasSubstr("--strict 1"));
  EXPECT_THAT(Line("texture"), Not(HasSubstr("--max_range")));  // the aligned model remembers it
}

TEST_F(StepTableTest, PicksAreMadeInAllModels) {
  AddPhotos("a", 4, 64);
  const auto pick = [this] { return CommandText(Chain(options_).PickCommand()); };
  EXPECT_THAT(pick(), Not(HasSubstr("--input_path")));  // there is none yet
  for (const char* number : {"0", "1"}) {
    const std::string model = folder_ / "result/sparse/" + number;
    fs::create_directories(model);
    WriteBytes(model + "/roomtex-mapper.json", std::string("{\"model\": ") + number + "}");
  }
  EXPECT_THAT(pick(), HasSubstr("--input_path " + (folder_ / "result/sparse/0") + " --input_path " +
                                (folder_ / "result/sparse/1")));
  // Both are what the mapper left: without one it runs again.
  EXPECT_THAT(Make("mapper").outputs, Contains(folder_ / "result/sparse/1"));
}

TEST_F(StepTableTest, TheCommandToStartAgainGivesTheSame) {
  AddPhotos("a", 4, 64);
  options_.random_seed = 7;
  options_.num_threads = 2;
  options_.accept_untrusted = true;
  const std::string again = CommandText(Chain(options_).AutoCommand());
  for (const char* option : {"--random_seed 7", "--num_threads 2", "--accept_untrusted 1"}) {
    EXPECT_THAT(again, HasSubstr(option));
  }
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
  AddPhotos("a", 3, 64);
  fs::create_directories(folder_ / "result");
  EXPECT_THAT(Line("align"), Not(HasSubstr("picks_path")));
  WriteBytes(folder_ / "result/picks.csv", "");
  EXPECT_THAT(Line("align"), HasSubstr("--picks_path " + (folder_ / "result/picks.csv")));
  options_.picks_path = "mine.csv";
  EXPECT_THAT(Line("align"), HasSubstr("--picks_path mine.csv"));
}

TEST_F(StepTableTest, APlaceThatAPhotoShowsGoesToTheSearch) {
  AddPhotos("a", 3, 64);
  EXPECT_THAT(Line("align"), Not(HasSubstr("--near")));
  options_.near = "a100.jpg,1,-2.5,0";
  EXPECT_THAT(Line("align"), HasSubstr("--near a100.jpg,1,-2.5,0"));
  EXPECT_THAT(CommandText(Chain(options_).AutoCommand()), HasSubstr("--near a100.jpg,1,-2.5,0"));
  EXPECT_THAT(options_.Problems(), IsEmpty());
  options_.image_path.clear();
  EXPECT_THAT(options_.Problems(), Contains(HasSubstr("--near says where photos of yours")));
}

TEST_F(StepTableTest, AllModelsOfTheMapperArePutIntoTheScan) {
  AddPhotos("a", 12, 64);
  const auto model = [&](int number) {
    return std::string(folder_ / ("result/sparse/" + std::to_string(number)));
  };
  const auto make = [&](int number, int said) {
    fs::create_directories(model(number));
    WriteBytes(model(number) + "/roomtex-mapper.json", "{\"model\": " + std::to_string(said) + "}");
  };
  make(1, 1);
  make(2, 1);  // a copy that somebody made
  EXPECT_THAT(Line("align"), HasSubstr("--input_path " + model(0) + " --input_path " + model(1)));
  EXPECT_THAT(Line("align"), Not(HasSubstr(model(2))));
  EXPECT_THAT(Make("align").inputs, Contains(model(1)));
}

TEST_F(StepTableTest, OnePhotoIsPlacedByItselfWithoutAModel) {
  AddPhotos("a", 1, 64);
  options_.camera_model = "OPENCV";
  options_.camera_params = "70,70,32,20,0,0,0,0";
  EXPECT_THAT(Applying(), ElementsAre("align", "texture", "pictures", "report"));
  EXPECT_THAT(Line("align"), Not(HasSubstr("--input_path")));
  EXPECT_THAT(Line("align"), HasSubstr("--camera_model OPENCV --camera_params 70,70,32,20"));
  options_.near = "a100.jpg,1,-2.5,0";
  EXPECT_THAT(Line("align"), HasSubstr("--near a100.jpg,1,-2.5,0"));
  options_.near.clear();
  // Two, and picks in one of them: by a model, which picks in one photo place.
  AddPhotos("b", 1, 64);
  EXPECT_THAT(Applying(), Not(Contains("mapper")));
  options_.picks_path = "mine.csv";
  EXPECT_THAT(Applying(), Contains("mapper"));
  EXPECT_THAT(Line("align"), HasSubstr("--input_path"));
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
