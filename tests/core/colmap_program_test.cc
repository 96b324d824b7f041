// The program colmap: found, its version and the options of its commands.

#include "core/colmap_program.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/folders.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

TEST(ColmapVersionNumber, IsMajorAndMinor) {
  EXPECT_EQ(ColmapVersionNumber("COLMAP 3.8 (Commit Unknown)"), 308);
  EXPECT_EQ(ColmapVersionNumber("COLMAP 4.1.0"), 401);
  EXPECT_EQ(ColmapVersionNumber("else"), 0);
}

TEST(ColmapProgram, SaysThatColmapIsNotThere) {
  EXPECT_INPUT_ERROR(ColmapProgram("no-such-colmap"), "is not on the PATH");
  EXPECT_INPUT_ERROR(ColmapProgram("/bin/true"), "does not answer");
}

// A program that speaks as COLMAP does.
std::string WriteColmap(const std::string& path) {
  WriteBytes(path,
             "#!/bin/sh\n"
             "case $1 in\n"
             "help) echo 'COLMAP 3.9.1 -- Structure-from-Motion'; echo '(Commit x with CUDA)';;\n"
             "mapper) echo 'Options:'; echo '  --input_path arg'; echo '  --Mapper.x arg (=1)'\n"
             "  echo 'about --nothing';;\n"
             "*) echo 'ERROR: Command not recognized'; exit 1;;\n"
             "esac\n");
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  return path;
}

TEST(ColmapProgram, KnowsTheOptionsOfItsCommands) {
  const TempFolder folder;
  ColmapProgram colmap(WriteColmap(folder / "colmap"));
  EXPECT_EQ(colmap.VersionNumber(), 309);
  EXPECT_EQ(colmap.Options("mapper"), (std::set<std::string>{"--input_path", "--Mapper.x"}));
  EXPECT_INPUT_ERROR(colmap.Options("nonsense"), "has no command `nonsense`");
}

TEST(ColmapProgram, AppendsWhatItPrintsToTheLog) {
  const TempFolder folder;
  WriteColmap(folder / "colmap");
  ColmapProgram colmap(folder / "colmap", folder / "log");
  colmap.Run("mapper", {{"--Mapper.x", "2"}});
  EXPECT_NE(ReadBytes(folder / "log").find("--Mapper.x arg"), std::string::npos);
}

}  // namespace
}  // namespace roomtex
