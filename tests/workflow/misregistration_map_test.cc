#include "workflow/misregistration_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace roomtex {
namespace {

using testing::HasSubstr;

size_t Count(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

TEST(MisregistrationMap, HasACellForEveryPartThatWasCompared) {
  const std::string map = MisregistrationMap({{0.0, nullptr, 1.0}, {0.5, 9.0, 3.21}});
  EXPECT_EQ(Count(map, "<rect"), 5u);
  EXPECT_EQ(Count(map, "rgb(59,120,181)"), 1u) << "in place";
  EXPECT_EQ(Count(map, "rgb(201,53,53)"), 2u) << "as red as can be";
  EXPECT_EQ(Count(map, "rgb(130,86,117)"), 1u) << "half of kWorstShift";
  EXPECT_THAT(map, HasSubstr("off by up to 9.0 px"));
  // Third column, first row.
  EXPECT_THAT(map, HasSubstr("x=\"14\" y=\"0\" width=\"7\" height=\"7\" fill=\"rgb(130,"));
}

TEST(MisregistrationMap, IsNoneWhereNothingWasCompared) {
  EXPECT_EQ(MisregistrationMap(nullptr), "");
  EXPECT_EQ(MisregistrationMap({{nullptr, nullptr}}), "");
}

}  // namespace
}  // namespace roomtex
