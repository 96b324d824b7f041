#include "align/clicks/picks.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

constexpr char kHeader[] = "image_name,x,y,scan_x,scan_y,scan_z\n";

std::vector<Pick> ReadText(const std::string& text) {
  const TempFolder folder;
  WriteBytes(folder / "picks.csv", text);
  return ReadPicks(folder / "picks.csv");
}

SparseModel ModelWith(const std::vector<std::string>& names) {
  SparseModel model;
  model.cameras[1] = {1, CameraModel::kPinhole, 640, 480, {500, 500, 320, 240}};
  for (const std::string& name : names) {
    SparseImage image;
    image.image_id = static_cast<uint32_t>(model.images.size()) + 1;
    image.camera_id = 1;
    image.name = name;
    model.images[image.image_id] = image;
  }
  return model;
}

std::vector<Pick> PicksOf(const std::string& name, int count) {
  std::vector<Pick> picks;
  for (int i = 0; i < count; ++i) {
    picks.push_back({name, {10.0 * i, 20.0 + i}, {1.0 * i, 2.0, 3.0}, i + 2});
  }
  return picks;
}

TEST(Picks, LabelsStandBehindTheOtherColumnsInAnyOrder) {
  const TempFolder folder;
  const std::string header = "image_name,x,y,scan_x,scan_y,scan_z,";
  for (const std::string& text :
       {header + "label,weight\na.jpg,1,2,3,4,5,\"door, left\",0\nb.jpg,1,2,3,4,5,,1\n",
        header + "weight,label\na.jpg,1,2,3,4,5,0,\"door, left\"\nb.jpg,1,2,3,4,5,1,\n"}) {
    WriteBytes(folder / "a.csv", text);
    const std::vector<Pick> picks = ReadPicks(folder / "a.csv");
    ASSERT_EQ(picks.size(), 2u);
    EXPECT_EQ(picks[0].label, "door, left");
    EXPECT_EQ(picks[0].weight, 0);
    EXPECT_EQ(picks[1].label, "");
    EXPECT_EQ(picks[1].weight, 1);
    WritePicks(folder / "b.csv", picks);
    EXPECT_EQ(ReadPicks(folder / "b.csv")[0].label, "door, left");
  }
  WriteBytes(folder / "c.csv", header + "label,label\na.jpg,1,2,3,4,5,a,b\n");
  EXPECT_INPUT_ERROR(ReadPicks(folder / "c.csv"), "where the header of a picks file should be");
}

TEST(Picks, ReadsCommentsBlankLinesCarriageReturnsAndByteOrderMark) {
  const std::vector<Pick> picks = ReadText(
      "\xef\xbb\xbf# made by hand\r\n image_name, x ,y,scan_x,scan_y,scan_z\r\n\r\n"
      "a.jpg, 12.5 ,+7,-1,2e-1,.5\r\n  # between\r\nb.jpg,1,2,3,4,5");
  ASSERT_EQ(picks.size(), 2u);
  EXPECT_EQ(picks[0].image_name, "a.jpg");
  EXPECT_EQ(picks[0].x_in_img, Eigen::Vector2d(12.5, 7));
  EXPECT_EQ(picks[0].x_in_scan, Eigen::Vector3d(-1, 0.2, 0.5));
  EXPECT_EQ(picks[0].line, 4);
  EXPECT_EQ(picks[1].line, 6);
}

TEST(Picks, CommentsMayStandBehindThem) {
  const std::vector<Pick> picks = ReadText(
      "image_name,x,y,scan_x,scan_y,scan_z,weight,label # by hand\n"
      "hall #2.jpg,1,2,3,4,5,2,door # left, lower\n"
      "b.jpg,1,2,3,4,6,0.5,\"corner #3\" # \"sure\"\n");
  ASSERT_EQ(picks.size(), 2u);
  EXPECT_EQ(picks[0].image_name, "hall #2.jpg");
  EXPECT_EQ(picks[0].weight, 2);
  EXPECT_EQ(picks[0].label, "door");
  EXPECT_EQ(picks[1].label, "corner #3");
  const std::vector<Pick> plain = ReadText(std::string(kHeader) + "a.jpg,1,2,3,4,5 # six fields\n");
  ASSERT_EQ(plain.size(), 1u);
  EXPECT_EQ(plain[0].x_in_scan.z(), 5);
}

TEST(Picks, ReadsQuotedNamesWithCommasAndQuotes) {
  const std::vector<Pick> picks =
      ReadText(std::string(kHeader) + "\"hall, \"\"north\"\".jpg\" ,1,2,3,4,5\n");
  ASSERT_EQ(picks.size(), 1u);
  EXPECT_EQ(picks[0].image_name, "hall, \"north\".jpg");
}

TEST(Picks, ReadsAndWritesWeights) {
  const TempFolder folder;
  WriteBytes(folder / "a.csv",
             "image_name,x,y,scan_x,scan_y,scan_z,Weight\na.jpg,1,2,3,4,5,0.25\n"
             "a.jpg,2,2,3,4,6,0\n");
  const std::vector<Pick> picks = ReadPicks(folder / "a.csv");
  ASSERT_EQ(picks.size(), 2u);
  EXPECT_EQ(picks[0].weight, 0.25);
  EXPECT_EQ(picks[1].weight, 0);
  WritePicks(folder / "b.csv", picks);
  EXPECT_EQ(ReadPicks(folder / "b.csv")[0].weight, 0.25);
}

TEST(Picks, RefusesWeightsThatAreNone) {
  const std::string header = "image_name,x,y,scan_x,scan_y,scan_z,weight\n";
  EXPECT_INPUT_ERROR(ReadText(header + "a.jpg,1,2,3,4,5,-1\n"), "line 2: weight is \"-1\"");
  EXPECT_INPUT_ERROR(ReadText(header + "a.jpg,1,2,3,4,5,nan\n"), "weight is \"nan\"");
  EXPECT_INPUT_ERROR(ReadText(header + "a.jpg,1,2,3,4,5\n"), "found 6 fields, expected 7");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a.jpg,1,2,3,4,5,1\n"),
                     "found 7 fields, expected 6");
}

TEST(Picks, ThoseSwitchedOffDoNotCount) {
  std::vector<Pick> picks = PicksOf("a.jpg", 6);
  picks[4].weight = 0;
  EXPECT_INPUT_ERROR(CheckPicksAgainstModel("picks.csv", picks, ModelWith({"a.jpg"})),
                     "6 picks, of which 5 count");
}

TEST(Picks, ReadsBackWhatItWroteToTheLastBit) {
  const TempFolder folder;
  const std::vector<Pick> picks = {{"a, b#\".jpg", {0.1, 1.0 / 3}, {1e-17, -2.0 / 7, 1e9}, 0},
                                   {"#c.jpg", {5, 6}, {7, 8, 9}, 0}};
  WritePicks(folder / "picks.csv", picks);
  const std::vector<Pick> again = ReadPicks(folder / "picks.csv");
  ASSERT_EQ(again.size(), picks.size());
  for (size_t i = 0; i < picks.size(); ++i) {
    EXPECT_EQ(again[i].image_name, picks[i].image_name);
    EXPECT_EQ(again[i].x_in_img, picks[i].x_in_img);
    EXPECT_EQ(again[i].x_in_scan, picks[i].x_in_scan);
  }
}

TEST(Picks, RefusesMissingFile) {
  EXPECT_INPUT_ERROR(ReadPicks("/nonexistent/picks.csv"), "/nonexistent/picks.csv");
}

TEST(Picks, RefusesFolder) {
  const TempFolder folder;
  EXPECT_INPUT_ERROR(ReadPicks(folder.path()), folder.path());
}

TEST(Picks, RefusesEmptyFile) { EXPECT_INPUT_ERROR(ReadText("# nothing\n"), "holds no picks"); }

TEST(Picks, RefusesMissingHeaderAndSaysWhatItShouldBe) {
  EXPECT_INPUT_ERROR(ReadText("a.jpg,1,2,3,4,5\n"), "line 1: the header is missing");
  EXPECT_INPUT_ERROR(ReadText("name,u,v\n"), "image_name,x,y,scan_x,scan_y,scan_z");
}

TEST(Picks, RefusesBinaryFile) {
  EXPECT_INPUT_ERROR(ReadText(std::string("\x89PNG\0\0\0", 7)), "line 1");
}

TEST(Picks, RefusesWrongNumberOfFieldsWithItsLine) {
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a.jpg,1,2,3,4\n"), "line 2: found 5 fields");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a.jpg,1,2,3,4,5,\n"),
                     "line 2: found 7 fields");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a.jpg;1;2;3;4;5\n"),
                     "line 2: found 1 fields");
}

TEST(Picks, RefusesWhatIsNoFiniteNumber) {
  for (const char* bad : {"nan", "inf", "1e999", "x", "", "1.5px", "0x10"}) {
    const std::string text = std::string(kHeader) + "# c\na.jpg,1,2,3," + bad + ",5\n";
    EXPECT_INPUT_ERROR(ReadText(text), "line 3: scan_y");
  }
}

TEST(Picks, RefusesOpenQuoteAndEmptyName) {
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "\"a.jpg,1,2,3,4,5\n"), "not closed");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + ",1,2,3,4,5\n"), "line 2");
}

TEST(Picks, RefusesDuplicatesWithBothLines) {
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a,1,2,3,4,5\na,1,2,3,4,5\n"),
                     "line 3: the same pick of a stands on line 2");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a,1,2,3,4,5\na,1,2,3,4,6\n"),
                     "the same pixel");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a,1,2,3,4,5\na,1,9,3,4,5\n"),
                     "the same scan point");
  EXPECT_EQ(ReadText(std::string(kHeader) + "a,1,2,3,4,5\nb,1,2,3,4,5\n").size(), 2u);
}

TEST(Picks, NamesTheNearestPhotoForOneThatIsNotInTheModel) {
  const SparseModel model = ModelWith({"left/a1.jpg", "left/a2.jpg", "right/b.jpg"});
  EXPECT_INPUT_ERROR(CheckPicksAgainstModel("p.csv", PicksOf("right/B.JPG", 6), model),
                     "nearest name: right/b.jpg");
}

TEST(Picks, TakeTheNameOfTheOnlyPhotoThatHasItInAFolder) {
  const SparseModel model = ModelWith(
      {"scanner/a.jpg", "mine/b.jpg", "scanner/b.jpg", "c.jpg", "mine/c.jpg", "mine/not-d.jpg"});
  std::vector<Pick> picks;
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg", "d.jpg", "mine/b.jpg", "nowhere/a.jpg"}) {
    picks.push_back(PicksOf(name, 1)[0]);
  }
  NamePicksAsInModels({&model}, &picks);
  std::vector<std::string> names;
  for (const Pick& pick : picks) names.push_back(pick.image_name);
  EXPECT_EQ(names, (std::vector<std::string>{"scanner/a.jpg", "b.jpg", "c.jpg", "d.jpg",
                                             "mine/b.jpg", "nowhere/a.jpg"}));
}

TEST(Picks, OfSeveralModelsBelongToTheOneThatHoldsTheirPhoto) {
  const SparseModel left = ModelWith({"left/a.jpg", "left/b.jpg", "c.jpg"});
  const SparseModel right = ModelWith({"right/a.jpg", "right/d.jpg", "other/c.jpg"});
  std::vector<Pick> picks;
  for (const char* name : {"d.jpg", "b.jpg", "c.jpg"}) picks.push_back(PicksOf(name, 1)[0]);
  NamePicksAsInModels({&left, &right}, &picks);
  EXPECT_EQ(picks[0].image_name, "right/d.jpg");
  EXPECT_EQ(picks[1].image_name, "left/b.jpg");
  EXPECT_EQ(picks[2].image_name, "c.jpg");
  EXPECT_NO_THROW(CheckPickNames("p.csv", picks, {&left, &right}));
  std::vector<Pick> either = PicksOf("a.jpg", 1);
  NamePicksAsInModels({&left, &right}, &either);
  EXPECT_INPUT_ERROR(CheckPickNames("p.csv", either, {&left, &right}), "the photo a.jpg is not in");
}

TEST(Picks, RefusesPixelOutsideThePhoto) {
  std::vector<Pick> picks = PicksOf("a.jpg", 6);
  picks[3].x_in_img.x() = 640.5;
  EXPECT_INPUT_ERROR(CheckPicksAgainstModel("p.csv", picks, ModelWith({"a.jpg"})), "line 5");
  picks[3].x_in_img.x() = 640;
  EXPECT_NO_THROW(CheckPicksAgainstModel("p.csv", picks, ModelWith({"a.jpg"})));
}

TEST(Picks, SixSpreadOverPhotosAreEnoughAndFiveAreNot) {
  std::vector<Pick> picks = PicksOf("a.jpg", 3);
  for (const Pick& pick : PicksOf("b.jpg", 2)) picks.push_back(pick);
  const SparseModel model = ModelWith({"a.jpg", "b.jpg"});
  EXPECT_INPUT_ERROR(CheckPicksAgainstModel("p.csv", picks, model), "holds 5 picks; at least 6");
  picks.push_back({"b.jpg", {1, 1}, {9, 9, 9}, 12});
  EXPECT_NO_THROW(CheckPicksAgainstModel("p.csv", picks, model));
}

}  // namespace
}  // namespace roomtex
