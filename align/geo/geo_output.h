#pragma once
// The aligned model on the Earth: where the scan frame lies, the model about a chosen origin, its
// cameras in geodetic, ECEF and grid coordinates, and the photos' GPS as a check.

#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/sparse_model.h"
#include "core/report.h"
#include "importers/geo_frame.h"
#include "importers/scan_reader.h"

namespace roomtex {

// --geo_origin "LATITUDE,LONGITUDE,HEIGHT" or "LATITUDE,LONGITUDE,HEIGHT,HEADING".
struct GeoOrigin {
  GeoPosition position;
  // For scans without surveyed stations: degrees clockwise from north to the scan frame's forward
  // axis, as SurveyedStation::heading_deg.
  std::optional<double> heading_deg;
};
// None for "". Throws UsageError.
std::optional<GeoOrigin> ParseGeoOrigin(const std::string& text);
std::string GeoOriginHelp();

struct GeoReference {
  // `enu` about --geo_origin; without it about the first surveyed station, which is the scan frame.
  GeoFrame frame;
  Rigid enu_from_scan;
  bool surveyed = false;  // by stations; otherwise the scan frame's origin is --geo_origin itself
  bool heading_assumed = false;  // not surveyed, and no heading was given: north
};
// None without stations and origin. Throws UsageError for a heading beside surveyed stations.
std::optional<GeoReference> FindGeoReference(const PlacedScans& placed,
                                             const std::optional<GeoOrigin>& origin);

// Writes into `folder` (made if need be): the model about the origin (cameras, images, points3D
// .bin; frame `enu`), geo.json (the way on to ECEF and the grid) and cameras.csv (image_name,
// latitude, longitude, height, ecef_x, ecef_y, ecef_z, utm_zone, utm_easting, utm_northing; the
// grid of the origin's zone; empty where the grid does not reach). aligned: in the `scan` frame.
// doubt: why the alignment is not to be trusted, "" = it is; geo.json takes it along.
void WriteGeoModel(const SparseModel& aligned, const GeoReference& geo, const std::string& folder,
                   const std::string& doubt = "");

// Horizontal distances between the photos' EXIF GPS and their places in the aligned model, metres.
struct GpsCheck {
  struct Photo {
    std::string image_name;
    double horizontal = 0;
    std::optional<double> stated_error;
  };
  std::vector<Photo> photos;       // those with a position, in the order of the model
  int num_other_datum = 0;         // not compared: their position is not WGS84
  double median_horizontal = 0;    // of the photos
  double median_over_allowed = 0;  // median of distance / what GpsCheckOptions allow
  bool Agrees() const { return photos.empty() || median_over_allowed <= 1; }
};
struct GpsCheckOptions {
  double max_stated_errors = 3;  // times the error that the camera states; larger = more tolerant
  double max_unstated = 15;      // metres, when it states none: a good receiver under trees
};
GpsCheck CheckGps(const SparseModel& aligned, const GeoReference& geo,
                  const std::string& image_path, const GpsCheckOptions& options = {});

// The report's `geo`. gps: null without photos that have a position.
Json GeoToJson(const GeoReference& geo, const PlacedScans& placed, const GpsCheck& gps);
// What a user should know about it, in sentences.
std::vector<std::string> GeoWarnings(const SparseModel& aligned, const GeoReference& geo,
                                     const GpsCheck& gps);

}  // namespace roomtex
