#include "core/saved_file.h"

#include <filesystem>

#include <gmock/gmock.h>

#include "core/error.h"
#include "core/output_file.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

class SavedFileTest : public testing::Test {
 protected:
  void Write(const std::string& text) const {
    OutputFile file(path_);
    file.stream() << text;
    file.Commit();
  }
  void Save(SavedFile* file, const std::string& text) const {
    file->Save([&] { Write(text); });
  }
  bool IsThere(const std::string& end) const { return std::filesystem::exists(path_ + end); }

  const TempFolder folder_;
  const std::string path_ = folder_ / "picks.csv";
};

TEST_F(SavedFileTest, KeepsWhatWasThereAtTheBeginningOnce) {
  WriteBytes(path_, "of yesterday");
  SavedFile file(path_);
  Save(&file, "1");
  Save(&file, "2");
  EXPECT_EQ(ReadBytes(path_), "2");
  EXPECT_EQ(ReadBytes(path_ + ".bak"), "of yesterday");
  EXPECT_FALSE(IsThere(".other"));
}

TEST_F(SavedFileTest, KeepsNothingWhereNothingWas) {
  SavedFile file(path_);
  Save(&file, "1");
  std::filesystem::remove(path_);
  Save(&file, "2");
  EXPECT_EQ(ReadBytes(path_), "2");
  EXPECT_FALSE(IsThere(".bak") || IsThere(".other"));
}

TEST_F(SavedFileTest, TwoWindowsLoseNothingAndAreTold) {
  WriteBytes(path_, "of yesterday");
  SavedFile one(path_), two(path_);
  Save(&one, "of one");
  EXPECT_INPUT_ERROR(Save(&two, "of two"), "was changed by somebody else");
  EXPECT_EQ(ReadBytes(path_), "of one");
  EXPECT_EQ(ReadBytes(path_ + ".other"), "of one");
  Save(&two, "of two, once more");
  EXPECT_EQ(ReadBytes(path_), "of two, once more");
  EXPECT_EQ(ReadBytes(path_ + ".bak"), "of yesterday");
  EXPECT_INPUT_ERROR(Save(&one, "of one"), "was changed by somebody else");
  EXPECT_EQ(ReadBytes(path_ + ".other"), "of two, once more");
}

TEST_F(SavedFileTest, AHandThatEditsIsSomebodyElse) {
  SavedFile file(path_);
  Save(&file, "1");
  WriteBytes(path_, "by hand");
  EXPECT_INPUT_ERROR(Save(&file, "2"), "picks.csv.other");
  EXPECT_EQ(ReadBytes(path_ + ".other"), "by hand");
}

}  // namespace
}  // namespace roomtex
