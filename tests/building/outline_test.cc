#include "building/outline.h"

#include <gmock/gmock.h>

#include "core/error.h"

namespace roomtex {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

Json Building(const std::string& name, double roof) {
  return {{"name", name},
          {"ground", 0},
          {"footprint", {{0, 0}, {10, 0}, {10, 8}, {0, 8}}},
          {"roof", {{{"point", {0, 0, roof}}, {"slope_deg", 0}, {"downhill_deg", 0}}}}};
}

// What the window opens with: a slip in one building does not hide the others.
TEST(ParseOutline, LeavesOutByNameWhatIsNoSolid) {
  Json file = OutlineToJson(Outline());
  file["buildings"] = {Building("a", 5), Building("sunken", -1), Building("a", 6),
                       Building("b", 7)};
  file["buildings"].push_back({{"name", "c"}});
  EXPECT_THROW(ParseOutline("town.json", file), InputError);
  std::vector<std::string> left_out;
  const Outline outline = ParseOutline("town.json", file, &left_out);
  ASSERT_EQ(outline.buildings.size(), 2u);
  EXPECT_EQ(outline.buildings[0].roof[0].point.z(), 5);
  EXPECT_EQ(outline.buildings[1].name, "b");
  EXPECT_THAT(left_out, ElementsAre(HasSubstr("town.json: building 2 (\"sunken\")"),
                                    HasSubstr("building 3: has the name of another one: \"a\""),
                                    HasSubstr("building 5 (\"c\"): lacks \"ground\"")));
  // A file that is no outline at all is none.
  file.erase("metric");
  EXPECT_THROW(ParseOutline("town.json", file, &left_out), InputError);
}

}  // namespace
}  // namespace roomtex
