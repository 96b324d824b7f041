// roomtex-merge as users call it: one database's pairs, matched on three copies.

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/colmap_ext/simulated_database.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;
using testing::HasSubstr;

class MergeCommand : public testing::Test {
 protected:
  MergeCommand() {
    SimulatedViewsOptions options;
    options.num_views = 4;
    options.num_points = 80;
    WriteSimulatedDatabase(SimulateViews(options), folder_.path());
  }

  // A copy of the database with what `sql` does to it.
  std::string Copy(const std::string& name, const std::string& sql) {
    fs::copy_file(folder_ / "database.db", folder_ / name);
    SQLite::Database(folder_ / name, SQLite::OPEN_READWRITE).exec(sql);
    return folder_ / name;
  }
  CommandResult Merge(const std::string& into, const std::string& copies) {
    return RunCommandLine("roomtex-merge --database_path " + into + " " + copies +
                          " --output_path " + (folder_ / "merged.db"));
  }

  const std::string drop_ = "DELETE FROM two_view_geometries ";
  TempFolder folder_;
};

TEST_F(MergeCommand, PutsThePairsOfAllCopiesTogether) {
  const Database whole(folder_ / "database.db");
  const std::vector<DatabasePair> pairs = whole.ReadPairs(0);
  ASSERT_EQ(pairs.size(), 6u);
  const auto is = [&](size_t i) {
    return "pair_id = " + std::to_string(PairIdFromImages(pairs[i].image_id1, pairs[i].image_id2));
  };
  const std::string base = Copy("base.db", drop_ + "WHERE NOT " + is(0));
  const std::string first = Copy("1.db", drop_ + "WHERE NOT (" + is(1) + " OR " + is(2) + ")");
  // Has pair 2, too, with nothing verified: the first copy counts.
  const std::string second =
      Copy("2.db", drop_ + "WHERE " + is(0) + " OR " + is(1) +
                       "; UPDATE two_view_geometries SET rows = 0, data = NULL WHERE " + is(2));
  const CommandResult result = Merge(base, "--copy_path " + first + " --copy_path " + second);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("6 pairs, 5 of them from 2 copies"));
  const std::vector<DatabasePair> merged = Database(folder_ / "merged.db").ReadPairs(0);
  ASSERT_EQ(merged.size(), pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    EXPECT_EQ(merged[i].image_id2, pairs[i].image_id2);
    EXPECT_EQ(merged[i].config, pairs[i].config);
    EXPECT_EQ(merged[i].matches, pairs[i].matches);
  }
  EXPECT_EQ(Database(base).ReadPairs(0).size(), 1u);
}

TEST_F(MergeCommand, RefusesWhatIsNoCopy) {
  const std::string base = folder_ / "database.db";
  for (const char* sql :
       {"UPDATE images SET name = 'other.jpg' WHERE image_id = 2",
        "DELETE FROM keypoints WHERE image_id = 3",
        "DELETE FROM two_view_geometries; DELETE FROM images WHERE image_id = 4"}) {
    const std::string other = Copy("other.db", sql);
    const CommandResult result = Merge(base, "--copy_path " + other);
    EXPECT_EQ(result.exit_code, 3) << sql;
    EXPECT_THAT(result.err, HasSubstr("copies that were made of it")) << sql;
    EXPECT_FALSE(fs::exists(folder_ / "merged.db"));
    fs::remove(other);
  }
  EXPECT_EQ(Merge(base, "").exit_code, 2);
  EXPECT_EQ(Merge(base, "--copy_path " + (folder_ / "none.db")).exit_code, 3);
}

}  // namespace
}  // namespace roomtex
