#include "align/trust/appearance_search.h"

#include <gtest/gtest.h>

#include "align/start_appearance.h"
#include "core/frames.h"
#include "core/random_stream.h"

namespace roomtex {
namespace {

const Eigen::Vector3d kUpInScan = Eigen::Vector3d::UnitY();

Eigen::Vector3d InRoom(RandomStream* random) {
  const double x = random->Uniform(-2.5, 2.5), y = random->Uniform(-1.2, 1.3);
  return {x, y, random->Uniform(-2, 2)};
}

// A model that stands in the scan as `truth` says, and what is matched: `num_right` places as they
// are, to 2 cm, and others at random.
struct Matched {
  Similarity truth;
  Eigen::Vector3d up_in_sparse;  // off by 6 degrees
  std::vector<AppearanceMatch> matches;

  Matched(uint64_t seed, int num_right, int num_wrong) {
    RandomStream random(seed);
    truth.scale = random.Uniform(0.1, 3);
    truth.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(
        random.Uniform(0, 6), Eigen::Vector3d(0.3, 1, random.Uniform(-1, 1)).normalized()));
    truth.translation = InRoom(&random);
    const Eigen::AngleAxisd off(RadFromDeg(6), Eigen::Vector3d::UnitX());
    up_in_sparse = truth.rotation.conjugate() * (off * kUpInScan);
    for (int i = 0; i < num_right + num_wrong; ++i) {
      const Eigen::Vector3d x = InRoom(&random);
      const Eigen::Vector3d seen = i < num_right ? x : InRoom(&random);
      const Eigen::Vector3d noise(random.Gaussian(), random.Gaussian(), random.Gaussian());
      matches.push_back({truth.Inverse() * x, seen + 0.02 * noise});
    }
  }
  std::vector<AppearancePlace> Search(int num_threads = 2) const {
    return SearchByAppearance(matches, up_in_sparse, kUpInScan, {}, num_threads);
  }
  // Metres: the farthest that a corner of the room is off.
  double Error(const Similarity& found) const {
    double most = 0;
    for (const double x : {-2.5, 2.5}) {
      for (const double y : {-1.2, 1.3}) {
        const Eigen::Vector3d corner(x, y, 2);
        most = std::max(most, (found * (truth.Inverse() * corner) - corner).norm());
      }
    }
    return most;
  }
};

TEST(AppearanceSearch, FindsThePlaceAmongTenTimesAsManyWrongMatches) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const Matched matched(seed, 60, 600);
    const std::vector<AppearancePlace> places = matched.Search();
    ASSERT_FALSE(places.empty());
    EXPECT_LT(matched.Error(places[0].scan_from_sparse), 0.05);
    EXPECT_GE(places[0].num_cells, 50);
    EXPECT_TRUE(StandsOut(places, {}));
  }
}

TEST(AppearanceSearch, WithoutKnowingWhichWayIsUp) {
  const Matched matched(6, 60, 400);
  const std::vector<AppearancePlace> places =
      SearchByAppearance(matched.matches, std::nullopt, kUpInScan, {}, 2);
  ASSERT_FALSE(places.empty());
  EXPECT_LT(matched.Error(places[0].scan_from_sparse), 0.05);
}

TEST(AppearanceSearch, NoPlaceStandsOutAmongWrongMatches) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    EXPECT_FALSE(StandsOut(Matched(seed, 0, 800).Search(), {})) << seed;
  }
  EXPECT_TRUE(SearchByAppearance({}, std::nullopt, kUpInScan, {}, 2).empty());
}

// Somewhere else a poster of the room hangs as well.
TEST(AppearanceSearch, ManyMatchesAtOnePlaceCountOnce) {
  Matched matched(7, 60, 200);
  RandomStream random(8);
  const Eigen::Vector3d poster(1, 0.4, -2), elsewhere(-2, 0.4, 1);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d on_it(random.Uniform(-0.07, 0.07), random.Uniform(-0.07, 0.07), 0);
    matched.matches.push_back({matched.truth.Inverse() * (poster + on_it), elsewhere + on_it});
  }
  const std::vector<AppearancePlace> places = matched.Search();
  ASSERT_FALSE(places.empty());
  EXPECT_LT(matched.Error(places[0].scan_from_sparse), 0.05);
  EXPECT_LT(places[0].num_cells, 70);
}

TEST(AppearanceSearch, IsTheSameForEveryNumberOfThreads) {
  const Matched matched(9, 30, 300);
  const std::vector<AppearancePlace> one = matched.Search(1), four = matched.Search(4);
  ASSERT_EQ(one.size(), four.size());
  for (size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].num_cells, four[i].num_cells);
    EXPECT_EQ(one[i].scan_from_sparse.Matrix(), four[i].scan_from_sparse.Matrix());
  }
}

TEST(StandsOut, AsksForEnoughAndForMoreThanElsewhere) {
  const auto stands_out = [](int best, int second) {
    return StandsOut({{Similarity(), best}, {Similarity(), second}}, {});
  };
  EXPECT_TRUE(stands_out(67, 10));
  EXPECT_FALSE(stands_out(18, 0)) << "as rooms of the same plan have";
  EXPECT_FALSE(stands_out(67, 40));
  EXPECT_TRUE(StandsOut({{Similarity(), 67}}, {}));
  EXPECT_FALSE(StandsOut({}, {}));
}

}  // namespace
}  // namespace roomtex
