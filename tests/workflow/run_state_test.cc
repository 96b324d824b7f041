#include "workflow/run_state.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using testing::ElementsAre;

TEST(Signature, IsThatOfTheContent) {
  const TempFolder folder;
  WriteBytes(folder / "a", "one");
  WriteBytes(folder / "b", "one");
  WriteBytes(folder / "c", "two");
  EXPECT_EQ(Signature(folder / "a"), Signature(folder / "b"));
  EXPECT_NE(Signature(folder / "a"), Signature(folder / "c"));
  const std::string before = Signature(folder / "a");
  fs::last_write_time(folder / "a", fs::file_time_type::clock::now() + std::chrono::hours(1));
  EXPECT_EQ(Signature(folder / "a"), before);
}

TEST(Signature, OfALargeFileIsThatOfItsTime) {
  const TempFolder folder;
  WriteBytes(folder / "a", std::string(2 << 20, 'x'));
  const std::string before = Signature(folder / "a");
  EXPECT_EQ(Signature(folder / "a"), before);
  fs::last_write_time(folder / "a", fs::file_time_type::clock::now() + std::chrono::hours(1));
  EXPECT_NE(Signature(folder / "a"), before);
}

TEST(Signature, OfAFolderIsThatOfAllItsFiles) {
  const TempFolder folder;
  fs::create_directories(folder / "photos/more");
  WriteBytes(folder / "photos/a", "one");
  const std::string one = Signature(folder / "photos");
  WriteBytes(folder / "photos/more/b", "two");
  const std::string two = Signature(folder / "photos");
  fs::rename(folder / "photos/more/b", folder / "photos/more/c");
  EXPECT_NE(one, two);
  EXPECT_NE(Signature(folder / "photos"), two);
  EXPECT_NE(one, "");
}

// A folder that somebody has looked at, or written a note into, is the same folder.
TEST(Signature, OfAFolderPassesOverWhatNobodyReads) {
  const TempFolder folder;
  fs::create_directories(folder / "photos/more");
  fs::create_directories(folder / "photos/.thumbnails");
  WriteBytes(folder / "photos/a.jpg", "one");
  WriteBytes(folder / "photos/more/b.JPG", "two");
  const std::string all = Signature(folder / "photos");
  const std::string photos = SignatureOfPhotos(folder / "photos");
  EXPECT_EQ(all, photos);
  for (const char* name :
       {".DS_Store", "more/._b.jpg", ".thumbnails/a.jpg", "Thumbs.db", "more/desktop.ini"}) {
    WriteBytes(folder / (std::string("photos/") + name), "x");
  }
  EXPECT_EQ(Signature(folder / "photos"), all);
  WriteBytes(folder / "photos/notes.txt", "the hall");
  EXPECT_NE(Signature(folder / "photos"), all);
  EXPECT_EQ(SignatureOfPhotos(folder / "photos"), photos);

  WriteBytes(folder / "photos/c.png", "three");
  const std::string more = SignatureOfPhotos(folder / "photos");
  EXPECT_NE(more, photos);
  WriteBytes(folder / "photos/c.png", "four");
  EXPECT_NE(SignatureOfPhotos(folder / "photos"), more);
  fs::remove(folder / "photos/c.png");
  EXPECT_EQ(SignatureOfPhotos(folder / "photos"), photos);
  fs::remove(folder / "photos/a.jpg");
  EXPECT_NE(SignatureOfPhotos(folder / "photos"), photos);
  WriteBytes(folder / "photos/panoramas.json", "{}");  // beside the faces of panoramas
  const std::string faces = SignatureOfPhotos(folder / "photos");
  WriteBytes(folder / "photos/panoramas.json", "[]");
  EXPECT_NE(SignatureOfPhotos(folder / "photos"), faces);
  EXPECT_EQ(SignatureOfPhotos("no/such/folder"), "");
}

TEST(Signature, OfWhatIsNotThereIsEmpty) { EXPECT_EQ(Signature("no/such/file"), ""); }

TEST(Differences, NamesWhatChangedCameAndWent) {
  EXPECT_THAT(
      Differences({{"a", "1"}, {"b", "1"}, {"c", "1"}}, {{"a", "1"}, {"b", "2"}, {"d", "1"}}),
      ElementsAre("b", "c", "d"));
  EXPECT_TRUE(Differences({{"a", "1"}}, {{"a", "1"}}).empty());
}

TEST(RunState, IsReadBackAsItWasWritten) {
  const TempFolder folder;
  StepRecord record;
  record.state = StepState::kUntrusted;
  record.made_from = {{"room.e57", "abc"}};
  record.outputs = {{"aligned", "def"}};
  record.commands = {"roomtex-align --output_path aligned"};
  record.notes = {"no picks"};
  record.reason = "photos contradict";
  record.seconds = 1.5;
  record.cpu_seconds = 2.5;
  record.peak_memory_bytes = 5'000'000'000;
  RunState(folder / "steps.json").Set("align", record);
  const RunState state(folder / "steps.json");
  EXPECT_EQ(state.Find("mapper"), nullptr);
  const StepRecord* const found = state.Find("align");
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->state, StepState::kUntrusted);
  EXPECT_EQ(found->made_from, record.made_from);
  EXPECT_EQ(found->outputs, record.outputs);
  EXPECT_EQ(found->commands, record.commands);
  EXPECT_EQ(found->notes, record.notes);
  EXPECT_EQ(found->reason, record.reason);
  EXPECT_EQ(found->seconds, 1.5);
  EXPECT_EQ(found->cpu_seconds, 2.5);
  EXPECT_EQ(found->peak_memory_bytes, 5'000'000'000);
}

TEST(RunState, ThatCannotBeReadIsNone) {
  const TempFolder folder;
  for (const char* bytes : {"", "{", "[1]", R"({"steps": {"align": {"state": "done"}}})"}) {
    WriteBytes(folder / "steps.json", bytes);
    EXPECT_EQ(RunState(folder / "steps.json").Find("align"), nullptr) << bytes;
  }
}

TEST(OutputsAreAsLeft, NotWhenOneWasChangedOrRemoved) {
  const TempFolder folder;
  WriteBytes(folder / "a", "one");
  WriteBytes(folder / "b", "two");
  StepRecord record;
  for (const char* name : {"a", "b"}) record.outputs[folder / name] = Signature(folder / name);
  EXPECT_TRUE(OutputsAreAsLeft(record));
  WriteBytes(folder / "b", "three");
  EXPECT_FALSE(OutputsAreAsLeft(record));
  WriteBytes(folder / "b", "two");
  EXPECT_TRUE(OutputsAreAsLeft(record));
  fs::remove(folder / "a");
  EXPECT_FALSE(OutputsAreAsLeft(record));
}

}  // namespace
}  // namespace roomtex
