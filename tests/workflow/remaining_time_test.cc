#include "workflow/remaining_time.h"

#include <gtest/gtest.h>

namespace roomtex {
namespace {

TEST(ShareOfLine, ReadsWhatColmapPrints) {
  EXPECT_DOUBLE_EQ(ShareOfLine("Processed file [3/12]"), 0.25);
  EXPECT_DOUBLE_EQ(
      ShareOfLine("I20260101 10:00:00.1 7 feature_extraction.cc:254] Processed file [6/12]"), 0.5);
  EXPECT_DOUBLE_EQ(ShareOfLine("Matching block [1/2, 1/2] in 15.670s"), 0.25);
  EXPECT_DOUBLE_EQ(ShareOfLine("Matching block [2/2, 2/2] in 3.1s"), 1.0);
  EXPECT_DOUBLE_EQ(ShareOfLine("Matching image [5/10] in 0.1s"), 0.5);
}

TEST(ShareOfLine, ReadsWhichOfSeveralModelsIsAlignedNow) {
  EXPECT_DOUBLE_EQ(ShareOfLine("  sparse model [1/4]: sparse/0 (12 photos)"), 0);
  EXPECT_DOUBLE_EQ(ShareOfLine("  sparse model [4/4]: [1/2]/3 (12 photos)"), 0.75);
}

TEST(ShareOfLine, IsUnknownForOtherLines) {
  for (const char* line :
       {"", "  Features:        4114", "[1/2]", "Processed file [a/b]", "Processed file [1/0]"}) {
    EXPECT_LT(ShareOfLine(line), 0) << line;
  }
}

TEST(RemainingTime, FallsAsStepsEndAndAsOneGoesOn) {
  RemainingTime time;
  time.SetPhotos(20, 2);
  time.SetSteps({"features", "matches", "mapper"}, {});
  const double all = time.Seconds("features", -1, 0);
  const double later = time.Seconds("features", 0.9, 10);
  EXPECT_GT(all, 0);
  EXPECT_LT(later, all);
  time.Finish("features", time.Expected("features"));
  EXPECT_NEAR(time.Seconds("matches", -1, 0), time.Expected("matches") + time.Expected("mapper"),
              1e-9);
}

TEST(RemainingTime, ASlowMachineIsSlowInTheNextStepToo) {
  RemainingTime time;
  time.SetPhotos(20, 2);
  time.SetSteps({"features", "matches"}, {});
  const double before = time.Expected("matches");
  time.Finish("features", 3 * time.Expected("features"));
  EXPECT_NEAR(time.Expected("matches"), 3 * before, 1e-9);
}

TEST(RemainingTime, StepsThatHaveNotToRunSayNothingOfTheMachine) {
  RemainingTime time;
  time.SetPhotos(20, 2);
  time.SetSteps({"features", "matches", "mapper"}, {});
  const double before = time.Expected("mapper");
  time.Drop("features");
  time.Drop("matches");
  EXPECT_DOUBLE_EQ(time.Expected("mapper"), before);
  EXPECT_DOUBLE_EQ(time.Seconds("mapper", -1, 0), before);
}

TEST(RemainingTime, BelievesTheLastRunMostOfAll) {
  RemainingTime time;
  time.SetSteps({"features", "matches"}, {{"matches", 77}});
  time.Finish("features", 1000);
  EXPECT_DOUBLE_EQ(time.Expected("matches"), 77);
}

TEST(RemainingTime, AStepThatSaysHowFarItIsIsJudgedByThat) {
  RemainingTime time;
  time.SetSteps({"features"}, {{"features", 1000}});
  EXPECT_DOUBLE_EQ(time.Seconds("features", 0.5, 20), 20);
}

TEST(DurationText, HasAUnitThatFits) {
  EXPECT_EQ(DurationText(0.2), "1 s");
  EXPECT_EQ(DurationText(75), "75 s");
  EXPECT_EQ(DurationText(600), "10 min");
  EXPECT_EQ(DurationText(9000), "2.5 h");
}

}  // namespace
}  // namespace roomtex
