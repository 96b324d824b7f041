#include "importers/geo_frame.h"

#include <cmath>

#include <GeographicLib/Geocentric.hpp>
#include <GeographicLib/Geodesic.hpp>
#include <GeographicLib/LocalCartesian.hpp>
#include <GeographicLib/UTMUPS.hpp>

#include "core/frames.h"

namespace roomtex {
namespace {

using GeographicLib::UTMUPS;
using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// UTM counts southern northings from 10 000 km at the equator (UTMUPS::UTMShift()).
double NorthingShift(int zone) { return zone == UTMUPS::UPS ? 0.0 : UTMUPS::UTMShift(); }

Eigen::Matrix3d RotationFromArray(const std::vector<double>& row_major) {
  return Eigen::Map<const RowMajor3d>(row_major.data());
}

GeographicLib::LocalCartesian LocalAbout(const GeoPosition& origin) {
  return {origin.latitude_deg, origin.longitude_deg, origin.height};
}

// Throws GeographicErr when the place does not belong near that zone.
GridPosition GridOf(const GeoPosition& position, int zone) {
  GridPosition grid;
  UTMUPS::Forward(position.latitude_deg, position.longitude_deg, grid.zone, grid.north,
                  grid.easting, grid.northing, grid.convergence_deg, grid.scale, zone);
  return grid;
}

}  // namespace

std::vector<std::string> GeoPosition::Problems() const {
  std::vector<std::string> problems;
  // The Earth's crust and the air that carries aircraft; millimetres and feet fall outside.
  constexpr double kHighest = 100e3;
  if (!(std::abs(latitude_deg) <= 90)) {
    const bool exchanged = std::abs(longitude_deg) <= 90 && std::abs(latitude_deg) <= 360;
    problems.push_back("the latitude must lie within -90 and 90 degrees" +
                       std::string(exchanged ? " (latitude and longitude exchanged?)" : ""));
  }
  if (!(longitude_deg >= -180 && longitude_deg <= 360)) {
    problems.push_back("the longitude must lie within -180 and 360 degrees");
  }
  if (!(std::abs(height) <= kHighest)) {
    problems.push_back("the height must lie within -100000 and 100000 metres");
  }
  return problems;
}

double HorizontalDistance(const GeoPosition& a, const GeoPosition& b) {
  double distance = 0;
  GeographicLib::Geodesic::WGS84().Inverse(a.latitude_deg, a.longitude_deg, b.latitude_deg,
                                           b.longitude_deg, distance);
  return distance;
}

std::string GridPosition::ZoneName() const {
  if (zone == UTMUPS::UPS) return north ? "UPS N" : "UPS S";
  return std::to_string(zone) + (north ? "N" : "S");
}

int GridPosition::EpsgCode() const {
  // Of UPS the codes of easting before northing: 32661 and 32761 count northing first.
  if (zone == UTMUPS::UPS) return north ? 5041 : 5042;
  return (north ? 32600 : 32700) + zone;
}

GeoFrame::GeoFrame(const GeoPosition& origin) : origin_(origin) {
  std::vector<double> rotation(9);
  Eigen::Vector3d& translation = ecef_from_enu_.translation;
  GeographicLib::Geocentric::WGS84().Forward(origin.latitude_deg, origin.longitude_deg,
                                             origin.height, translation.x(), translation.y(),
                                             translation.z(), rotation);
  ecef_from_enu_.rotation = Eigen::Quaterniond(RotationFromArray(rotation)).normalized();
  grid_ = GridOf(origin, UTMUPS::STANDARD);
}

Rigid GeoFrame::EnuFromOther(const GeoFrame& other) const {
  // The large numbers are subtracted before anything is rotated.
  const Eigen::Quaterniond enu_from_ecef = ecef_from_enu_.rotation.conjugate();
  return {(enu_from_ecef * other.ecef_from_enu_.rotation).normalized(),
          enu_from_ecef * (other.ecef_from_enu_.translation - ecef_from_enu_.translation)};
}

Eigen::Vector3d GeoFrame::EnuFromGeo(const GeoPosition& position) const {
  Eigen::Vector3d x_in_enu;
  LocalAbout(origin_).Forward(position.latitude_deg, position.longitude_deg, position.height,
                              x_in_enu.x(), x_in_enu.y(), x_in_enu.z());
  return x_in_enu;
}

GeoPosition GeoFrame::GeoFromEnu(const Eigen::Vector3d& x_in_enu) const {
  GeoPosition position;
  LocalAbout(origin_).Reverse(x_in_enu.x(), x_in_enu.y(), x_in_enu.z(), position.latitude_deg,
                              position.longitude_deg, position.height);
  return position;
}

std::optional<GridPosition> GeoFrame::GridFromEnu(const Eigen::Vector3d& x_in_enu) const {
  if (!x_in_enu.allFinite()) return std::nullopt;
  try {
    GridPosition grid = GridOf(GeoFromEnu(x_in_enu), grid_.zone);
    if (grid.north != grid_.north) {
      // UPS has two separate maps; of UTM only the counting of the northings differs.
      if (grid.zone == UTMUPS::UPS) return std::nullopt;
      grid.northing += (grid_.north ? -1 : 1) * NorthingShift(grid.zone);
      grid.north = grid_.north;
    }
    return grid;
  } catch (const GeographicLib::GeographicErr&) {
    return std::nullopt;
  }
}

Eigen::Vector3d GeoFrame::EnuFromGrid(double easting, double northing, double height) const {
  GeoPosition position;
  position.height = height;
  UTMUPS::Reverse(grid_.zone, grid_.north, easting, northing, position.latitude_deg,
                  position.longitude_deg);
  return EnuFromGeo(position);
}

Rigid GeoFrame::EnuFromStation(const SurveyedStation& station,
                               const Eigen::Vector3d& up_in_station) const {
  Rigid enu_from_station;
  std::vector<double> rotation(9);
  Eigen::Vector3d& translation = enu_from_station.translation;
  LocalAbout(origin_).Forward(station.position.latitude_deg, station.position.longitude_deg,
                              station.position.height, translation.x(), translation.y(),
                              translation.z(), rotation);
  const Eigen::Matrix3d enu_from_local = RotationFromArray(rotation);
  // The station's axes, made orthogonal to its vertical: columns right, forward, up.
  const auto axes = [](const Eigen::Vector3d& forward, const Eigen::Vector3d& up) {
    Eigen::Matrix3d columns;
    const Eigen::Vector3d right = forward.cross(up).normalized();
    columns << right, up.cross(right), up;
    return columns;
  };
  const bool is_y_up = std::abs(up_in_station.y()) > std::abs(up_in_station.z());
  const Eigen::Vector3d forward_in_station =
      is_y_up ? -Eigen::Vector3d::UnitZ().eval() : Eigen::Vector3d::UnitY().eval();
  const double heading = RadFromDeg(station.heading_deg);
  const Eigen::Vector3d forward_in_local(std::sin(heading), std::cos(heading), 0);
  const Eigen::Matrix3d local_from_station =
      axes(forward_in_local, Eigen::Vector3d::UnitZ()) *
      axes(forward_in_station, up_in_station.normalized()).transpose();
  enu_from_station.rotation =
      Eigen::Quaterniond(Eigen::Matrix3d(enu_from_local * local_from_station)).normalized();
  return enu_from_station;
}

}  // namespace roomtex
