#include "core/json_text.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

std::string Nested(int depth) { return std::string(depth, '[') + std::string(depth, ']'); }

TEST(ParseJson, SaysWhereItIsNoJson) {
  EXPECT_EQ(ParseJson("{\"a\": [1, 2]}", "f.json", "Mend it")["a"][1], 2);
  EXPECT_INPUT_ERROR(ParseJson("{\"a\": 1,}", "f.json", "Mend it"),
                     "f.json: byte 9: is no JSON. Mend it");
  EXPECT_INPUT_ERROR(ParseJson("", "f.json", ""), "is no JSON");
  EXPECT_INPUT_ERROR(ParseJson("[1e999]", "f.json", ""), "a number beyond 1e308");
}

// Whoever copies or writes JSON goes down with it, and a stack has an end.
TEST(ParseJson, RefusesWhatIsNestedTooDeep) {
  EXPECT_TRUE(ParseJson(Nested(60), "f.json", "").is_array());
  EXPECT_INPUT_ERROR(ParseJson(Nested(100), "f.json", ""), "deeper than 64 levels");
  EXPECT_INPUT_ERROR(ParseJson(Nested(3000000), "f.json", ""), "deeper than 64 levels");
}

TEST(ReadJsonIfAny, IsNullWhereThereIsNone) {
  const TempFolder folder;
  WriteBytes(folder / "good.json", "{\"a\": 1}");
  WriteBytes(folder / "deep.json", Nested(1000));
  EXPECT_EQ(ReadJsonIfAny(folder / "good.json")["a"], 1);
  EXPECT_TRUE(ReadJsonIfAny(folder / "deep.json").is_null());
  EXPECT_TRUE(ReadJsonIfAny(folder / "none.json").is_null());
  EXPECT_TRUE(ReadJsonIfAny(folder.path()).is_null());
}

}  // namespace
}  // namespace roomtex
