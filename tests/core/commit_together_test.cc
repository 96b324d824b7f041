#include "core/commit_together.h"

#include <csignal>
#include <filesystem>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "core/partial_path.h"
#include "core/set_journal.h"
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

// A set that is moved file by file brings the record along as one of them.
TEST_F(CommitTogetherTest, ARecordThatASetBringsAlongCountsAtOnce) {
  Leave(true);
  const std::string set = here / (kPartialPrefix + std::string("0"));
  fs::create_directory(set);
  fs::rename(record, set + "/" + fs::path(record).filename().string());
  WriteSetJournal({{fs::path(record).filename().string()}, {}}, set);
  RemoveLeftovers(here.path());
  EXPECT_EQ(Contents(), "new a,new b");
  EXPECT_EQ(EntriesOf(here.path()), 1u);
  EXPECT_EQ(EntriesOf(there.path()), 1u);
}

TEST_F(CommitTogetherTest, WhatCannotBeMovedKeepsTheRecord) {
  Leave(true);
  fs::remove(b);
  fs::create_directory(b);
  RemoveLeftovers(here.path());
  EXPECT_EQ(ReadBytes(a), "new a");
  EXPECT_TRUE(fs::exists(record));
  fs::remove(b);
  RemoveLeftovers(here.path());
  EXPECT_EQ(Contents(), "new a,new b");
  EXPECT_EQ(EntriesOf(here.path()), 1u);
  EXPECT_EQ(EntriesOf(there.path()), 1u);
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
