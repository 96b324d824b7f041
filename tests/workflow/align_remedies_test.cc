// What roomtex-auto advises where roomtex-align is not sure, by the report of its search.

#include "workflow/align_remedies.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class AlignRemediesTest : public testing::Test {
 protected:
  void SetUp() override {
    options_.image_path = "photos";
    options_.scan_paths = {"room.ptx"};
    options_.output_path = folder_ / "result";
    fs::create_directories(folder_ / "result/sparse/0");
  }
  std::vector<std::string> Of(const std::string& verdict, bool hint_decides = false) {
    return OfReport({{"search", {{"verdict", verdict}, {"hint_decides", hint_decides}}}});
  }
  std::vector<std::string> OfReport(const Json& report) {
    return AlignRemedies(Chain(options_), report);
  }

  TempFolder folder_;
  AutoOptions options_;
};

TEST_F(AlignRemediesTest, WhereAHintDecidesItComesFirstWithTheCommandsToType) {
  const std::string pick = "roomtex-pick --input_path " + (folder_ / "result/sparse/0"),
                    again = "start again, it goes on from here: roomtex-auto --image_path photos";
  EXPECT_THAT(
      Of("unconfirmed", true),
      ElementsAre(AllOf(HasSubstr("are of one room, pick one point"), HasSubstr(": " + pick)),
                  HasSubstr(again),
                  AllOf(HasSubstr(": roomtex-auto"), HasSubstr(" --near PHOTO,X,Y,Z"))));
  EXPECT_THAT(Of("ambiguous", true),
              ElementsAre(HasSubstr("one point that photo and scan both show, where these places "
                                    "differ"),
                          HasSubstr(again), HasSubstr("where these places lie far apart")));
  // It was not enough; a pick is finer.
  options_.near = "a.jpg,1,2,3";
  EXPECT_THAT(Of("ambiguous", true), ElementsAre(HasSubstr("one point"), HasSubstr(again)));
}

TEST_F(AlignRemediesTest, WhereItDoesNotSixPicksOrTheRightScanDo) {
  for (const char* verdict : {"none", "weak", "open", "ambiguous", "photos contradict"}) {
    SCOPED_TRACE(verdict);
    const std::vector<std::string> remedies = Of(verdict);
    EXPECT_THAT(remedies, Each(AllOf(Not(HasSubstr("--near")), Not(HasSubstr("one point")))));
    ASSERT_GE(remedies.size(), 2u);
    EXPECT_THAT(remedies[remedies.size() - 2],
                AllOf(HasSubstr("six points"), HasSubstr(": roomtex-pick")));
    const bool may_be_another = std::string(verdict) != "open" && verdict[0] != 'a';
    EXPECT_EQ(remedies[0].find("of the same room") != std::string::npos, may_be_another);
  }
  EXPECT_THAT(Of("open")[0], HasSubstr("face different ways"));
}

TEST_F(AlignRemediesTest, AMirroredScanIsToBeReadTheOtherWay) {
  EXPECT_THAT(Of("mirrored"), ElementsAre(HasSubstr("Then start again")));
  options_.azimuth = "clockwise";
  const std::vector<std::string> remedies = Of("mirrored");
  EXPECT_THAT(remedies, ElementsAre(HasSubstr("without --azimuth")));
  EXPECT_THAT(remedies[0].substr(remedies[0].find(": roomtex-auto")), Not(HasSubstr("--azimuth")));
}

// By six picks nothing was searched for, and the picks are right.
TEST_F(AlignRemediesTest, AScanThatPicksShowToBeMirroredIsNoFaultOfThePicks) {
  WriteBytes(folder_ / "result/picks.csv", "");
  options_.azimuth = "counterclockwise";
  EXPECT_THAT(OfReport({{"search", nullptr}, {"mirrored", "scan"}}),
              ElementsAre(HasSubstr("without --azimuth")));
  // Those that were made on it are not.
  EXPECT_THAT(OfReport({{"search", nullptr}, {"mirrored", "scan and picks"}}),
              ElementsAre(AllOf(HasSubstr("Pick anew"), Not(HasSubstr("--azimuth"))),
                          HasSubstr("Then start again")));
}

TEST_F(AlignRemediesTest, AHintThatDidNotHelpIsToBeChecked) {
  options_.near = "a.jpg,1,2,3";
  EXPECT_THAT(Of("none")[1], HasSubstr("--near a.jpg,1,2,3"));
  options_.near.clear();
  WriteBytes(folder_ / "result/picks.csv", "");
  EXPECT_THAT(Of("ambiguous")[0], HasSubstr("add others, six in all"));
}

TEST_F(AlignRemediesTest, ScansThatDoNotFitTogetherAreToBeRegisteredFirst) {
  const Json report = {{"search", nullptr}, {"stations", {{{"agree", true}}, {{"agree", false}}}}};
  EXPECT_THAT(OfReport(report)[0], HasSubstr(" --register_stations 1"));
  options_.register_stations = true;
  EXPECT_THAT(OfReport(report)[0], HasSubstr("Pick six points"));
  options_.register_stations = false;
  EXPECT_THAT(OfReport({{"stations", {{{"agree", true}}}}})[0], HasSubstr("Pick six points"));
}

TEST_F(AlignRemediesTest, PicksWithoutASearchAreToBeMended) {
  WriteBytes(folder_ / "result/picks.csv", "");
  EXPECT_THAT(OfReport({{"search", nullptr}})[0], HasSubstr("Look at the picks and mend them: "));
  fs::remove(folder_ / "result/picks.csv");
  EXPECT_THAT(OfReport(Json()),
              ElementsAre(HasSubstr("Pick six points"), HasSubstr("start again")));
}

}  // namespace
}  // namespace roomtex
