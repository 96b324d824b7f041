#include "importers/geo_frame.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>

#include "core/frames.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// WGS84, NIMA TR8350.2.
constexpr double kSemiMajor = 6378137.0;
constexpr double kFlattening = 1 / 298.257223563;
constexpr double kSemiMinor = kSemiMajor * (1 - kFlattening);

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// The textbook formula (Hofmann-Wellenhof, GNSS, 8.9), independent of GeographicLib.
Eigen::Vector3d EcefOf(const GeoPosition& p) {
  const double latitude = RadFromDeg(p.latitude_deg), longitude = RadFromDeg(p.longitude_deg);
  const double e2 = kFlattening * (2 - kFlattening);
  const double n = kSemiMajor / std::sqrt(1 - e2 * std::sin(latitude) * std::sin(latitude));
  return {(n + p.height) * std::cos(latitude) * std::cos(longitude),
          (n + p.height) * std::cos(latitude) * std::sin(longitude),
          (n * (1 - e2) + p.height) * std::sin(latitude)};
}

struct Place {
  const char* name;
  GeoPosition position;
  const char* zone;
  int epsg;
};
std::ostream& operator<<(std::ostream& stream, const Place& place) { return stream << place.name; }

const Place kPlaces[] = {
    {"Singapore", {1.2966, 103.7764, 23.5}, "48N", 32648},
    {"SouthernHemisphere", {-33.8568, 151.2153, 41}, "56S", 32756},
    {"EquatorFromNorth", {0.001, 9.5, 350}, "32N", 32632},
    {"EquatorFromSouth", {-0.001, 9.5, 350}, "32S", 32732},
    {"BorderOfAZone", {48.2, 11.9999, 520}, "32N", 32632},
    {"Norway", {60.39, 5.32, 12}, "32N", 32632},
    {"DateLineFromWest", {-16.5, 179.9999, 5}, "60S", 32760},
    {"DateLineFromEast", {-16.5, -179.9999, 5}, "1S", 32701},
    {"DateLine", {-16.5, 180, 5}, "1S", 32701},
    {"NearNorthPole", {89.9999, 30, 2}, "UPS N", 5041},
    {"NorthPole", {90, 0, 2}, "UPS N", 5041},
    {"SouthPole", {-90, 0, 2835}, "UPS S", 5042},
    {"LastOfUtm", {83.9999, 20, 2}, "33N", 32633},
};

class EveryPlace : public testing::TestWithParam<Place> {
 protected:
  const GeoFrame frame_{GetParam().position};
};
INSTANTIATE_TEST_SUITE_P(All, EveryPlace, testing::ValuesIn(kPlaces),
                         [](const auto& place) { return std::string(place.param.name); });

// Points of a site half a kilometre around, one of them deep below.
std::vector<Eigen::Vector3d> SitePoints() {
  std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {0, 0, -300}};
  for (const double east : {-500.0, 0.25, 500.0}) {
    for (const double north : {-500.0, 0.125, 500.0}) {
      points.emplace_back(east, north, 0.01 * east);
    }
  }
  return points;
}

TEST_P(EveryPlace, GeodeticCoordinatesGoRoundToAMicrometre) {
  for (const Eigen::Vector3d& x_in_enu : SitePoints()) {
    const GeoPosition position = frame_.GeoFromEnu(x_in_enu);
    EXPECT_THAT(position.Problems(), IsEmpty());
    EXPECT_THAT(frame_.EnuFromGeo(position), IsNearMatrix(x_in_enu, 1e-6));
  }
}

TEST_P(EveryPlace, GridCoordinatesGoRoundToAMicrometre) {
  for (const Eigen::Vector3d& x_in_enu : SitePoints()) {
    const std::optional<GridPosition> grid = frame_.GridFromEnu(x_in_enu);
    ASSERT_TRUE(grid);
    EXPECT_EQ(grid->ZoneName(), GetParam().zone);
    EXPECT_EQ(grid->EpsgCode(), GetParam().epsg);
    const double height = frame_.GeoFromEnu(x_in_enu).height;
    EXPECT_THAT(frame_.EnuFromGrid(grid->easting, grid->northing, height),
                IsNearMatrix(x_in_enu, 1e-6));
  }
}

TEST_P(EveryPlace, EcefIsThatOfTheTextbook) {
  for (const Eigen::Vector3d& x_in_enu : SitePoints()) {
    EXPECT_THAT(frame_.EcefFromEnu() * x_in_enu,
                IsNearMatrix(EcefOf(frame_.GeoFromEnu(x_in_enu)), 1e-6));
  }
}

TEST_P(EveryPlace, AxesAreEastNorthUp) {
  const GeoPosition& origin = GetParam().position;
  const double latitude = RadFromDeg(origin.latitude_deg);
  const double longitude = RadFromDeg(origin.longitude_deg);
  Eigen::Matrix3d axes;  // columns in ECEF
  axes << -std::sin(longitude), -std::sin(latitude) * std::cos(longitude),
      std::cos(latitude) * std::cos(longitude), std::cos(longitude),
      -std::sin(latitude) * std::sin(longitude), std::cos(latitude) * std::sin(longitude), 0,
      std::cos(latitude), std::sin(latitude);
  EXPECT_THAT(frame_.EcefFromEnu().rotation.toRotationMatrix(), IsNearMatrix(axes, 1e-14));
}

TEST_P(EveryPlace, NeighboursInTheGridAreNeighboursInTheRoom) {
  const GridPosition origin = frame_.GridOfOrigin();
  for (const Eigen::Vector3d& x_in_enu : SitePoints()) {
    const std::optional<GridPosition> grid = frame_.GridFromEnu(x_in_enu);
    ASSERT_TRUE(grid);
    EXPECT_LT(std::hypot(grid->easting - origin.easting, grid->northing - origin.northing), 720);
  }
}

TEST_P(EveryPlace, GridIsTheRoomTurnedByTheConvergenceAndScaled) {
  const GridPosition origin = frame_.GridOfOrigin();
  const Eigen::Vector2d step(3, 4);
  const std::optional<GridPosition> grid = frame_.GridFromEnu({step.x(), step.y(), 0});
  ASSERT_TRUE(grid);
  // Points above the ellipsoid come closer together when they are taken down to it.
  const double down = 1 - GetParam().position.height / kSemiMajor;
  const Eigen::Rotation2Dd grid_from_true(RadFromDeg(origin.convergence_deg));
  EXPECT_THAT((Eigen::Vector2d{grid->easting - origin.easting, grid->northing - origin.northing}),
              IsNearMatrix(origin.scale * down * (grid_from_true * step), 2e-5));
}

TEST_P(EveryPlace, FramesOfOnePlaceAreOneRigidMotionApart) {
  const GeoFrame other(frame_.GeoFromEnu({300, -400, 20}));
  const Rigid other_from_frame = other.EnuFromOther(frame_);
  for (const Eigen::Vector3d& x_in_enu : SitePoints()) {
    EXPECT_THAT(other_from_frame * x_in_enu,
                IsNearMatrix(other.EnuFromGeo(frame_.GeoFromEnu(x_in_enu)), 1e-6));
  }
  EXPECT_THAT(frame_.EnuFromOther(other) * (other_from_frame * Eigen::Vector3d(1, 2, 3)),
              IsNearMatrix(Eigen::Vector3d(1, 2, 3), 1e-8));
}

TEST_P(EveryPlace, StationsHalfAKilometreApartSeeTheSamePoint) {
  // A point of the Earth, measured from a station there: by its own east-north-up frame.
  const Eigen::Vector3d station_in_enu(400, 300, 15);
  SurveyedStation station;
  station.position = frame_.GeoFromEnu(station_in_enu);
  const GeoFrame at_station(station.position);
  const Eigen::Vector3d x_in_local(7, -5, 2);
  const Eigen::Vector3d x_in_enu = frame_.EnuFromOther(at_station) * x_in_local;
  for (const double heading_deg : {0.0, 90.0, 217.25, -30.0, 360.0}) {
    station.heading_deg = heading_deg;
    const double h = RadFromDeg(heading_deg);
    const double forward = x_in_local.x() * std::sin(h) + x_in_local.y() * std::cos(h);
    const double right = x_in_local.x() * std::cos(h) - x_in_local.y() * std::sin(h);
    const Rigid y_up = frame_.EnuFromStation(station, Eigen::Vector3d::UnitY());
    EXPECT_THAT(y_up * Eigen::Vector3d(right, x_in_local.z(), -forward),
                IsNearMatrix(x_in_enu, 1e-6));
    const Rigid z_up = frame_.EnuFromStation(station, Eigen::Vector3d::UnitZ());
    EXPECT_THAT(z_up * Eigen::Vector3d(right, forward, x_in_local.z()),
                IsNearMatrix(x_in_enu, 1e-6));
    EXPECT_THAT(y_up.translation, IsNearMatrix(station_in_enu, 1e-6));
  }
}

TEST(GeoFrame, ANorthFacingStationAtTheOriginKeepsItsAxes) {
  const GeoPosition origin{47, 8, 500};
  const GeoFrame frame(origin);
  EXPECT_THAT(frame.EnuFromStation({origin, 0}, Eigen::Vector3d::UnitZ()),
              IsNearRigid(Rigid(), 1e-7, 1e-8));
  // y up: x stays east, -z becomes north, y becomes up; the next one faces east.
  const Rigid y_up = frame.EnuFromStation({origin, 0}, Eigen::Vector3d::UnitY());
  EXPECT_THAT(y_up * Eigen::Vector3d(1, 2, 3), IsNearMatrix(Eigen::Vector3d(1, -3, 2), 1e-8));
  const Rigid east = frame.EnuFromStation({origin, 90}, Eigen::Vector3d::UnitY());
  EXPECT_THAT(east * Eigen::Vector3d(0, 0, -1), IsNearMatrix(Eigen::Vector3d(1, 0, 0), 1e-8));
}

TEST(GeoFrame, ALeaningStationStandsUprightAndKeepsItsHeading) {
  const GeoPosition origin{47, 8, 500};
  const GeoFrame frame(origin);
  const Eigen::Vector3d up = Eigen::Vector3d(0.05, -0.03, 1).normalized();
  const Rigid leaning = frame.EnuFromStation({origin, 30}, up);
  EXPECT_THAT(leaning.rotation * up, IsNearMatrix(Eigen::Vector3d(0, 0, 1), 1e-9));
  const Eigen::Vector3d forward = leaning.rotation * Eigen::Vector3d::UnitY();
  EXPECT_NEAR(DegFromRad(std::atan2(forward.x(), forward.y())), 30, 1e-9);
}

TEST(GeoFrame, ThePlumbLineOfAStationIsItsOwn) {
  const GeoFrame frame({47, 8, 500});
  const GeoPosition there = frame.GeoFromEnu({0, 500, 0});
  const Rigid station = frame.EnuFromStation({there, 0}, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d up = station.rotation * Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(std::acos(std::min(1.0, up.z())), 500 / 6.37e6, 1e-6);
  EXPECT_GT(up.y(), 0);  // leans away from the origin
}

TEST(GeoFrame, TheGridZoneIsThatOfTheOriginOnBothSidesOfTheBorder) {
  const GeoFrame west({48.2, 11.998, 520});
  const GeoPosition beyond = west.GeoFromEnu({500, 0, 0});
  EXPECT_GT(beyond.longitude_deg, 12);
  EXPECT_EQ(west.GridFromEnu({500, 0, 0})->ZoneName(), "32N");
  EXPECT_EQ(GeoFrame(beyond).GridOfOrigin().ZoneName(), "33N");
}

TEST(GeoFrame, NorthingsGoOnBelowTheEquator) {
  const GeoFrame north({0.001, 9, 0});
  EXPECT_NEAR(north.GridFromEnu({0, -500, 0})->northing, -500 + 110.57, 1);
  const GeoFrame south({-0.001, 9, 0});
  EXPECT_NEAR(south.GridFromEnu({0, 500, 0})->northing, 1e7 + 500 - 110.57, 1);
  EXPECT_EQ(south.GridFromEnu({0, 500, 0})->ZoneName(), "32S");
}

TEST(GeoFrame, HasTheCoordinatesOfAKnownPlace) {
  // On the central meridian of zone 31 the easting is 500 000 m, the scale 0.9996 by definition.
  const GridPosition grid = GeoFrame({0, 3, 0}).GridOfOrigin();
  EXPECT_EQ(grid.ZoneName(), "31N");
  EXPECT_NEAR(grid.easting, 500000, 1e-6);
  EXPECT_NEAR(grid.northing, 0, 1e-6);
  EXPECT_NEAR(grid.scale, 0.9996, 1e-12);
  EXPECT_NEAR(grid.convergence_deg, 0, 1e-12);
  // The pole of UPS lies at 2 000 000, 2 000 000 with scale 0.994 by definition.
  const GridPosition pole = GeoFrame({90, 0, 0}).GridOfOrigin();
  EXPECT_NEAR(pole.easting, 2e6, 1e-6);
  EXPECT_NEAR(pole.northing, 2e6, 1e-6);
  EXPECT_NEAR(pole.scale, 0.994, 1e-12);
  EXPECT_THAT(GeoFrame({90, 0, 10}).EcefFromEnu().translation,
              IsNearMatrix(Eigen::Vector3d(0, 0, kSemiMinor + 10), 1e-8));
}

TEST(GeoFrame, PlacesFarAwayHaveNoGridCoordinates) {
  const GeoFrame frame({48, 11, 0});
  EXPECT_FALSE(frame.GridFromEnu({1e7, 0, 0}));
  EXPECT_FALSE(frame.GridFromEnu({kNan, 0, 0}));
  EXPECT_FALSE(GeoFrame({90, 0, 0}).GridFromEnu({0, 0, -1.9e7}));
}

TEST(HorizontalDistance, CountsAlongTheEllipsoid) {
  EXPECT_NEAR(HorizontalDistance({0, 0, 0}, {0, 1, 500}), kSemiMajor * kPi / 180, 1e-6);
  EXPECT_NEAR(HorizontalDistance({10, 179.9999, 0}, {10, -179.9999, 0}), 21.93, 0.02);
  EXPECT_EQ(HorizontalDistance({10, 180, 0}, {10, -180, 7}), 0);
}

TEST(GeoPosition, SaysWhatIsWrong) {
  EXPECT_THAT((GeoPosition{1.3, 103.8, 15}).Problems(), IsEmpty());
  EXPECT_THAT((GeoPosition{-90, 360, -400}).Problems(), IsEmpty());
  const auto exchanged = (GeoPosition{103.8, 1.3, 15}).Problems();
  ASSERT_THAT(exchanged, SizeIs(1));
  EXPECT_THAT(exchanged[0], HasSubstr("exchanged"));
  EXPECT_THAT((GeoPosition{1.3, 361, 15}).Problems(), SizeIs(1));
  EXPECT_THAT((GeoPosition{1.3, 103.8, 150000}).Problems(), SizeIs(1));
  EXPECT_THAT((GeoPosition{kNan, kNan, kNan}).Problems(), SizeIs(3));
}

}  // namespace
}  // namespace roomtex
