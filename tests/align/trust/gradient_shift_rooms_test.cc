#include <gtest/gtest.h>

#include "tests/align/trust/exposed_room.h"

namespace roomtex {
namespace {

// A right alignment never contradicts and a wrong one never supports.
TEST(GradientShift, IsNeverFalseOverTenRooms) {
  const RoomVerdicts verdicts = JudgeRooms({0, 1, 2, 3, 4, 5, 6, 7, 8, 9});
  EXPECT_EQ(verdicts.false_contradictions, 0);
  EXPECT_EQ(verdicts.false_supports, 0);
  EXPECT_GE(verdicts.supports, 9);
  EXPECT_GE(verdicts.contradictions, 25);  // of 40, with four small photos
  RecordProperty("supports_of_10", verdicts.supports);
  RecordProperty("contradictions_of_40", verdicts.contradictions);
}

}  // namespace
}  // namespace roomtex
