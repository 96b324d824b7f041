#include "core/cloud_stations.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gmock/gmock.h>

#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

struct Box {
  Eigen::Vector3d low, high;

  // Where a ray from inside leaves it, or from outside meets it; infinity = never.
  double Meets(const Eigen::Vector3d& from, const Eigen::Vector3d& along, bool from_inside) const {
    double enter = -std::numeric_limits<double>::infinity(), leave = -enter;
    for (int k = 0; k < 3; ++k) {
      const double a = (low[k] - from[k]) / along[k], b = (high[k] - from[k]) / along[k];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    if (from_inside) return leave;
    return enter > 0 && enter < leave ? enter : std::numeric_limits<double>::infinity();
  }
};

// A room of 6 x 5 x 2.7 m with a beam, cupboards, a table top, posts and boxes.
const Box kRoom{{0, 0, 0}, {6, 5, 2.7}};
const Box kThings[] = {{{0, 2.2, 2.4}, {6, 2.4, 2.7}},      {{4.5, 0, 0}, {5.5, 0.6, 1.9}},
                       {{1.5, 3.0, 0.7}, {3.0, 4.0, 0.75}}, {{3.6, 3.2, 0}, {3.8, 3.4, 2.7}},
                       {{0.5, 0.3, 0}, {0.9, 0.9, 1.2}},    {{0.4, 4.2, 0}, {1.2, 4.8, 2.0}},
                       {{3.2, 0.8, 0}, {3.7, 1.4, 0.8}},    {{5.0, 2.8, 0.4}, {5.6, 4.4, 0.5}},
                       {{2.6, 2.5, 0}, {2.7, 2.6, 2.0}},    {{3.0, 4.5, 1.5}, {4.0, 4.8, 1.6}},
                       {{0.9, 2.0, 0}, {1.2, 2.3, 0.9}}};

// Column by column of a scanner's grid, 2 * rows columns.
void Measure(const Eigen::Vector3d& station, int rows, Scan* cloud) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.002);
  for (int i = 0; i < 2 * rows * rows; ++i) {
    const double azimuth = (i / rows + 0.3) * M_PI / rows;
    const double elevation = ((i % rows + 0.4) / rows - 0.5) * M_PI;
    const Eigen::Vector3d along(std::cos(azimuth) * std::cos(elevation),
                                std::sin(azimuth) * std::cos(elevation), std::sin(elevation));
    double range = kRoom.Meets(station, along, true);
    for (const Box& thing : kThings) range = std::min(range, thing.Meets(station, along, false));
    cloud->points.push_back(station + (range + noise(random)) * along);
    cloud->intensity.push_back(0);
  }
  cloud->num_columns = static_cast<int>(cloud->points.size());
  cloud->num_rows = 1;
}

const Eigen::Vector3d kFirst(2.0, 1.3, 1.5), kSecond(4.6, 3.9, 1.6);

Scan CloudFrom(const std::vector<std::pair<Eigen::Vector3d, int>>& stations) {
  Scan cloud;
  cloud.organised = false;
  for (const auto& [station, rows] : stations) Measure(station, rows, &cloud);
  return cloud;
}

TEST(CloudStations, OneIsFoundWhereItStood) {
  const Scan cloud = CloudFrom({{kFirst, 250}});
  const auto stations = FindStations(cloud, 2);
  ASSERT_THAT(stations, SizeIs(1));
  EXPECT_THAT(stations[0].place, IsNearMatrix(kFirst, 0.1));
  EXPECT_EQ(stations[0].begin, 0U);
  EXPECT_EQ(stations[0].end, cloud.points.size());
  EXPECT_NEAR(stations[0].angular_spacing, std::sqrt(4 * M_PI / 125000), 1.5e-3);
  const auto alone = FindStations(cloud, 1);
  ASSERT_THAT(alone, SizeIs(1));
  EXPECT_EQ(alone[0].place, stations[0].place);
}

TEST(CloudStations, MergedOnesAreFoundOneAfterTheOther) {
  const Scan cloud = CloudFrom({{kFirst, 220}, {kSecond, 220}});
  const auto stations = FindStations(cloud, 2);
  ASSERT_THAT(stations, SizeIs(2));
  EXPECT_THAT(stations[0].place, IsNearMatrix(kFirst, 0.1));
  EXPECT_THAT(stations[1].place, IsNearMatrix(kSecond, 0.1));
  EXPECT_EQ(stations[0].end, 96800U);
  EXPECT_EQ(stations[1].end, cloud.points.size());
}

TEST(CloudStations, MixedOnesHaveNone) {
  Scan cloud = CloudFrom({{kFirst, 150}, {kSecond, 150}});
  std::mt19937 random(5);
  std::shuffle(cloud.points.begin(), cloud.points.end(), random);
  EXPECT_THAT(FindStations(cloud, 2), IsEmpty());
  EXPECT_THAT(FindStations(Scan(), 2), IsEmpty());
}

TEST(CloudStations, AWallDoesNotSayWhereItWasSeenFrom) {
  for (const double thickness : {0.0, 0.02}) {
    Scan cloud;
    cloud.organised = false;
    for (int i = 0; i < 60000; ++i) {
      cloud.points.emplace_back(0.02 * (i % 300), 0.015 * (i / 300), thickness * (i % 7));
    }
    EXPECT_THAT(FindStations(cloud, 2), IsEmpty());
  }
}

}  // namespace
}  // namespace roomtex
