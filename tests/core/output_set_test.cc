#include "core/output_set.h"

#include <cerrno>
#include <csignal>
#include <filesystem>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "core/set_journal.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

size_t NumEntries(const std::string& folder) {
  return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
}

// A set in folder/set, so that what lies beside it is the test's own.
struct OutputSetTest : testing::Test {
  TempFolder folder;
  std::string place = folder / "set";
  std::string In(const std::string& name) const { return place + "/" + name; }
};

TEST_F(OutputSetTest, FilesAppearTogetherOrNotAtAll) {
  fs::create_directory(place);
  WriteBytes(In("a"), "old");
  {
    OutputSet set(place);
    WriteBytes(set.Path("a"), "new");
    WriteBytes(set.Path("b"), "new");
    EXPECT_EQ(ReadBytes(In("a")), "old");
    EXPECT_FALSE(fs::exists(In("b")));
  }  // given up
  EXPECT_EQ(ReadBytes(In("a")), "old");
  EXPECT_FALSE(fs::exists(In("b")));
  OutputSet set(place);
  WriteBytes(set.Path("a"), "new");
  WriteBytes(set.Path("below/b"), "new");
  set.Commit();
  EXPECT_EQ(ReadBytes(In("a")) + ReadBytes(In("below/b")), "newnew");
  EXPECT_EQ(NumEntries(folder.path()), 1u);
}

TEST_F(OutputSetTest, KeepsWhatIsNotOfTheSet) {
  fs::create_directories(In("notes/deep"));
  fs::permissions(place, static_cast<fs::perms>(0750));
  WriteBytes(In("mine.txt"), "mine");
  WriteBytes(In("notes/deep/mine"), "mine");
  WriteBytes(In("stale"), "old");
  fs::create_directory(In("0"));
  WriteBytes(In("0/rigs.bin"), "old");
  fs::create_symlink("mine.txt", In("link"));
  fs::create_symlink("mine.txt", In("linked_output"));
  OutputSet set(place);
  WriteBytes(set.Path("notes/new"), "new");
  WriteBytes(set.Path("0/cameras.bin"), "new");
  WriteBytes(set.Path("linked_output"), "new");
  set.ReplaceFolder("0");
  set.Remove("stale");
  set.Commit();
  EXPECT_EQ(ReadBytes(In("mine.txt")) + ReadBytes(In("notes/deep/mine")), "minemine");
  EXPECT_EQ(fs::read_symlink(In("link")), "mine.txt");
  EXPECT_FALSE(fs::is_symlink(In("linked_output")));
  EXPECT_EQ(NumEntries(In("0")), 1u);
  EXPECT_FALSE(fs::exists(In("stale")));
  EXPECT_EQ(fs::status(place).permissions(), static_cast<fs::perms>(0750));
}

TEST_F(OutputSetTest, FillsTheFolderThatOneWorksIn) {
  fs::create_directory(place);
  const fs::path before = fs::current_path();
  fs::current_path(place);
  {
    OutputSet set(".");
    WriteBytes(set.Path("a"), "new");
    WriteBytes(set.Path("below/b"), "new");
    set.Commit();
  }
  EXPECT_EQ(ReadBytes("a") + ReadBytes("below/b"), "newnew");
  EXPECT_EQ(NumEntries("."), 2u);
  fs::current_path(before);
}

// Its own folder is made there, and files of the same names are both replaced and done away with.
TEST_F(OutputSetTest, ReplacesAllOfTheFolderThatOneWorksIn) {
  fs::create_directory(place);
  const fs::path before = fs::current_path();
  fs::current_path(place);
  for (const char* round : {"first", "second"}) {
    OutputSet set(".");
    set.ReplaceAllOf("roomtex-test");
    WriteBytes(set.Path("report.json"), R"({"command": "roomtex-test"})");
    WriteBytes(set.Path("data/a"), round);
    WriteBytes(set.Path(std::string("only_") + round), round);
    set.Commit();
    EXPECT_EQ(ReadBytes("data/a"), round);
    EXPECT_TRUE(fs::exists("report.json"));
    EXPECT_EQ(NumEntries("."), 3u);
  }
  EXPECT_TRUE(fs::exists("only_second"));
  fs::current_path(before);
}

TEST_F(OutputSetTest, GoesToTheEndOfALinkToAFolder) {
  fs::create_directory(folder / "real");
  fs::create_directory_symlink("real", place);
  OutputSet set(place);
  WriteBytes(set.Path("a"), "new");
  set.Commit();
  EXPECT_TRUE(fs::is_symlink(place));
  EXPECT_EQ(ReadBytes(folder / "real/a"), "new");
}

TEST_F(OutputSetTest, RemovesWhatAKilledRunLeft) {
  const pid_t child = fork();
  if (child == 0) {
    OutputSet set(place);
    WriteBytes(set.Path("a"), "half");
    raise(SIGKILL);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(NumEntries(folder.path()), 2u);
  RemoveLeftovers(folder.path());
  EXPECT_EQ(NumEntries(folder.path()), 1u);
}

TEST_F(OutputSetTest, FinishesWhatAKilledRunWasMoving) {
  fs::create_directory(place);
  WriteBytes(In("a"), "new");  // moved already
  WriteBytes(In("b"), "old");
  WriteBytes(In("stale"), "old");
  const std::string set = In(std::string(kPartialPrefix) + "0");
  fs::create_directories(set + "/below");
  WriteBytes(set + "/b", "new");
  WriteBytes(set + "/below/c", "new");
  WriteSetJournal({{"a", "b", "below/c"}, {"stale"}}, set);
  RemoveLeftovers(place);
  EXPECT_EQ(ReadBytes(In("a")) + ReadBytes(In("b")) + ReadBytes(In("below/c")), "newnewnew");
  EXPECT_FALSE(fs::exists(In("stale")));
  EXPECT_EQ(NumEntries(place), 3u);
}

// A folder that somebody gives away may hold a list of what a run of theirs had to move.
TEST_F(OutputSetTest, AListThatWasFoundReachesNoFileOutsideItsFolder) {
  fs::create_directory(place);
  fs::create_directory(folder / "home");
  fs::create_directory_symlink(folder / "home", In("link"));
  for (const char* name : {"home/a", "home/b", "home/c"}) WriteBytes(folder / name, "mine");
  const std::string set = In(std::string(kPartialPrefix) + "0");
  fs::create_directories(set + "/link");
  fs::create_directory_symlink(folder / "home", set + "/taken");
  for (const char* name : {"link/a", "b", "whole"}) WriteBytes(set + "/" + name, "theirs");
  WriteSetJournal({{"link/a", "../home/b", "taken/c", "whole"},
                   {"../home/a", folder / "home/b", "link/c", "whole/../../home/c"}},
                  set);
  RemoveLeftovers(place);
  for (const char* name : {"home/a", "home/b", "home/c"}) {
    EXPECT_EQ(ReadBytes(folder / name), "mine") << name;
  }
  EXPECT_EQ(ReadBytes(In("whole")), "theirs");
  EXPECT_FALSE(fs::exists(In("taken")));
  EXPECT_FALSE(fs::exists(set));
}

TEST_F(OutputSetTest, WhatCannotBeMovedIsKept) {
  fs::create_directories(In("b"));  // in the place of a file
  const std::string set = In(std::string(kPartialPrefix) + "0");
  fs::create_directory(set);
  for (const char* name : {"a", "b", "c"}) WriteBytes(set + "/" + name, "new");
  WriteSetJournal({{"a", "b", "c"}, {"c", "old"}}, set);
  RemoveLeftovers(place);
  EXPECT_EQ(ReadBytes(In("a")) + ReadBytes(In("c")), "newnew");
  EXPECT_EQ(ReadBytes(set + "/b"), "new");
  fs::remove(In("b"));
  RemoveLeftovers(place);
  EXPECT_EQ(ReadBytes(In("b")), "new");
  EXPECT_EQ(NumEntries(place), 3u);
}

// As on disks that say themselves whom files belong to.
TEST_F(OutputSetTest, WhatThisProcessMadeIsMovedWhomeverItBelongsTo) {
  if (geteuid() != 0) GTEST_SKIP() << "only root makes files of others";
  const std::string set = In("set");
  fs::create_directories(set);
  const std::string record = In("record");
  WriteBytes(set + "/a", "new");
  WriteSetJournal({{"a"}, {}, record}, set);
  WriteCommitRecord({set}, record);
  for (const std::string& path : {set + "/.roomtex-journal", record}) {
    ASSERT_EQ(lchown(path.c_str(), 65534, 65534), 0);
  }
  EXPECT_EQ(FinishMovedSet(set, JournalOrigin::kOurs), 0);
  EXPECT_EQ(ReadBytes(In("a")), "new");
  EXPECT_EQ(FinishMovedSet(set, JournalOrigin::kOurs), ENOENT);  // it is no longer there to move
}

TEST_F(OutputSetTest, TheListOfAnotherUserIsNotFollowed) {
  if (geteuid() != 0) GTEST_SKIP() << "only root makes files of others";
  fs::create_directory(place);
  WriteBytes(In("a"), "mine");
  const std::string set = In(std::string(kPartialPrefix) + "0");
  fs::create_directory(set);
  WriteBytes(set + "/a", "theirs");
  WriteSetJournal({{"a"}, {}}, set);
  ASSERT_EQ(lchown((set + "/.roomtex-journal").c_str(), 65534, 65534), 0);
  RemoveLeftovers(place);
  EXPECT_EQ(ReadBytes(In("a")), "mine");
}

TEST_F(OutputSetTest, RefusesFoldersInTheWay) {
  fs::create_directories(In("dir"));
  WriteBytes(In("real"), "old");
  OutputSet set(place);
  WriteBytes(set.Path("real"), "newer");
  EXPECT_INPUT_ERROR(set.Path("dir"), "is a folder");
  EXPECT_INPUT_ERROR(set.Path("real/below"), "is not a folder");
  WriteBytes(set.aside() + "/dir", "x");
  EXPECT_INPUT_ERROR(set.Commit(), "is a folder");
  EXPECT_EQ(ReadBytes(In("real")), "old");
}

}  // namespace
}  // namespace roomtex
