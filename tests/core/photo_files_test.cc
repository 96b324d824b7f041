#include "core/photo_files.h"

#include <filesystem>

#include <gmock/gmock.h>

#include "core/error.h"
#include "tests/support/folders.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

TEST(ListPhotoFiles, TakesWhatColmapTakesAndNothingHidden) {
  const TempFolder folder;
  for (const char* name : {"b.JPG", "a/c.png", ".d.jpg", ".roomtex-partial-1/e.jpg", "f.txt"}) {
    std::filesystem::create_directories(std::filesystem::path(folder / name).parent_path());
    WriteBytes(folder / name, "x");
  }
  std::filesystem::create_symlink(".", folder / "again");
  std::filesystem::create_symlink("loop.jpg", folder / "loop.jpg");
  EXPECT_THAT(ListPhotoFiles(folder.path(), ""), testing::ElementsAre("a/c.png", "b.JPG"));
  EXPECT_THAT(ListPhotoFiles(folder.path(), "", false), testing::ElementsAre("b.JPG"));
  EXPECT_EQ(NoteOnOtherPhotos(folder.path()), "");
  WriteBytes(folder / "b.CR2", "x");  // beside b.JPG
  EXPECT_EQ(NoteOnOtherPhotos(folder.path()), "");
  WriteBytes(folder / "a/IMG_1.HEIC", "x");
  EXPECT_EQ(
      NoteOnOtherPhotos(folder.path()),
      "photos in " + folder.path() + " are not read (1, as a/IMG_1.HEIC): export them as JPEG");
  EXPECT_TRUE(HasHiddenPhotos(folder.path()));
  EXPECT_FALSE(HasHiddenPhotos(folder / "a"));
  EXPECT_INPUT_ERROR(ListPhotoFiles(folder / "f.txt", "Give a folder"), "Give a folder");
}

}  // namespace
}  // namespace roomtex
