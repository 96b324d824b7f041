#pragma once
// The scans of a run of roomtex-align, as they are read, and the alignment to them.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "align/command/align_options.h"
#include "align/command/local_origin.h"
#include "align/geo/geo_output.h"
#include "align/mirrored_reading.h"
#include "align/surveyed_scans.h"
#include "core/command_line.h"
#include "core/report.h"
#include "importers/scan_record.h"

namespace roomtex {

// The reading may turn out to be the other one (--azimuth auto). Reads the scans, compares stations
// with each other (the report's `stations`) and moves all about a near origin. Throws InputError.
struct ScanReading {
  ScanReading(const AlignCommandOptions& a, const Command::Context& context);
  ScanReading(const ScanReading&) = delete;  // the survey is one of these scans
  ScanReading& operator=(const ScanReading&) = delete;

  PlacedScans placed;            // about the origin and sorted by path, until WriteAligned()
  std::vector<size_t> as_named;  // the order of its files on the command line
  LocalOrigin origin{{}};
  bool picks_are_mirrored = false;  // where attempt.says_mirrored: made on the mirrored scan
  std::unique_ptr<const std::vector<Scan>> mirrored;  // in place of placed.scans
  std::unique_ptr<const SurveyedScans> surveyed;
  std::optional<GeoReference> geo;
  // Of stations that do not fit together: what is to be said, and by how much (metres).
  std::string stations_problem;
  double stations_offset = 0;
  AlignmentAttempt attempt;
  Json search;  // of an alignment without picks

  // Of the first RTPI scan; "" = there is none.
  std::string azimuth() const;
};

// Stations that do not fit together make an answer untrusted that claims to be nearer than they
// are: by the report's `expected_error`, once it is there.
void JudgeStations(const ScanReading& reading, const Command::Context& context);
// Nobody said how the scans are to be read, and all of them could be mirrored.
bool MayTurn(const AlignCommandOptions& a, const ScanReading& reading);
// The other reading of RTPI scans, with a warning that says what has shown it.
void TakeMirroredReading(MirroredReading found, ScanReading* reading,
                         const Command::Context& context);

}  // namespace roomtex
