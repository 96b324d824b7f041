#include "align/geo/geo_output.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <sstream>

#include <fmt/core.h>

#include "core/csv.h"
#include "core/error.h"
#include "core/output_file.h"
#include "core/photo.h"
#include "core/statistics.h"
#include "core/stays_inside.h"
#include "core/text.h"

namespace roomtex {
namespace {

// Farther from the origin the frame is no longer the horizontal of the place.
constexpr double kFarFromOrigin = 10e3;

std::optional<double> NumberFrom(std::string text) {
  const auto is_space = [](unsigned char c) { return std::isspace(c) != 0; };
  text.erase(std::remove_if(text.begin(), text.end(), is_space), text.end());
  return ParseNumber(text);
}

Eigen::Vector3d CameraInEnu(const SparseImage& image, const GeoReference& geo) {
  return geo.enu_from_scan * image.cam_from_model.TargetOriginInSource();
}

Json PositionToJson(const GeoPosition& position) {
  Json json;
  json["latitude"] = position.latitude_deg;
  json["longitude"] = position.longitude_deg;
  json["height"] = position.height;
  return json;
}

Json GridToJson(const GridPosition& grid) {
  Json json;
  json["zone"] = grid.ZoneName();
  json["easting"] = grid.easting;
  json["northing"] = grid.northing;
  json["epsg"] = grid.EpsgCode();
  json["convergence_deg"] = grid.convergence_deg;
  json["scale"] = grid.scale;
  return json;
}

Json RigidToJson(const Rigid& rigid) {
  return ToJson(Similarity{1, rigid.rotation, rigid.translation});
}

// The whole way from enu to the grid for PROJ (cct, pyproj, PDAL): a grid is no rigid motion away.
std::string ProjPipeline(const GeoFrame& frame) {
  const GeoPosition& origin = frame.origin();
  const GridPosition grid = frame.GridOfOrigin();
  return fmt::format(
      "+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84 +lat_0={} +lon_0={} +h_0={} +step "
      "+inv +proj=cart +ellps=WGS84 +step +proj={}{} +ellps=WGS84",
      Exact(origin.latitude_deg), Exact(origin.longitude_deg), Exact(origin.height),
      grid.zone == 0 ? "ups" : fmt::format("utm +zone={}", grid.zone), grid.north ? "" : " +south");
}

Json FrameToJson(const GeoReference& geo) {
  Json json;
  json["frame"] = "enu: x east, y north, z up, metres, about the origin";
  json["datum"] = "WGS84; heights above the ellipsoid, not above sea level";
  json["origin"] = PositionToJson(geo.frame.origin());
  json["ecef"] = ToJson(geo.frame.EcefFromEnu().translation);
  json["utm"] = GridToJson(geo.frame.GridOfOrigin());
  json["ecef_from_enu"] = RigidToJson(geo.frame.EcefFromEnu());
  Json matrix = Json::array();
  const Eigen::Matrix<double, 3, 4> ecef_from_enu = geo.frame.EcefFromEnu().Matrix();
  for (int row = 0; row < 3; ++row) {
    matrix.push_back(ToJson(Eigen::VectorXd(ecef_from_enu.row(row).transpose())));
  }
  json["ecef_from_enu_matrix"] = matrix;
  json["proj_utm_from_enu"] = ProjPipeline(geo.frame);
  json["enu_from_scan"] = RigidToJson(geo.enu_from_scan);
  json["surveyed"] = geo.surveyed;
  json["heading_assumed"] = geo.heading_assumed;
  return json;
}

void WriteCameras(const SparseModel& aligned, const GeoReference& geo, const std::string& path) {
  OutputFile file(path);
  file.stream() << CsvLine({"image_name", "latitude", "longitude", "height", "ecef_x", "ecef_y",
                            "ecef_z", "utm_zone", "utm_easting", "utm_northing"});
  for (const auto& [id, image] : aligned.images) {
    const Eigen::Vector3d x_in_enu = CameraInEnu(image, geo);
    const GeoPosition position = geo.frame.GeoFromEnu(x_in_enu);
    const Eigen::Vector3d x_in_ecef = geo.frame.EcefFromEnu() * x_in_enu;
    const std::optional<GridPosition> grid = geo.frame.GridFromEnu(x_in_enu);
    // A tenth of a micrometre in each.
    constexpr int kMetreDigits = 7, kDegreeDigits = 12;
    file.stream() << CsvLine(
        {image.name, Number(position.latitude_deg, kDegreeDigits),
         Number(position.longitude_deg, kDegreeDigits), Number(position.height, kMetreDigits),
         Number(x_in_ecef.x(), kMetreDigits), Number(x_in_ecef.y(), kMetreDigits),
         Number(x_in_ecef.z(), kMetreDigits), grid ? grid->ZoneName() : "",
         grid ? Number(grid->easting, kMetreDigits) : "",
         grid ? Number(grid->northing, kMetreDigits) : ""});
  }
  file.Commit();
}

// "WGS-84", "WGS84", "WGS 84" ...; cameras that name no datum mean it (EXIF 2.3, GPSMapDatum).
bool IsWgs84(const std::string& datum) {
  return datum.find_first_not_of(' ') == std::string::npos || datum.find("84") != std::string::npos;
}

Json GpsToJson(const GpsCheck& gps) {
  if (gps.photos.empty() && gps.num_other_datum == 0) return nullptr;
  Json json;
  json["num_photos"] = gps.photos.size();
  json["num_other_datum"] = gps.num_other_datum;
  json["median_horizontal_m"] = gps.photos.empty() ? Json(nullptr) : Json(gps.median_horizontal);
  json["median_over_allowed"] = gps.photos.empty() ? Json(nullptr) : Json(gps.median_over_allowed);
  json["agrees"] = gps.Agrees();
  Json per_photo = Json::array();
  for (const GpsCheck::Photo& photo : gps.photos) {
    Json one;
    one["image_name"] = photo.image_name;
    one["horizontal_m"] = photo.horizontal;
    one["stated_error_m"] = photo.stated_error ? Json(*photo.stated_error) : Json(nullptr);
    per_photo.push_back(one);
  }
  json["per_photo"] = per_photo;
  return json;
}

// "12 m", "3.4 km".
std::string Length(double metres) {
  const bool is_far = metres >= 10000;
  return Significant(is_far ? metres / 1000 : metres, metres < 10 || is_far ? 2 : 4) +
         (is_far ? " km" : " m");
}

}  // namespace

std::optional<GeoOrigin> ParseGeoOrigin(const std::string& text) {
  if (text.empty()) return std::nullopt;
  std::vector<double> numbers;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) {
    const std::optional<double> number = NumberFrom(part);
    if (!number) {
      numbers.clear();
      break;
    }
    numbers.push_back(*number);
  }
  if ((numbers.size() != 3 && numbers.size() != 4) || text.back() == ',') {
    throw UsageError("--geo_origin is \"" + text +
                     "\", expected LATITUDE,LONGITUDE,HEIGHT in degrees and metres, and HEADING in "
                     "degrees if the scans have no surveyed stations");
  }
  GeoOrigin origin;
  origin.position = {numbers[0], numbers[1], numbers[2]};
  if (numbers.size() == 4) origin.heading_deg = numbers[3];
  std::vector<std::string> problems = origin.position.Problems();
  if (origin.heading_deg && !(std::abs(*origin.heading_deg) <= 360)) {
    problems.push_back("the heading must lie within -360 and 360 degrees");
  }
  for (std::string& problem : problems) problem = "--geo_origin " + text + ": " + problem;
  ThrowIfProblems(problems);
  return origin;
}

std::string GeoOriginHelp() {
  return "LATITUDE,LONGITUDE,HEIGHT (degrees WGS84, metres above the ellipsoid, not above sea "
         "level): writes the aligned model also to geo/ in the output folder, east-north-up about "
         "this place, with geo.json (how to get to ECEF and UTM) and cameras.csv (latitude, "
         "longitude, height, ECEF, UTM). Where the scans lie is told by surveyed stations in "
         "--scan_poses. Without them this place is the origin of the scan frame, and a fourth "
         "number HEADING is the direction of its -z axis (z-up scans: y axis), degrees clockwise "
         "from north.";
}

std::optional<GeoReference> FindGeoReference(const PlacedScans& placed,
                                             const std::optional<GeoOrigin>& origin) {
  if (placed.enu) {
    if (!origin) return GeoReference{*placed.enu, Rigid(), true, false};
    if (origin->heading_deg) {
      throw UsageError(
          "--geo_origin has a fourth number, a heading, but --scan_poses gives the stations' own. "
          "Leave it out");
    }
    const GeoFrame frame(origin->position);
    return GeoReference{frame, frame.EnuFromOther(*placed.enu), true, false};
  }
  if (!origin) return std::nullopt;
  // The scan frame itself stands like a station at the origin.
  const GeoFrame frame(origin->position);
  const SurveyedStation station{origin->position, origin->heading_deg.value_or(0)};
  return GeoReference{frame, frame.EnuFromStation(station, placed.scans.at(0).up), false,
                      !origin->heading_deg};
}

void WriteGeoModel(const SparseModel& aligned, const GeoReference& geo, const std::string& folder,
                   const std::string& doubt) {
  SparseModel model = aligned;
  TransformModel({1, geo.enu_from_scan.rotation, geo.enu_from_scan.translation}, &model);
  WriteSparseModel(model, folder);
  Json json = FrameToJson(geo);
  json["trusted"] = doubt.empty();
  json["reason"] = doubt;
  WriteJson(folder + "/geo.json", json);
  WriteCameras(aligned, geo, folder + "/cameras.csv");
}

GpsCheck CheckGps(const SparseModel& aligned, const GeoReference& geo,
                  const std::string& image_path, const GpsCheckOptions& options) {
  GpsCheck check;
  if (image_path.empty()) return check;
  std::vector<double> distances, over_allowed;
  for (const auto& [id, image] : aligned.images) {
    if (!StaysInside(image.name)) continue;
    const std::optional<GpsData> gps = ReadGpsData(image_path + "/" + image.name);
    if (!gps) continue;
    if (!IsWgs84(gps->datum)) {
      ++check.num_other_datum;
      continue;
    }
    const GeoPosition place = geo.frame.GeoFromEnu(CameraInEnu(image, geo));
    const double distance = HorizontalDistance(place, {gps->latitude_deg, gps->longitude_deg, 0});
    check.photos.push_back({image.name, distance, gps->horizontal_error});
    distances.push_back(distance);
    const double allowed = gps->horizontal_error
                               ? options.max_stated_errors * *gps->horizontal_error
                               : options.max_unstated;
    over_allowed.push_back(distance / allowed);
  }
  check.median_horizontal = MidpointMedian(distances);
  check.median_over_allowed = MidpointMedian(over_allowed);
  return check;
}

Json GeoToJson(const GeoReference& geo, const PlacedScans& placed, const GpsCheck& gps) {
  Json json = FrameToJson(geo);
  json["stations"] = Json::array();
  for (size_t i = 0; i < placed.stations.size(); ++i) {
    const SurveyedStation& station = placed.stations[i];
    Json one;
    one["scan"] = std::filesystem::path(placed.scans[i].path).filename().string();
    one.update(PositionToJson(station.position));
    one["heading"] = station.heading_deg;
    one["x_in_enu"] = ToJson(geo.frame.EnuFromGeo(station.position));
    json["stations"].push_back(one);
  }
  json["gps"] = GpsToJson(gps);
  return json;
}

std::vector<std::string> GeoWarnings(const SparseModel& aligned, const GeoReference& geo,
                                     const GpsCheck& gps) {
  std::vector<std::string> warnings;
  if (geo.heading_assumed) {
    warnings.push_back(
        "no station is surveyed and --geo_origin gives no heading: the forward axis of the scan "
        "frame is taken to face north");
  }
  std::vector<double> distances;
  for (const auto& [id, image] : aligned.images) {
    distances.push_back(CameraInEnu(image, geo).norm());
  }
  if (MidpointMedian(distances) > kFarFromOrigin) {
    warnings.push_back("the photos lie " + Length(MidpointMedian(distances)) +
                       " from the geographic origin: check --geo_origin and the scan's "
                       "coordinates");
  }
  if (!gps.Agrees()) {
    warnings.push_back(
        "the GPS of the photos lies " + Length(gps.median_horizontal) + " (median of " +
        std::to_string(gps.photos.size()) +
        ") from where the alignment puts them, more than expected: check coordinates and headings. "
        "Inside buildings GPS is often wrong, so this alone says nothing against the alignment");
  }
  return warnings;
}

}  // namespace roomtex
