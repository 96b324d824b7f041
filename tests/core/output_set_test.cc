#include "core/output_set.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <set>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "core/set_journal.h"
#include "tests/core/failing_calls.h"
#include "tests/support/matchers.h"
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

// In the folder that one works in nothing can change places: its files are moved one by one.
struct OutputSetHereTest : OutputSetTest {
  const fs::path before = fs::current_path();
  void SetUp() override {
    fs::create_directory(place);
    fs::current_path(place);
  }
  void TearDown() override { fs::current_path(before); }

  // All that the command leaves, with further files.
  void WriteAll(const std::string& text, const std::vector<std::string>& files) const {
    OutputSet set(".");
    set.ReplaceAllOf("roomtex-test");
    WriteBytes(set.Path("report.json"), R"({"command": "roomtex-test"})");
    for (const std::string& file : files) WriteBytes(set.Path(file), text);
    set.Commit();
  }
};

TEST_F(OutputSetHereTest, ReplacesAllOfItsOwnAgainAndAgain) {
  WriteAll("first", {"index.html", "tiles/0", "tiles/1", "old.js", "old/tile"});
  WriteAll("second", {"index.html", "tiles/0", "new.js"});
  EXPECT_EQ(ReadBytes("index.html") + ReadBytes("tiles/0") + ReadBytes("new.js"),
            "secondsecondsecond");
  EXPECT_TRUE(fs::exists("report.json"));
  for (const char* name : {"tiles/1", "old.js", "old/tile"}) EXPECT_FALSE(fs::exists(name)) << name;
}

TEST_F(OutputSetHereTest, WhatAnotherPutBesideItsFilesIsNotReplaced) {
  const auto write = [] {
    OutputSet set(".");
    set.ReplaceAllOf("roomtex-test");
    WriteBytes(set.Path("index.html"), "page");
    WriteBytes(set.Path("tiles/0"), "tile");
    const Json report = {{"command", "roomtex-test"}, {"entries", set.Entries()}};
    WriteBytes(set.Path("report.json"), report.dump());
    set.Commit();
  };
  write();
  write();
  WriteBytes("notes.txt", "mine");
  EXPECT_INPUT_ERROR(write(), "holds notes.txt, which roomtex-test did not write");
  EXPECT_EQ(ReadBytes("notes.txt") + ReadBytes("tiles/0"), "minetile");
}

TEST_F(OutputSetHereTest, OfAReplacedLinkToAFolderOnlyTheLinkGoes) {
  WriteAll("first", {"a"});
  fs::create_directory(folder / "photos");
  WriteBytes(folder / "photos/1.jpg", "mine");
  fs::create_directory_symlink(folder / "photos", "photos");
  WriteAll("second", {"a"});
  EXPECT_EQ(ReadBytes(folder / "photos/1.jpg"), "mine");
  EXPECT_FALSE(fs::is_symlink("photos"));
}

TEST_F(OutputSetHereTest, AFolderComesIntoThePlaceOfAnOldFile) {
  WriteAll("first", {"tiles"});
  WriteAll("second", {"tiles/0"});
  EXPECT_EQ(ReadBytes("tiles/0"), "second");
}

TEST_F(OutputSetHereTest, WhatCannotBeMovedIsKeptAndTheNextRunMovesIt) {
  FailingCalls calls;
  calls.on_rename = [](const std::string&, const std::string& to) {
    return fs::path(to).filename() == "b" ? ENOSPC : 0;
  };
  WriteBytes("b", "old");
  OutputSet set(".");
  set.Remove("stale");
  WriteBytes("stale", "old");
  for (const char* name : {"a", "b", "c"}) WriteBytes(set.Path(name), "new");
  EXPECT_INPUT_ERROR(set.Commit(), "is kept in ");
  EXPECT_TRUE(set.stays());
  EXPECT_EQ(ReadBytes("a") + ReadBytes("b") + ReadBytes("c"), "newoldnew");
  EXPECT_TRUE(fs::exists("stale"));
  for (const bool still_full : {true, false}) {
    if (!still_full) calls.on_rename = nullptr;
    const std::vector<std::string> stuck = RemoveLeftovers(".");
    EXPECT_EQ(stuck.size(), still_full ? 1u : 0u);
    EXPECT_EQ(ReadBytes("b"), still_full ? "old" : "new");
  }
  EXPECT_EQ(NumEntries("."), 3u);
}

TEST_F(OutputSetTest, AListThatNamesAFileAsMovedAndRemovedKeepsIt) {
  const std::string set = In(std::string(kPartialPrefix) + "0");
  fs::create_directories(set);
  WriteBytes(In("a"), "old");
  WriteBytes(set + "/a", "new");
  WriteSetJournal({{"a"}, {"a"}}, set);
  RemoveLeftovers(place);
  EXPECT_EQ(ReadBytes(In("a")), "new");
}

TEST_F(OutputSetTest, AFoundSetThatCannotBeMovedStays) {
  const std::string set = In(std::string(kPartialPrefix) + "0");
  fs::create_directories(set);
  WriteBytes(set + "/a", "new");
  WriteSetJournal({{"a"}, {}}, set);
  FailingCalls calls;
  for (const int error : {ENOSPC, EACCES, EPERM, 0}) {
    calls.on_rename = [error](const std::string&, const std::string&) { return error; };
    const std::vector<std::string> stuck = RemoveLeftovers(place);
    EXPECT_EQ(stuck.size(), error == 0 ? 0u : 1u);
    EXPECT_EQ(ReadBytes(error == 0 ? In("a") : set + "/a"), "new") << error;
  }
  EXPECT_FALSE(fs::exists(set));
}

TEST_F(OutputSetTest, WhatSomebodyWroteSinceARunWasKilledIsKept) {
  const std::string set = In(std::string(kPartialPrefix) + "0");
  fs::create_directories(set);
  for (const char* name : {"a", "b", "stale"}) WriteBytes(In(name), "old");
  for (const char* name : {"a", "b"}) WriteBytes(set + "/" + name, "new");
  WriteSetJournal({{"a", "b"}, {"stale"}}, set);
  const auto later = fs::last_write_time(set + "/.roomtex-journal") + std::chrono::seconds(1);
  for (const char* name : {"a", "stale"}) {
    WriteBytes(In(name), "edited");
    fs::last_write_time(In(name), later);
  }
  RemoveLeftovers(place);
  EXPECT_EQ(ReadBytes(In("a")) + ReadBytes(In("b")), "newnew");
  EXPECT_EQ(ReadBytes(In("a.other")) + ReadBytes(In("stale")), "editededited");
  EXPECT_FALSE(fs::exists(In("b.other")));
}

TEST_F(OutputSetTest, ReplacesAllOfAFolderThatHoldsNothingButWhatIsBeingMade) {
  const PartialFolder others(folder.path());
  fs::create_directory(place);
  fs::create_directory(In(std::string(kPartialPrefix) + "of_a_mount_point"));
  OutputSet set(place);
  set.ReplaceAllOf("roomtex-test");
  WriteBytes(set.Path("a"), "new");
  set.Commit();
  EXPECT_EQ(ReadBytes(In("a")), "new");
}

// A power cut after the folders have changed places leaves all that they hold.
TEST_F(OutputSetTest, AllFoldersAreOnTheDiskBeforeTheyChangePlaces) {
  fs::create_directories(In("kept"));
  WriteBytes(In("kept/mine"), "mine");
  OutputSet set(place);
  WriteBytes(set.Path("below/deep/b"), "new");
  const std::string aside = fs::canonical(set.aside()).string();
  std::set<std::string> synced;
  FailingCalls calls;
  calls.on_fsync = [&](const std::string& path) {
    synced.insert(path);
    return 0;
  };
  set.Commit();
  for (const char* name : {"", "/below", "/below/deep", "/kept"}) {
    EXPECT_EQ(synced.count(aside + name), 1u) << name;
  }
  EXPECT_EQ(synced.count(fs::canonical(folder.path()).string()), 1u);
}

TEST_F(OutputSetTest, AFullDiskIsFoundBeforeAnythingIsMoved) {
  fs::create_directory(place);
  WriteBytes(In("a"), "old");
  OutputSet set(place);
  WriteBytes(set.Path("a"), "new");
  FailingCalls calls;
  calls.on_fsync = [](const std::string&) { return ENOSPC; };
  EXPECT_INPUT_ERROR(set.Commit(), "No space left");
  EXPECT_EQ(ReadBytes(In("a")), "old");
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
