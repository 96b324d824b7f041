#include "align/command/scan_reading.h"

#include <algorithm>
#include <utility>

#include "align/trust/station_check.h"
#include "core/resource_limits.h"
#include "core/surfels.h"
#include "importers/rtpi_header.h"
#include "importers/scan_reader.h"

namespace roomtex {
namespace {

// Another scan than the one that a model was aligned to before is no mistake here.
PlacedScans ReadScansToAlign(const AlignCommandOptions& a) {
  const double max_samples = a.bound.max_samples;
  const SampleWork work("aligning to", kAlignBytesPerSample, max_samples);
  ScanReaderOptions reader = a.scan_reader;
  reader.colors_as_intensity = !a.image_path.empty();
  if (!a.scan_paths.empty()) {
    return ReadPlacedScans(a.scan_paths, a.scan_poses, reader, max_samples);
  }
  return ReadScansOfModel(ReadAlignmentRecord(a.input_path),
                          {a.scan_paths, a.scan_poses, reader, max_samples});
}

// Stations that are off by more than this are misplaced (metres); drift and registration come to
// less.
constexpr double kMisplaced = 0.01;

// Scans of several stations against each other; the report's `stations`.
void CompareStations(const AlignCommandOptions& a, ScanReading* reading,
                     const Command::Context& context) {
  PlacedScans* const placed = &reading->placed;
  std::vector<Scan>* const scans = &placed->scans;
  context.report["stations"] = Json::array();
  if (scans->size() < 2) return;
  context.progress.Stage("stations");
  if (a.register_stations) {
    for (const int moved : RegisterStations(scans)) {
      context.Warn(ScanName(*scans, moved) + " was moved onto the other scans");
      int scan = 0;
      for (PlacedScans::File& file : placed->files) {
        for (size_t k = 0; k < file.placed.size(); ++k, ++scan) {
          if (scan == moved) file.placed[k] = true;  // the aligned model remembers where it is now
        }
      }
    }
  }
  const StationCheck check = CheckStations(*scans);
  context.report["stations"] = StationsToJson(check, *scans);
  if (check.wrong.empty()) return;
  reading->stations_problem = check.Sentence(*scans);
  reading->stations_offset = check.Worst()->offset;
}

}  // namespace

ScanReading::ScanReading(const AlignCommandOptions& a, const Command::Context& context)
    : placed(ReadScansToAlign(a)) {
  for (const std::string& note : placed.notes) context.Warn(note);
  context.report["sample_stride"] = placed.stride;
  if (placed.stride > 1) {
    context.progress.Note("The scans have more than --max_samples: of every " +
                          std::to_string(placed.stride) + " columns and rows one is held.");
  }
  ReplaceClouds(&placed.scans, context.options.num_threads);
  CompareStations(a, this, context);
  as_named = placed.SortByPath();
  geo = FindGeoReference(placed, ParseGeoOrigin(a.geo_origin));
  origin = LocalOrigin(placed.scans);
  origin.MoveToLocal(&placed.scans);
  SurveyOptions options{a.alignment.surface, a.planes, a.alignment.mesh};
  options.num_threads = context.options.num_threads;
  surveyed = std::make_unique<const SurveyedScans>(placed.scans, options);
}

void JudgeStations(const ScanReading& reading, const Command::Context& context) {
  if (reading.stations_problem.empty()) return;
  const double expected_mm = NumberAt(context.report.keys(), {"expected_error", "at_cameras_mm"});
  if (reading.stations_offset < kMisplaced && 1000 * reading.stations_offset < expected_mm) {
    context.Warn(reading.stations_problem + " The expected error is larger, and holds it.");
  } else {
    context.report.SetUntrusted(reading.stations_problem);
  }
}

std::string ScanReading::azimuth() const {
  for (const PlacedScans::File& file : placed.files) {
    if (!file.azimuth.empty()) return file.azimuth;
  }
  return "";
}

bool MayTurn(const AlignCommandOptions& a, const ScanReading& reading) {
  const std::vector<PlacedScans::File>& files = reading.placed.files;
  return a.scan_reader.azimuth == "auto" &&
         std::all_of(files.begin(), files.end(),
                     [](const PlacedScans::File& file) { return !file.azimuth.empty(); });
}

void TakeMirroredReading(MirroredReading found, ScanReading* reading,
                         const Command::Context& context) {
  for (PlacedScans::File& file : reading->placed.files) {
    if (file.azimuth.empty()) continue;
    context.Warn(file.path + " is read " + OtherAzimuth(file.azimuth) + " (--azimuth auto): read " +
                 file.azimuth + " it is a mirror image of the room; " + found.evidence + ".");
    file.azimuth = OtherAzimuth(file.azimuth);
  }
  reading->mirrored = std::move(found.scans);
  reading->surveyed = std::move(found.surveyed);
  reading->attempt = std::move(found.attempt);
}

}  // namespace roomtex
