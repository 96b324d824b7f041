#pragma once
// Places on the Earth and the local east-north-up frame about one of them. The only user of
// GeographicLib (geodesics: Karney 2013; transverse Mercator: Karney 2011). Everything is double
// precision and WGS84; heights are above the ELLIPSOID (not above sea level: no geoid model is
// used).

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/similarity.h"

namespace roomtex {

struct GeoPosition {
  double latitude_deg = 0;   // -90..90, north positive
  double longitude_deg = 0;  // -180..360, east positive
  double height = 0;         // metres above the WGS84 ellipsoid

  // Everything that keeps this from being a place at which someone scans.
  std::vector<std::string> Problems() const;
};

// Length of the shortest way on the ellipsoid, metres; heights do not count.
double HorizontalDistance(const GeoPosition& a, const GeoPosition& b);

// A scanner set up over a known point. The position is that of the scanner's origin, the point all
// ranges start from (not the mark under the tripod).
struct SurveyedStation {
  GeoPosition position;
  // Degrees clockwise from true north to the station's forward axis: -z (azimuth 0 of the thesis'
  // formula) where y is up, y where z is up. Heading 0 makes the axes of a z-up station east,
  // north, up.
  double heading_deg = 0;
};

// Coordinates of the map grid: UTM, and UPS (polar stereographic) beyond 84 N and 80 S.
struct GridPosition {
  int zone = 0;  // 1..60; 0 = UPS
  bool north = true;
  double easting = 0, northing = 0;  // metres
  double convergence_deg = 0;        // of grid north, clockwise from true north
  double scale = 1;                  // grid metres per metre on the ellipsoid

  std::string ZoneName() const;  // "48N", "33S", "UPS N", "UPS S"
  int EpsgCode() const;          // of the WGS84 grid, easting first: 32648 ...
};

// The `enu` frame about an origin: x east, y north, z up along the ellipsoid's normal there.
class GeoFrame {
 public:
  // origin must have no Problems().
  explicit GeoFrame(const GeoPosition& origin);

  const GeoPosition& origin() const { return origin_; }
  // ECEF: Earth-centred, Earth-fixed; x to longitude 0, z to the north pole, metres.
  const Rigid& EcefFromEnu() const { return ecef_from_enu_; }
  // This frame from another one; accurate to nanometres over short distances.
  Rigid EnuFromOther(const GeoFrame& other) const;

  Eigen::Vector3d EnuFromGeo(const GeoPosition& position) const;
  // Longitude within -180..180.
  GeoPosition GeoFromEnu(const Eigen::Vector3d& x_in_enu) const;

  // Grid coordinates in the zone and hemisphere of the ORIGIN, so that neighbours across the border
  // of a zone or the equator stay neighbours (northings south of the equator are then negative).
  // None if the place is too far away for that zone.
  std::optional<GridPosition> GridFromEnu(const Eigen::Vector3d& x_in_enu) const;
  GridPosition GridOfOrigin() const { return grid_; }
  // Inverse of GridFromEnu.
  Eigen::Vector3d EnuFromGrid(double easting, double northing, double height) const;

  // Pose of a surveyed station whose vertical axis is up_in_station (unit length; levelled: an
  // axis). Its plumb line is that of its own place: half a kilometre away it leans by 0.08 mrad.
  Rigid EnuFromStation(const SurveyedStation& station, const Eigen::Vector3d& up_in_station) const;

 private:
  GeoPosition origin_;
  Rigid ecef_from_enu_;
  GridPosition grid_;
};

}  // namespace roomtex
