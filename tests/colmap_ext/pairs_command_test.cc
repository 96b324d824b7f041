// roomtex-pairs as users call it, on databases of made-up rooms.

#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "colmap_ext/pair_selection.h"
#include "colmap_ext/view_graph.h"
#include "core/report.h"
#include "tests/colmap_ext/room_database.h"
#include "tests/support/option_check.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using Schema = DatabaseMaker::Schema;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using NamePair = std::pair<std::string, std::string>;

constexpr int kViewsPerRoom = 8;

class PairsCommand : public testing::Test {
 protected:
  // Photos "a0.jpg", "a1.jpg" ... of every room.
  void WriteRooms(const std::string& rooms, int num_shared = 0, Schema schema = Schema::k38) {
    RoomDatabaseOptions options;
    for (const char room : rooms) options.rooms.emplace_back(1, room);
    options.num_views = kViewsPerRoom;
    options.num_shared = num_shared;
    options.schema = schema;
    WriteRoomDatabase(database_, options);
  }
  // The database, changed.
  void Change(const std::string& sql) {
    SQLite::Database(database_, SQLite::OPEN_READWRITE).exec(sql);
  }

  CommandResult Run(const std::string& more = "") {
    return RunCommandLine("roomtex-pairs --database_path " + database_ + " --output_path " +
                          output_ + " --report_path " + report_path_ + " " + more);
  }
  std::set<NamePair> Pairs() const {
    std::ifstream stream(output_);
    std::set<NamePair> pairs;
    NamePair pair;
    while (stream >> pair.first >> pair.second) pairs.insert(pair);
    return pairs;
  }
  Json Report() const { return Json::parse(std::ifstream(report_path_)); }

  TempFolder folder_;
  const std::string database_ = folder_ / "database.db", output_ = folder_ / "pairs.txt",
                    report_path_ = folder_ / "report.json";
};

// The pairs appear with the report, and so does what is told of them.
TEST_F(PairsCommand, SaysNothingOfPairsThatAreNotWritten) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "this system has no /dev/full";
  WriteRooms("a");
  const CommandResult result =
      RunCommandLine("roomtex-pairs --database_path " + database_ + " --output_path " + output_ +
                     " --report_path /dev/full");
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_FALSE(std::filesystem::exists(output_));
  EXPECT_THAT(result.out, IsEmpty());
}

TEST_F(PairsCommand, FindsThePairsOfARoomAndNoneAcrossRooms) {
  for (const Schema schema : {Schema::k38, Schema::k41}) {
    std::filesystem::remove(database_);
    WriteRooms("ab", 0, schema);
    const CommandResult result = Run("--graph_path " + (folder_ / "graph.json"));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const std::set<NamePair> pairs = Pairs();
    EXPECT_THAT(pairs, SizeIs(2 * kViewsPerRoom * (kViewsPerRoom - 1) / 2));
    for (const auto& [name1, name2] : pairs) EXPECT_EQ(name1[0], name2[0]);
    EXPECT_THAT(Report()["groups"], SizeIs(2));
    EXPECT_THAT(Report()["isolated"], IsEmpty());
    const Json graph = Json::parse(std::ifstream(folder_ / "graph.json"));
    EXPECT_THAT(graph["nodes"], SizeIs(2 * kViewsPerRoom));
    EXPECT_THAT(graph["edges"], SizeIs(pairs.size()));
  }
}

TEST_F(PairsCommand, RoomsWithTheSameFurnitureStayApart) {
  WriteRooms("ab", 25);
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  for (const auto& [name1, name2] : Pairs()) EXPECT_EQ(name1[0], name2[0]);
  EXPECT_THAT(Report()["groups"], SizeIs(2));
  EXPECT_GT(Report()["lookalikes"][0]["num_pairs"], kViewsPerRoom);
  EXPECT_THAT(result.err, HasSubstr("the same furniture in two rooms"));
  EXPECT_EQ(Run("--Pairs.join_lookalikes 1").exit_code, 0);
  EXPECT_THAT(Report()["groups"], SizeIs(1));
}

TEST_F(PairsCommand, ThreadsChangeNothingAndFewNeighborsConnectAll) {
  WriteRooms("abc");
  ASSERT_EQ(Run("--Pairs.max_neighbors 2 --num_threads 1").exit_code, 0);
  const std::set<NamePair> pairs = Pairs();
  EXPECT_LT(pairs.size(), 2u * 3 * kViewsPerRoom);
  EXPECT_THAT(Report()["groups"], SizeIs(3));
  ASSERT_EQ(Run("--Pairs.max_neighbors 2 --num_threads 3").exit_code, 0);
  EXPECT_EQ(Pairs(), pairs);
}

TEST_F(PairsCommand, NewPhotosAreAddedToWhatWasMatched) {
  WriteRooms("a");
  const auto pair_id = [](uint32_t a, uint32_t b) {
    return std::to_string(PairIdFromImages(a, b));
  };
  // 1 and 2 were matched, 1 and 3 in vain.
  Change("INSERT INTO two_view_geometries (pair_id, rows, cols, data, config) VALUES (" +
         pair_id(1, 2) + ", 1, 2, x'0000000000000000', 2), (" + pair_id(1, 3) + ", 0, 2, NULL, 1)");
  ASSERT_EQ(Run().exit_code, 0);
  EXPECT_EQ(Pairs().count({"a0.jpg", "a1.jpg"}), 1u);
  EXPECT_EQ(Pairs().count({"a0.jpg", "a2.jpg"}), 0u);
  EXPECT_EQ(Pairs().count({"a0.jpg", "a3.jpg"}), 1u);
  EXPECT_EQ(Report()["num_in_database"], 2);
  ASSERT_EQ(Run("--Pairs.only_new").exit_code, 0);
  EXPECT_EQ(Pairs().count({"a0.jpg", "a1.jpg"}), 0u);
  EXPECT_EQ(Pairs().count({"a0.jpg", "a3.jpg"}), 1u);
}

TEST_F(PairsCommand, NamesWhatStandsAlone) {
  WriteRooms("a");
  Change("UPDATE keypoints SET rows = 0, data = NULL WHERE image_id = 3");
  Change("UPDATE descriptors SET rows = 0, data = NULL WHERE image_id = 3");
  const CommandResult result = Run();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(Report()["isolated"][0]["name"], "a2.jpg");
  EXPECT_EQ(Report()["isolated"][0]["reason"], "has no features");
  EXPECT_THAT(result.err, HasSubstr("stand alone, nothing agrees with them: a2.jpg"));
}

// Plain photos of bare walls between those with a pattern: an even choice of all 1024 photos, by
// which words and axes are learned, may hit none with features.
TEST_F(PairsCommand, FewPhotosWithFeaturesAmongManyWithoutAreFound) {
  for (const int first : {2, 44}) {  // the words' choice passes over the one, the axes' over both
    std::filesystem::remove(database_);
    WriteRooms("a");
    for (const std::string table : {"images", "keypoints", "descriptors"}) {
      Change("UPDATE " + table + " SET image_id = image_id + 10000");
      Change("UPDATE " + table + " SET image_id = 2 * (image_id - 10001) + " +
             std::to_string(first));
    }
    Change(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 1024) INSERT "
        "OR IGNORE INTO images (image_id, name, camera_id) SELECT i, 'plain' || i || '.jpg', "
        "(SELECT camera_id FROM cameras) FROM n");
    const CommandResult result = Run("--graph_path " + (folder_ / "graph.json"));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(Report()["num_images"], 1024);
    EXPECT_THAT(Pairs(), SizeIs(kViewsPerRoom * (kViewsPerRoom - 1) / 2));
    const Json graph = Json::parse(std::ifstream(folder_ / "graph.json"));
    EXPECT_EQ(graph["edges"][0]["found_by"], "signature");
  }
}

TEST_F(PairsCommand, WhatCannotBeUsedGetsASentence) {
  const std::map<std::string, std::string> sentence_of_change = {
      {"UPDATE images SET name = 'a b.jpg' WHERE image_id = 2", "blank in its name"},
      {"UPDATE descriptors SET cols = 64 WHERE image_id = 2", "have 64 bytes, expected the 128"},
      {"UPDATE descriptors SET rows = 5 WHERE image_id = 2", "has 5 descriptors for"},
      {"UPDATE descriptors SET data = x'00' WHERE image_id = 2", "holds 1 bytes, expected"},
      {"DELETE FROM descriptors WHERE image_id = 2", "is missing, but the image has keypoints"},
      {"DROP TABLE descriptors", "no table descriptors"},
      {"DELETE FROM images WHERE image_id > 1", "1 of 1 photos has features, and a pair takes two"},
      {"DELETE FROM images", "holds no images"},
      {"DELETE FROM keypoints", "0 of 8 photos has features"}};
  for (const auto& [change, sentence] : sentence_of_change) {
    std::filesystem::remove(database_);
    WriteRooms("a");
    Change(change);
    const CommandResult result = Run();
    EXPECT_EQ(result.exit_code, 3) << change;
    EXPECT_THAT(result.err, HasSubstr(sentence));
    EXPECT_FALSE(std::filesystem::exists(output_)) << change;
  }
}

TEST(PairsCommandOptions, AreListedAndChecked) {
  PairOptions options;
  ExpectChecksItsOptions("roomtex-pairs", "--database_path none --output_path none",
                         {FieldsOf(&options)});
}

TEST(PairCheck, TakesFeaturesThatAllLieAtOnePlace) {
  ComparedFeatures features;
  for (int i = 0; i < 40; ++i) {
    features.x.emplace_back(10, 20);
    const std::vector<uint8_t> one = DescriptorOfLook(static_cast<uint64_t>(i), 1);
    features.descriptors.insert(features.descriptors.end(), one.begin(), one.end());
  }
  EXPECT_EQ(CheckPair(features, features, PairCheckOptions()).num_matches, 40);
  EXPECT_EQ(CheckPair(features, ComparedFeatures(), PairCheckOptions()).num_matches, 0);
}

TEST(ViewGraph, KeepsTheStrongestSomeWeakOnesAndNothingFallsApart) {
  // Twenty photos in which each agrees with all others, less the farther, and a weak one at the
  // end.
  std::vector<GraphEdge> edges;
  for (int i = 0; i < 20; ++i) {
    for (int j = i + 1; j < 20; ++j) edges.push_back({i, j, 100.0 - (j - i)});
  }
  edges.push_back({3, 20, 1});
  const std::vector<int> kept = SparseEdges(21, edges, 6);
  EXPECT_LT(kept.size(), 21u * 6);
  DisjointSets sets(21);
  int num_neighbors = 0, num_far = 0;
  for (const int edge : kept) {
    const GraphEdge& one = edges[static_cast<size_t>(edge)];
    sets.Join(one.node1, one.node2);
    num_neighbors += one.node2 - one.node1 == 1;
    num_far += one.node2 - one.node1 > 6 && one.node2 < 20;
  }
  EXPECT_THAT(sets.Groups(), SizeIs(1));
  EXPECT_EQ(num_neighbors, 19);
  EXPECT_GT(num_far, 10);
}

}  // namespace
}  // namespace roomtex
