#include "core/commit_together.h"

#include <cerrno>
#include <csignal>
#include <filesystem>
#include <set>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/partial_path.h"
#include "core/set_journal.h"
#include "tests/core/failing_calls.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

void WriteOutput(const std::string& path, const std::string& text) {
  OutputFile file(path);
  file.stream() << text;
  file.Commit();
}

size_t EntriesOf(const std::string& folder) {
  return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
}

struct CommitTogetherTest : testing::Test {
  TempFolder here, there;
  const std::string a = here / "a.txt", b = there / "b.txt", c = here / "c.txt";
  void SetUp() override { WriteBytes(b, "old"); }
  std::string Contents() const { return ReadBytes(a) + "," + ReadBytes(b); }

  // The state in which a run is killed that has made all files whole: two folders with lists that
  // wait for `record`, which is written if `committed`.
  std::string aside_here, aside_there, record;
  void Leave(bool committed) {
    aside_here = here / (kPartialPrefix + std::string("1"));
    aside_there = there / (kPartialPrefix + std::string("2"));
    record = fs::canonical(here.path()).string() + "/" + kPartialPrefix + "3";
    for (const std::string& aside : {aside_here, aside_there}) fs::create_directory(aside);
    WriteBytes(aside_here + "/a.txt", "new a");
    WriteBytes(aside_there + "/b.txt", "new b");
    WriteSetJournal({{"a.txt"}, {}, record}, aside_here);
    WriteSetJournal({{"b.txt"}, {}, record}, aside_there);
    if (committed) WriteCommitRecord({aside_here, aside_there}, record);
  }
};

TEST_F(CommitTogetherTest, AllAppearAtTheEndOrNone) {
  for (const bool finished : {false, true}) {
    CommitTogether outputs;
    WriteOutput(a, "new a");
    WriteOutput(b, "new b");
    EXPECT_TRUE(outputs.Holds(here / "./a.txt"));
    EXPECT_FALSE(outputs.Holds(c));
    EXPECT_FALSE(fs::exists(a));
    EXPECT_EQ(ReadBytes(b), "old");
    if (finished) outputs.Finish();
  }
  EXPECT_EQ(Contents(), "new a,new b");
  WriteOutput(c, "alone");
  EXPECT_EQ(ReadBytes(c), "alone");
  EXPECT_EQ(EntriesOf(here.path()), 2u);
  EXPECT_EQ(EntriesOf(there.path()), 1u);
}

TEST_F(CommitTogetherTest, AppearWithASetAndTakeTheirPlacesInIt) {
  const std::string set_place = here / "set";
  fs::create_directory(set_place);
  WriteBytes(set_place + "/kept", "kept");
  {
    CommitTogether outputs;
    const auto set = std::make_shared<OutputSet>(set_place);
    WriteBytes(set->Path("model"), "new model");
    WriteOutput(set_place + "/report", "new report");
    WriteOutput(a, "new a");
    WriteOutput(b, "new b");
    EXPECT_FALSE(fs::exists(set_place + "/model"));
    outputs.Finish({set});
  }
  EXPECT_EQ(Contents(), "new a,new b");
  EXPECT_EQ(ReadBytes(set_place + "/model") + ReadBytes(set_place + "/report"),
            "new modelnew report");
  EXPECT_EQ(EntriesOf(set_place), 3u);
  EXPECT_EQ(EntriesOf(here.path()), 2u);
  EXPECT_EQ(EntriesOf(there.path()), 1u);
}

TEST_F(CommitTogetherTest, WithASetThatCannotBeReplacedNothingAppears) {
  const std::string set_place = here / "set";
  fs::create_directory(set_place);
  CommitTogether outputs;
  const auto set = std::make_shared<OutputSet>(set_place);
  WriteBytes(set->Path("model"), "new model");
  fs::create_directory(set_place + "/model");
  WriteOutput(a, "new a");
  WriteOutput(b, "new b");
  EXPECT_INPUT_ERROR(outputs.Finish({set}), "is a folder");
  EXPECT_FALSE(fs::exists(a));
  EXPECT_EQ(ReadBytes(b), "old");
}

TEST_F(CommitTogetherTest, ARunKilledBeforeTheRecordHasChangedNothing) {
  Leave(false);
  WriteBytes(record, "roomtex commit record\ns" + aside_here);  // cut off
  RemoveLeftovers(there.path());
  RemoveLeftovers(here.path());
  EXPECT_FALSE(fs::exists(a));
  EXPECT_EQ(ReadBytes(b), "old");
  EXPECT_EQ(EntriesOf(here.path()), 0u);
  EXPECT_EQ(EntriesOf(there.path()), 1u);
}

TEST_F(CommitTogetherTest, WhatARunKilledBehindTheRecordHasNotMovedTheNextOneMoves) {
  Leave(true);
  fs::rename(aside_here + "/a.txt", a);
  RemoveLeftovers(here.path());  // of both folders: the record goes with this one
  EXPECT_EQ(Contents(), "new a,new b");
  EXPECT_EQ(EntriesOf(here.path()), 1u);
  EXPECT_EQ(EntriesOf(there.path()), 1u);
}

TEST_F(CommitTogetherTest, TheNextRunMayBeginInAnyOfTheFolders) {
  Leave(true);
  RemoveLeftovers(there.path());
  EXPECT_EQ(ReadBytes(b), "new b");
  RemoveLeftovers(here.path());
  EXPECT_EQ(Contents(), "new a,new b");
  EXPECT_EQ(EntriesOf(here.path()), 1u);
}

// Another process must not take the lists of a living one for leftovers.
TEST_F(CommitTogetherTest, ALivingRunKeepsItsRecord) {
  Leave(false);
  const PartialFolder living(there.path());  // is locked
  WriteBytes(living / "b.txt", "half");
  WriteSetJournal({{"b.txt"}, {}, record}, living.path());
  WriteCommitRecord({living.path()}, record);
  RemoveLeftovers(here.path());
  EXPECT_TRUE(fs::exists(record));
  EXPECT_EQ(ReadBytes(b), "old");
}

// A folder that somebody gives away may hold a record.
TEST_F(CommitTogetherTest, ARecordThatWasFoundReachesOnlySetsThatWaitForIt) {
  Leave(true);
  const std::string mine = there / "mine";
  fs::create_directory(mine);
  WriteBytes(mine + "/work", "work");
  WriteSetJournal({{"work"}, {}, record}, mine);  // not named as a set that is being made
  const std::string other = there / (kPartialPrefix + std::string("4"));
  fs::create_directory(other);
  WriteBytes(other + "/c", "another's");
  WriteSetJournal({{"c"}, {}, there / "another_record"}, other);
  WriteCommitRecord({mine, other, there.path()}, record);
  RemoveLeftovers(here.path());
  EXPECT_EQ(ReadBytes(mine + "/work"), "work");
  EXPECT_FALSE(fs::exists(there / "c"));
  EXPECT_EQ(ReadBytes(b), "old");
}

// As on network folders that give files another owner than the user who makes them.
TEST_F(CommitTogetherTest, FilesThatBelongToAnotherUserOnceTheyAreMadeAppear) {
  FailingCalls calls;
  calls.other_users = 1;
  {
    CommitTogether outputs;
    WriteOutput(a, "new a");
    WriteOutput(b, "new b");
    outputs.Finish();
  }
  EXPECT_EQ(Contents(), "new a,new b");
  EXPECT_EQ(EntriesOf(here.path()), 1u);
}

TEST_F(CommitTogetherTest, ASetOfOursWithoutItsListOrItsFilesIsAnError) {
  const PartialFolder set(here.path());
  EXPECT_EQ(FinishMovedSet(set.path(), JournalOrigin::kOurs), ENOENT);
  EXPECT_EQ(FinishMovedSet(set.path(), JournalOrigin::kFound), 0);
  WriteSetJournal({{"a.txt"}, {}}, set.path());
  EXPECT_EQ(FinishMovedSet(set.path(), JournalOrigin::kOurs), ENOENT);
}

TEST_F(CommitTogetherTest, ARecordThatDoesNotReachTheDiskLeavesNothing) {
  FailingCalls calls;
  int number = 0, failing = 0;
  calls.on_fsync = [&](const std::string&) { return ++number == failing ? EIO : 0; };
  for (failing = 1; failing < 100; ++failing) {
    number = 0;
    try {
      CommitTogether outputs;
      WriteOutput(a, "new a");
      WriteOutput(b, "new b");
      outputs.Finish();
      break;
    } catch (const InputError& error) {
      const std::string sentence = error.what();
      if (sentence.find("is kept in") != std::string::npos) break;  // behind the record
      EXPECT_NE(sentence.find("Input/output error"), std::string::npos) << sentence;
    }
    EXPECT_FALSE(fs::exists(a));
    EXPECT_EQ(ReadBytes(b), "old");
    EXPECT_EQ(EntriesOf(here.path()), 0u) << failing;
    EXPECT_EQ(EntriesOf(there.path()), 1u) << failing;
  }
  EXPECT_GE(failing, 6);  // two lists with two folders each, the record and its folder
}

TEST_F(CommitTogetherTest, WhatCannotBeMovedBehindTheRecordIsKeptForTheNextRun) {
  FailingCalls calls;
  calls.on_rename = [&](const std::string&, const std::string& to) {
    return fs::path(to).filename() == "b.txt" && !IsPartial(to) ? ENOSPC : 0;
  };
  {
    CommitTogether outputs;
    WriteOutput(b, "new b");
    WriteOutput(a, "new a");
    EXPECT_INPUT_ERROR(outputs.Finish(), "is kept in ");
  }
  EXPECT_EQ(Contents(), "new a,old");
  RemoveLeftovers(here.path());
  EXPECT_EQ(Contents(), "new a,old");
  calls.on_rename = nullptr;
  RemoveLeftovers(there.path());
  EXPECT_EQ(Contents(), "new a,new b");
  RemoveLeftovers(here.path());
  EXPECT_EQ(EntriesOf(here.path()), 1u);
  EXPECT_EQ(EntriesOf(there.path()), 1u);
}

TEST_F(CommitTogetherTest, WhatBecameAFolderMeanwhileIsFoundBeforeTheRecord) {
  {
    CommitTogether outputs;
    WriteOutput(a, "new a");
    WriteOutput(b, "new b");
    fs::remove(b);
    fs::create_directory(b);
    EXPECT_INPUT_ERROR(outputs.Finish(), "is a folder");
  }
  EXPECT_FALSE(fs::exists(a));
  EXPECT_EQ(EntriesOf(here.path()), 0u);
}

// Where folders cannot change places the record is a file of the set, which has to be moved first.
TEST_F(CommitTogetherTest, ASetThatBringsTheRecordIsMovedFirst) {
  for (const bool here_first : {true, false}) {
    WriteBytes(b, "old");
    Leave(false);
    fs::remove_all(aside_here);
    const std::string set = here / (kPartialPrefix + std::string("9"));
    const std::string name = fs::path(record).filename().string();
    fs::create_directory(set);
    WriteBytes(set + "/a.txt", "new a");
    WriteCommitRecord({aside_there}, set + "/" + name);
    WriteSetJournal({{name, "a.txt"}, {}}, set);
    RemoveLeftovers(here_first ? here.path() : there.path());
    EXPECT_EQ(Contents(), "new a,new b") << here_first;
    EXPECT_EQ(EntriesOf(here.path()), 1u);
    EXPECT_EQ(EntriesOf(there.path()), 1u);
    fs::remove(a);
  }
}

TEST_F(CommitTogetherTest, FoldersAreOnTheDiskOnceTheFilesAreThere) {
  std::set<std::string> synced;
  FailingCalls calls;
  calls.on_fsync = [&](const std::string& path) {
    // One folder after the other, in the order of their names: each once its own file is there.
    for (const std::string& file : {a, b}) {
      if (fs::exists(file) && fs::canonical(file).parent_path() == path) synced.insert(path);
    }
    return 0;
  };
  CommitTogether outputs;
  WriteOutput(a, "new a");
  WriteOutput(b, "new b");
  outputs.Finish();
  for (const TempFolder* folder : {&here, &there}) {
    EXPECT_EQ(synced.count(fs::canonical(folder->path()).string()), 1u);
  }
}

TEST_F(CommitTogetherTest, ARunThatIsKilledLeavesOldFilesForTheNextOne) {
  const pid_t child = fork();
  if (child == 0) {
    CommitTogether outputs;
    WriteOutput(a, "half");
    WriteOutput(b, "half");
    raise(SIGKILL);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(EntriesOf(there.path()), 2u);
  WriteOutput(b, "next");
  EXPECT_EQ(ReadBytes(b), "next");
  EXPECT_EQ(EntriesOf(there.path()), 1u);
}

}  // namespace
}  // namespace roomtex
