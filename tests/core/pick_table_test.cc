#include "core/pick_table.h"

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

TEST(PickTable, LabelsStandBehindTheOtherColumnsInAnyOrder) {
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

TEST(PickTable, ReadsCommentsBlankLinesCarriageReturnsAndByteOrderMark) {
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

TEST(PickTable, CommentsMayStandBehindThem) {
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

TEST(PickTable, ReadsQuotedNamesWithCommasAndQuotes) {
  const std::vector<Pick> picks =
      ReadText(std::string(kHeader) + "\"hall, \"\"north\"\".jpg\" ,1,2,3,4,5\n");
  ASSERT_EQ(picks.size(), 1u);
  EXPECT_EQ(picks[0].image_name, "hall, \"north\".jpg");
}

TEST(PickTable, ReadsAndWritesWeights) {
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

TEST(PickTable, RefusesWeightsThatAreNone) {
  const std::string header = "image_name,x,y,scan_x,scan_y,scan_z,weight\n";
  EXPECT_INPUT_ERROR(ReadText(header + "a.jpg,1,2,3,4,5,-1\n"), "line 2: weight is \"-1\"");
  EXPECT_INPUT_ERROR(ReadText(header + "a.jpg,1,2,3,4,5,nan\n"), "weight is \"nan\"");
  EXPECT_INPUT_ERROR(ReadText(header + "a.jpg,1,2,3,4,5\n"), "found 6 fields, expected 7");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a.jpg,1,2,3,4,5,1\n"),
                     "found 7 fields, expected 6");
}

TEST(PickTable, ReadsBackWhatItWroteToTheLastBit) {
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

TEST(PickTable, RefusesMissingFile) {
  EXPECT_INPUT_ERROR(ReadPicks("/nonexistent/picks.csv"), "/nonexistent/picks.csv");
}

TEST(PickTable, RefusesFolder) {
  const TempFolder folder;
  EXPECT_INPUT_ERROR(ReadPicks(folder.path()), folder.path());
}

TEST(PickTable, RefusesEmptyFile) { EXPECT_INPUT_ERROR(ReadText("# nothing\n"), "holds no picks"); }

TEST(PickTable, RefusesMissingHeaderAndSaysWhatItShouldBe) {
  EXPECT_INPUT_ERROR(ReadText("a.jpg,1,2,3,4,5\n"), "line 1: the header is missing");
  EXPECT_INPUT_ERROR(ReadText("name,u,v\n"), "image_name,x,y,scan_x,scan_y,scan_z");
}

TEST(PickTable, RefusesBinaryFile) {
  EXPECT_INPUT_ERROR(ReadText(std::string("\x89PNG\0\0\0", 7)), "line 1");
}

TEST(PickTable, RefusesWrongNumberOfFieldsWithItsLine) {
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a.jpg,1,2,3,4\n"), "line 2: found 5 fields");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a.jpg,1,2,3,4,5,\n"),
                     "line 2: found 7 fields");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a.jpg;1;2;3;4;5\n"),
                     "line 2: found 1 fields");
}

TEST(PickTable, RefusesWhatIsNoFiniteNumber) {
  for (const char* bad : {"nan", "inf", "1e999", "x", "", "1.5px", "0x10"}) {
    const std::string text = std::string(kHeader) + "# c\na.jpg,1,2,3," + bad + ",5\n";
    EXPECT_INPUT_ERROR(ReadText(text), "line 3: scan_y");
  }
}

TEST(PickTable, RefusesOpenQuoteAndEmptyName) {
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "\"a.jpg,1,2,3,4,5\n"), "not closed");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + ",1,2,3,4,5\n"), "line 2");
}

TEST(PickTable, RefusesDuplicatesWithBothLines) {
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a,1,2,3,4,5\na,1,2,3,4,5\n"),
                     "line 3: the same pick of a stands on line 2");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a,1,2,3,4,5\na,1,2,3,4,6\n"),
                     "the same pixel");
  EXPECT_INPUT_ERROR(ReadText(std::string(kHeader) + "a,1,2,3,4,5\na,1,9,3,4,5\n"),
                     "the same scan point");
  EXPECT_EQ(ReadText(std::string(kHeader) + "a,1,2,3,4,5\nb,1,2,3,4,5\n").size(), 2u);
}

}  // namespace
}  // namespace roomtex
