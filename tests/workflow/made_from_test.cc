#include "workflow/made_from.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/child_program.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::IsEmpty;

TEST(CommandWords, AreThoseThatCommandTextWasMadeOf) {
  const CommandLine words = {"cp", "it's", "a b", "", "#1", "x=1", "\\"};
  EXPECT_EQ(CommandWords(CommandText(words)), words);
}

TEST(FileName, IsTheLastOneHoweverThePathEnds) {
  for (const char* path : {"a/photos", "a/photos/", "a/photos/.", "a/b/../photos", "./photos"}) {
    EXPECT_EQ(FileName(path), "photos") << path;
  }
}

class PathNamesTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "site/photos");
    fs::create_directories(folder_ / "site/result/sparse");
    WriteBytes(folder_ / "site/room.e57", "");
    fs::create_directory_symlink(folder_ / "site/photos", folder_ / "link");
    fs::current_path(folder_ / "site");
  }
  void TearDown() override { fs::current_path(before_); }

  TempFolder folder_;
  const fs::path before_ = fs::current_path();
};

TEST_F(PathNamesTest, AreTheSameForEverySpelling) {
  const PathNames names("result");
  const std::string photos = fs::canonical("photos");
  for (const char* path : {"photos", "photos/", "./photos", "../site/photos", "../link"}) {
    EXPECT_EQ(names.Of(path), photos) << path;
  }
  EXPECT_EQ(names.Of(photos), photos);
  EXPECT_EQ(names.Of("room.e57#hall"), fs::canonical("room.e57").string() + "#hall");
  EXPECT_EQ(names.Of("result/sparse/0"), "{result}/sparse/0");
  EXPECT_EQ(names.Of(folder_ / "site/result/sparse/"), "{result}/sparse");
  EXPECT_EQ(names.Of("results"), fs::current_path().string() + "/results");
  EXPECT_EQ(names.Of("{result}/sparse/0"), "{result}/sparse/0");
  EXPECT_EQ(PathNames("elsewhere").PlaceOf("{result}/sparse/0"), "elsewhere/sparse/0");
}

MadeFrom From(const PathNames& names, const std::string& photos, const std::string& output,
              const std::string& more = "") {
  CommandLine line = {"roomtex-mapper",        "--image_path",  photos, "--database_path",
                      output + "/database.db", "--num_threads", "2"};
  if (!more.empty()) line.insert(line.end(), {"--Mapper.min_num_matches", more});
  return {{"options", names.Essential(line)}, {"photos", "abc"}};
}

TEST_F(PathNamesTest, OnlyWhatIsMeantOtherwiseIsAChange) {
  const MadeFrom before = From(PathNames("result"), "photos", "result");
  const PathNames names("../site/result");
  EXPECT_THAT(names.Changes(before, From(names, "../link/", "../site/result")), IsEmpty());
  EXPECT_THAT(names.Changes(before, From(names, "..", "../site/result", "9")),
              ElementsAre("options (--Mapper.min_num_matches, --image_path)"));
}

TEST_F(PathNamesTest, AFolderOfPathsAsTheyWereTypedGoesOn) {
  const PathNames names("result");
  const MadeFrom typed = {
      {"options", "roomtex-mapper --image_path photos --database_path result/database.db"},
      {"photos", "abc"}};
  EXPECT_THAT(names.Changes(typed, From(names, folder_ / "site/photos", "result")), IsEmpty());
  EXPECT_THAT(names.Changes({{".", "abc"}, {"../link/a", "1"}},
                            {{"site", "abc"}, {folder_ / "site/photos/a", "1"}}),
              IsEmpty());
}

// Its step has no command of its own, so that the whole line stands there.
TEST_F(PathNamesTest, APickDoesNotCutAVideoAnew) {
  const PathNames names("result");
  const MadeFrom before = {
      {"options", names.Essential({"roomtex-auto", "--video_path", "a.mp4", "--only", "frames"})}};
  CommandLine line = {"roomtex-auto", "--video_path", "../site/a.mp4", "--picks_path",
                      "p.csv",        "--only",       "frames"};
  EXPECT_THAT(names.Changes(before, {{"options", names.Essential(line)}}), IsEmpty());
  line.insert(line.end(), {"--video_frames", "30"});
  EXPECT_THAT(names.Changes(before, {{"options", names.Essential(line)}}),
              ElementsAre("options (--video_frames)"));
}

}  // namespace
}  // namespace roomtex
