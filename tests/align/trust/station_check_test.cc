#include "align/trust/station_check.h"

#include <gmock/gmock.h>

#include "core/frames.h"
#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Scans of one room from three stations, all in one frame.
std::vector<Scan> MakeStations(int seed, int num_columns) {
  SimulatedRoomOptions options = CaseOptions(seed);
  options.num_stations = 3;
  options.scan_columns = num_columns;
  options.scan_rows = num_columns / 2;
  const SimulatedRoom room(options);
  std::vector<Scan> scans;
  for (int station = 0; station < 3; ++station) {
    scans.push_back(room.MakeScan(station));
    scans.back().path = "station_" + std::to_string(station) + ".rtpi";
  }
  return scans;
}

// The first `count` of them.
std::vector<Scan> Stations(int count) {
  static const std::vector<Scan> all = MakeStations(3, 500);
  return {all.begin(), all.begin() + count};
}

void Displace(const Eigen::Vector3d& metres, double deg, Scan* scan) {
  const Eigen::AngleAxisd turn(RadFromDeg(deg), Eigen::Vector3d(1, 2, 3).normalized());
  for (Eigen::Vector3d& point : scan->points) point = turn * point + metres;
  scan->scan_from_station = Rigid{Eigen::Quaterniond(turn), metres} * scan->scan_from_station;
}

TEST(StationCheck, StationsThatStandRightAgree) {
  const StationCheck check = CheckStations(Stations(2));
  ASSERT_EQ(check.pairs.size(), 1u);
  EXPECT_GT(check.pairs[0].num_patches, 400);
  EXPECT_LT(check.pairs[0].offset, 0.004);
  EXPECT_THAT(check.wrong, IsEmpty());
}

TEST(StationCheck, AStationThirtyMillimetresOffIsSaid) {
  std::vector<Scan> scans = Stations(2);
  Displace({0.02, -0.02, 0.01}, 0, &scans[1]);
  const StationCheck check = CheckStations(scans);
  EXPECT_THAT(check.wrong, ElementsAre(0, 1));  // two scans cannot tell which
  EXPECT_THAT(check.Sentence(scans), HasSubstr("station_1.rtpi"));
  EXPECT_NEAR(check.pairs[0].first_from_second.translation.norm(), 0.03, 0.006);
}

TEST(StationCheck, AStationTurnedByADegreeIsSaid) {
  std::vector<Scan> scans = Stations(2);
  Displace({0, 0, 0}, 1, &scans[1]);
  const StationCheck check = CheckStations(scans);
  EXPECT_THAT(check.wrong, Contains(1));
  EXPECT_NEAR(DegFromRad(check.pairs[0].turn), 1, 0.1);
}

TEST(StationCheck, OfThreeTheWrongOneIsNamedAndRegisteredAnew) {
  std::vector<Scan> scans = Stations(3);
  const std::vector<Scan> right = scans;
  Displace({-0.02, 0.03, 0.01}, 0.5, &scans[2]);
  EXPECT_THAT(CheckStations(scans).wrong, ElementsAre(2));
  EXPECT_THAT(RegisterStations(&scans), ElementsAre(2));
  EXPECT_THAT(CheckStations(scans).wrong, IsEmpty());
  for (size_t i = 0; i < scans[2].points.size(); i += 97) {
    if (!right[2].points[i].allFinite()) continue;
    EXPECT_LT((scans[2].points[i] - right[2].points[i]).norm(), 0.005);
  }
  EXPECT_EQ(scans[0].points[1000], right[0].points[1000]);
}

TEST(StationCheck, ScansOfDifferentRoomsSayNothing) {
  std::vector<Scan> scans = Stations(2);
  Displace({100, 0, 0}, 0, &scans[1]);
  const StationCheck check = CheckStations(scans);
  EXPECT_THAT(check.pairs, IsEmpty());
  EXPECT_EQ(check.Sentence(scans), "");
}

// Three rooms a hundred metres from each other (1700 cells of the patches): what is compared in
// each is what it is alone.
TEST(StationCheck, ScansOfOneFileAreCalledByTheirNumber) {
  std::vector<Scan> scans(3);
  for (int i = 0; i < 3; ++i) {
    scans[i].path = i < 2 ? "room.ptx" : "hall.ptx";
    scans[i].number_in_file = i < 2 ? i + 2 : 1;
  }
  StationCheck check;
  StationPair pair;
  pair.second = 1;
  pair.num_patches = 1000;
  pair.offset = 0.5;
  check.pairs = {pair};
  check.wrong = {0, 1, 2};
  const std::string sentence = check.Sentence(scans);
  EXPECT_NE(sentence.find("room.ptx#2 and room.ptx#3 are 500 mm"), std::string::npos) << sentence;
  EXPECT_NE(sentence.find("neighbours: room.ptx#2, room.ptx#3, hall.ptx."), std::string::npos)
      << sentence;
}

TEST(StationCheck, RoomsFarFromEachOtherAreComparedEachByItself) {
  const StationCheck alone = CheckStations(Stations(2));
  std::vector<Scan> scans;
  for (int station = 0; station < 2; ++station) {
    for (int room = 0; room < 3; ++room) {
      scans.push_back(Stations(2)[static_cast<size_t>(station)]);
      Displace({-102 + 102. * room, 0, 0}, 0, &scans.back());
    }
  }
  const StationCheck check = CheckStations(scans);
  ASSERT_EQ(check.pairs.size(), 3u);
  for (int room = 0; room < 3; ++room) {
    const StationPair& pair = check.pairs[static_cast<size_t>(room)];
    EXPECT_EQ(pair.first, room);
    EXPECT_EQ(pair.second, room + 3);
    EXPECT_NEAR(pair.offset, alone.pairs[0].offset, 0.001);
    EXPECT_NEAR(pair.num_patches, alone.pairs[0].num_patches, 0.1 * alone.pairs[0].num_patches);
  }
}

// Samples 4 cm apart on the walls: of cubes of 6 cm only those near the stations have enough.
TEST(StationCheck, StationsOfCoarseScansThatStandRightAgree) {
  std::vector<Scan> scans = MakeStations(1, 400);
  const StationCheck right = CheckStations(scans);
  EXPECT_EQ(right.pairs.size(), 3u);
  for (const StationPair& pair : right.pairs) EXPECT_LT(pair.offset, 0.002) << pair.first;
  EXPECT_THAT(right.wrong, IsEmpty());
  Displace({0.02, -0.02, 0.01}, 0, &scans[2]);
  EXPECT_THAT(CheckStations(scans).wrong, ElementsAre(2));
}

}  // namespace
}  // namespace roomtex
