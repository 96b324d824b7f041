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

  // What roomtex-align left: a model, with its report beside it and in the log.
  void AddAligned(const std::string& name, bool trusted) {
    const std::string report = trusted ? R"({"trusted": true})" : R"({"trusted": false})";
    fs::create_directories(folder_ / ("result/" + name));
    fs::create_directories(folder_ / "result/log");
    WriteBytes(folder_ / ("result/" + name + "/images.bin"), "a model");
    WriteBytes(folder_ / ("result/" + name + "/alignment.json"), report);
    WriteBytes(folder_ / "result/log/align.json", report);
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

// Features take hours: they are not made anew since somebody has looked at the photos, or written
// notes beside them.
TEST_F(StepTableTest, OnlyPhotosInTheFolderOfPhotosCount) {
  WriteBytes(folder_ / "colmap", std::string(kColmap38) +
                                     "for word; do [ \"$last\" = --database_path ] && echo >$word; "
                                     "last=$word; done\ntrue\n");
  AddPhotos("a", 3, 64);
  WriteBytes(folder_ / "room.ptx", "1\n");
  const auto start = [this] {
    const CommandResult result =
        RunCommandLine("roomtex-auto --until features --image_path " + options_.image_path +
                       " --scan_path " + (folder_ / "room.ptx") + " --output_path " +
                       options_.output_path + " --colmap " + options_.colmap);
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

// The list of contents of an E57 in its pages, without checksums and points.
std::string E57WithList(const std::string& list) {
  constexpr size_t kPageBytes = 1020;
  std::string content(48, '\0');
  const auto put = [&content](size_t at, uint64_t value) {
    std::memcpy(content.data() + at, &value, sizeof value);
  };
  content.replace(0, 8, "ASTM-E57");
  const size_t filling = 1500;  // the list begins in the middle of the second page
  content.resize(filling, 'x');
  put(24, filling + 4);
  put(32, list.size());
  put(40, 1024);
  content += list;
  content.resize((content.size() + kPageBytes - 1) / kPageBytes * kPageBytes);
  std::string pages;
  for (size_t at = 0; at < content.size(); at += kPageBytes) {
    pages += content.substr(at, kPageBytes) + "????";
  }
  return pages;
}
std::string ListOfPhotos(const std::string& photos) {
  return "<?xml version=\"1.0\"?><e57Root><data3D><vectorChild><pose></pose></vectorChild></data3D>"
         "<images2D type=\"Vector\">" +
         std::string(1200, ' ') + photos + "</images2D></e57Root>";
}
constexpr char kPosed[] =
    "<vectorChild type=\"Structure\"><pose/><pinholeRepresentation/></vectorChild>";
constexpr char kNotPosed[] =
    "<vectorChild type=\"Structure\"><pinholeRepresentation/></vectorChild>"
    "<vectorChild type=\"Structure\"><pose/><visualReferenceRepresentation/></vectorChild>";

TEST(ScannerPhotosInE57, AreThoseWithPoseAndCamera) {
  const TempFolder folder;
  const auto holds = [&folder](const std::string& bytes) {
    WriteBytes(folder / "scan.e57", bytes);
    return HoldsPosedPhotos(folder / "scan.e57");
  };
  EXPECT_TRUE(holds(E57WithList(ListOfPhotos(std::string(kNotPosed) + kPosed))));
  EXPECT_FALSE(holds(E57WithList(ListOfPhotos(kNotPosed))));
  EXPECT_FALSE(holds(E57WithList(ListOfPhotos(""))));
  EXPECT_FALSE(holds(E57WithList("<e57Root/>")));
  const std::string whole = E57WithList(ListOfPhotos(kPosed));
  for (size_t size = 0; size < 2100; size += 97) EXPECT_FALSE(holds(whole.substr(0, size))) << size;
  std::string endless = whole;
  endless.replace(32, 8, std::string(8, '\xff'));
  EXPECT_FALSE(holds(endless));
  EXPECT_FALSE(HoldsPosedPhotos(folder / "none.e57"));
  EXPECT_FALSE(HoldsPosedPhotos(folder.path()));
}

// What roomtex-import would have reported.
constexpr char kScannerReport[] =
    "{\"cameras\": [{\"model\": \"PINHOLE\", \"width\": 9, \"height\": 6, \"params\": [7.5, 7, "
    "4.5, 3],"
    " \"images\": [\"a.jpg\", \"pano/face_1.jpg\"]}]}";

class ScannerStepTest : public StepTableTest {
 protected:
  void SetUp() override {
    StepTableTest::SetUp();
    WriteBytes(folder_ / "site.e57", E57WithList(ListOfPhotos(kPosed)));
    options_.scan_paths = {"other.ptx", (folder_ / "site.e57") + "#2"};
    fs::create_directories(folder_ / "result/log");
  }
  void ScannerHasRun(const std::string& report) {
    WriteBytes(folder_ / "result/log/scanner.json", report);
    fs::create_directories(folder_ / "result/with_scanner");
    fs::copy(folder_ / "photos", folder_ / "result/with_scanner",
             fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  }
};

// A scan of a file whose name has a # of its own.
TEST_F(ScannerStepTest, AreFoundInAFileWithAHashInItsName) {
  const std::string file = folder_ / "b#1.e57";
  fs::copy(folder_ / "site.e57", file);
  options_.scan_paths = {file + "#2"};
  EXPECT_EQ(Applying().front(), "scanner");
  EXPECT_THAT(Make("scanner").inputs, ElementsAre(file, folder_ / "photos"));
}

TEST_F(ScannerStepTest, TheirPosesGoToTheMapper) {
  AddPhotos("a", 4, 60);
  EXPECT_EQ(Applying().front(), "scanner");
  const Step scanner = Make("scanner");
  EXPECT_EQ(CommandText(scanner.commands.back()),
            "roomtex-import --input_path " + CommandText({(folder_ / "site.e57") + "#2"}) +
                " --images_path " + (folder_ / "result/with_scanner/scanner") + " --report_path " +
                (folder_ / "result/log/scanner.json") + " --E57.cut_panoramas 1");
  ScannerHasRun(kScannerReport);
  const Step features = Make("features");
  ASSERT_EQ(features.commands.size(), 2u);
  EXPECT_EQ(features.files[0].second, "a100.jpg\na101.jpg\na102.jpg\na103.jpg\n");
  EXPECT_EQ(features.files[1].second, "scanner/a.jpg\nscanner/pano/face_1.jpg\n");
  EXPECT_THAT(CommandText(features.commands[1]),
              HasSubstr("--ImageReader.camera_params 7.5,7,4.5,3"));
  for (const char* step : {"features", "mapper", "align"}) {
    EXPECT_THAT(Line(step), HasSubstr("--image_path " + (folder_ / "result/with_scanner"))) << step;
  }
  EXPECT_THAT(Line("mapper"),
              HasSubstr("--known_path " + (folder_ / "result/with_scanner/scanner/sparse")));
}

TEST_F(ScannerStepTest, OptionsForTheUsersLensAreNotForTheirs) {
  AddPhotos("a", 4, 60);
  ScannerHasRun(kScannerReport);
  options_.passed.features = {"--ImageReader.camera_params", "1,2,3,4",
                              "--SiftExtraction.peak_threshold", "0.01"};
  EXPECT_THAT(Line("features", 0), HasSubstr("camera_params 1,2,3,4"));
  EXPECT_THAT(Line("features", 1), Not(HasSubstr("1,2,3,4")));
  EXPECT_THAT(Line("features", 1), HasSubstr("peak_threshold"));
}

TEST_F(ScannerStepTest, AreLeftOutWhereTheyHaveNoPlaceOrAreNotWanted) {
  AddPhotos("a", 4, 60);
  ScannerHasRun("{\"cameras\": []}");
  EXPECT_THAT(Line("mapper"), Not(HasSubstr("known_path")));
  EXPECT_THAT(Line("features"), HasSubstr("--image_path " + (folder_ / "photos")));
  ScannerHasRun(kScannerReport);
  options_.scanner_photos = "0";
  EXPECT_EQ(Applying().front(), "features");
  EXPECT_THAT(Line("mapper"), Not(HasSubstr("known_path")));
  options_.scanner_photos = "auto";
  options_.scan_poses = "poses.txt";
  EXPECT_EQ(Applying().front(), "features");
}

TEST_F(ScannerStepTest, AFolderOfTheUserKeepsItsName) {
  AddPhotos("a", 4, 60);
  fs::create_directories(folder_ / "photos/scanner");
  EXPECT_THAT(CommandText(Make("scanner").commands.back()),
              HasSubstr("--images_path " + (folder_ / "result/with_scanner/scanner_ ")));
}

TEST_F(ScannerStepTest, WithoutPhotosOfTheUserTheirsColourTheScan) {
  options_.image_path.clear();
  EXPECT_THAT(options_.Problems(), IsEmpty());
  EXPECT_THAT(Applying(), ElementsAre("scanner", "texture", "pictures", "report"));
  EXPECT_THAT(Line("scanner", 1), Not(HasSubstr("cut_panoramas")));
  const std::string line = Line("texture");
  EXPECT_THAT(line, HasSubstr("--input_path " + (folder_ / "result/scanner/sparse ")));
  EXPECT_THAT(line, HasSubstr("--image_path " + (folder_ / "result/scanner ")));
  EXPECT_THAT(line, HasSubstr("--scan_path other.ptx --scan_path"));
}

TEST_F(ScannerStepTest, AScanIsNotWhereItsPhotosGo) {
  options_.image_path.clear();
  fs::create_directories(folder_ / "result/scanner");
  fs::rename(folder_ / "site.e57", folder_ / "result/scanner/site.e57");
  options_.scan_paths = {folder_ / "result/scanner/site.e57"};
  Chain chain(options_);
  EXPECT_THROW(RequireInputsApart(&chain), UsageError);
  options_.output_path = folder_ / "another";
  Chain apart(options_);
  RequireInputsApart(&apart);
}

TEST_F(ScannerStepTest, AskedForInVainTheyAreAProblem) {
  options_.scanner_photos = "1";
  EXPECT_THAT(options_.Problems(), IsEmpty());
  options_.scan_paths = {"other.ptx"};
  EXPECT_THAT(options_.Problems(), ElementsAre(HasSubstr("no scan is an E57 that has photos")));
  options_.image_path.clear();
  EXPECT_THAT(options_.Problems(), ElementsAre(HasSubstr("give one of --image_path")));
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
