// Photos that a scanner took and an E57 holds, in the chain of roomtex-auto.

#include <cstdint>
#include <cstring>
#include <filesystem>

#include <gmock/gmock.h>

#include "core/error.h"
#include "tests/workflow/step_table_fixture.h"
#include "workflow/output_folder.h"
#include "workflow/scanner_photos.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

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

}  // namespace
}  // namespace roomtex
