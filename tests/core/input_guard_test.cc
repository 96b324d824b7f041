#include "core/input_guard.h"

#include <filesystem>

#include <gmock/gmock.h>

#include "core/error.h"
#include "core/output_file.h"
#include "core/output_set.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

struct InputGuardTest : testing::Test {
  InputGuardTest() {
    fs::create_directories(folder / "photos/sub");
    WriteBytes(scan, "scan");
    WriteBytes(folder / "photos/sub/a.JPG", "photo");
    WriteBytes(folder / "photos/notes.json", "mine");
  }

  // What the guard says to these options; "" = nothing.
  std::string Refusal(const std::string& output, const std::string& input,
                      const std::string& report = "") const {
    try {
      GuardedPaths paths{{{"input", input}}, {{"output", output}}};
      if (!report.empty()) paths.outputs.emplace_back("report_path", report);
      const InputGuard guard(paths);
    } catch (const UsageError& error) {
      return error.what();
    }
    return "";
  }

  TempFolder folder;
  std::string scan = folder / "scan.rtpi", photos = folder / "photos";
};

TEST_F(InputGuardTest, KnowsAnInputByAnyName) {
  fs::create_symlink(scan, folder / "link");
  fs::create_hard_link(scan, folder / "second");
  fs::create_directory_symlink(".", folder / "here");
  for (const char* name :
       {"scan.rtpi", "photos/../scan.rtpi", "link", "second", "here/scan.rtpi"}) {
    EXPECT_THAT(Refusal(folder / name, scan), HasSubstr("is the input --input")) << name;
  }
  EXPECT_EQ(Refusal(folder / "other.rtpi", scan), "");
  EXPECT_THAT(Refusal(scan, scan + "#2"), HasSubstr("is the input"));
}

TEST_F(InputGuardTest, KnowsTheFileOfAScanWhateverHasAHash) {
  const std::string hash = folder / "a#b.e57";
  WriteBytes(hash, "scan");
  EXPECT_EQ(FileOf(scan + "#2"), scan);
  EXPECT_EQ(FileOf(scan + "#s#an#1"), scan) << "the scan's name has one";
  EXPECT_EQ(FileOf(hash), hash) << "the file's name has one";
  EXPECT_EQ(FileOf(hash + "#1"), hash);
  EXPECT_EQ(FileOf(scan + "#"), scan + "#") << "no scan is named";
  EXPECT_EQ(FileOf(folder / "none.e57#1"), folder / "none.e57#1");
  EXPECT_EQ(FileOf(photos + "#1"), photos + "#1") << "a folder has no scans";
  EXPECT_THAT(Refusal(scan, scan + "#s#an#1"), HasSubstr("is the input"));
  EXPECT_THAT(Refusal(hash, hash + "#1"), HasSubstr("is the input"));
}

TEST_F(InputGuardTest, KnowsPhotosInAFolderAndLeavesTheRest) {
  EXPECT_THAT(Refusal(photos + "/sub/a.JPG", photos), HasSubstr("is a file of the input --input"));
  EXPECT_EQ(Refusal(photos + "/notes.json", photos), "");
  WriteBytes(photos + "/alignment.json", "{}");
  EXPECT_THAT(Refusal(photos + "/alignment.json", photos), HasSubstr("is a file of the input"));
  EXPECT_EQ(Refusal(photos + "/new.png", photos), "");
}

TEST_F(InputGuardTest, ResultsLieOutsideOfThePhotos) {
  fs::create_directory_symlink("photos", folder / "linked");
  for (const char* name : {"photos", "photos/", "photos/new/deep", "linked", "linked/new"}) {
    EXPECT_THROW(RequireOutsidePhotos(folder / name, photos), UsageError) << name;
  }
  for (const char* name : {"photos_2", "new", "."}) {
    EXPECT_NO_THROW(RequireOutsidePhotos(folder / name, photos)) << name;
  }
  EXPECT_NO_THROW(RequireOutsidePhotos(photos, ""));
  EXPECT_NO_THROW(RequireOutsidePhotos("none", "none"));
}

TEST_F(InputGuardTest, OutputsAreNotEachOther) {
  EXPECT_THAT(
      Refusal(folder / "out", scan, folder / "photos/../out"),
      HasSubstr("--report_path " + folder.path() + "/photos/../out is the same file as --output"));
  EXPECT_EQ(Refusal("/dev/null", scan, "/dev/null"), "");
}

TEST_F(InputGuardTest, WhatWasReadIsNotReplaced) {
  const InputGuard guard({{{"image_path", photos}}, {{"output_path", folder.path()}}});
  NoteInput(photos + "/sub/a.JPG");
  NoteInput(scan, "the aligned model");
  for (const std::string& path : {photos + "/sub/a.JPG", scan}) {
    try {
      OutputFile file(path);
      ADD_FAILURE() << path;
    } catch (const UsageError& error) {
      EXPECT_THAT(error.what(), HasSubstr("--output_path would replace " + path));
    }
  }
  OutputSet set(folder.path());
  EXPECT_THROW(set.Path("scan.rtpi"), UsageError);
  OutputFile file(photos + "/notes.json");  // not read
}

TEST_F(InputGuardTest, IsNotThereOutsideOfACommand) {
  { const InputGuard guard({{{"scan_path", scan}}, {}}); }
  OutputFile file(scan);
  NoteInput(scan, "nobody");
  file.Commit();
}

}  // namespace
}  // namespace roomtex
