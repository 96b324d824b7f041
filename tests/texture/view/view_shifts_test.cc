#include "texture/view/view_shifts.h"

#include <fstream>

#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

std::map<std::string, Json> ShiftsOf(const std::string& report) {
  const TempFolder folder;
  std::ofstream(folder / "report.json") << report;
  return ReadViewShifts(folder.path());
}

TEST(ViewShifts, AreThoseOfTheReport) {
  const auto shifts = ShiftsOf(R"({"images": [
    {"name": "a.jpg", "shift_px": {"before": 2.5, "after": 0.5}, "shift_before_mm": 7.5,
     "share_measured": 0.9, "shift_map_px": [[1, null], [2, 3]]},
    {"name": "alone.jpg", "shift_px": {"before": 0, "after": 0}, "shift_before_mm": 0,
     "share_measured": 0, "shift_map_px": [[null, null]]}]})");
  ASSERT_EQ(shifts.size(), 1u);
  const Json& a = shifts.at("a.jpg");
  EXPECT_EQ(a["before_px"], 2.5);
  EXPECT_EQ(a["after_px"], 0.5);
  EXPECT_EQ(a["before_mm"], 7.5);
  EXPECT_EQ(a["map_px"], Json::parse("[[1, null], [2, 3]]"));
}

TEST(ViewShifts, AreLeftOutWhereTheReportIsDamaged) {
  EXPECT_TRUE(ReadViewShifts("/nowhere").empty());
  for (const char* report : {"", "[", "[]", "{}", R"({"images": 3})", R"({"images": [1, {}]})",
                             R"({"images": [{"name": 1}]})", R"({"images": [{"name": "a"}]})",
                             R"({"images": [{"name": "a", "shift_px": {"before": "x", "after": 1},
                                 "shift_before_mm": 1, "share_measured": 1}]})",
                             R"({"images": [{"name": "a", "shift_px": {"before": -1, "after": 1},
                                 "shift_before_mm": 1, "share_measured": 1}]})"}) {
    EXPECT_TRUE(ShiftsOf(report).empty()) << report;
  }
  for (const char* map : {"3", "[3]", "[[]]", "[[1, 2], [3]]", R"([["1"]])", "[[-1]]"}) {
    const auto shifts = ShiftsOf(R"({"images": [{"name": "a", "shift_px": {"before": 2, "after": 1},
        "shift_before_mm": 1, "share_measured": 1, "shift_map_px": )" +
                                 std::string(map) + "}]}");
    ASSERT_EQ(shifts.size(), 1u) << map;
    EXPECT_TRUE(shifts.at("a")["map_px"].empty()) << map;
  }
}

}  // namespace
}  // namespace roomtex
