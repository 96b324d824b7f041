#pragma once
// What an aligned model remembers of its scans and of how far it is to be trusted: keys `scans`,
// `trusted` and `reason` of the alignment.json beside it (docs/commands.md). Who builds on the
// model reads the same scans in the same way.

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/command_line.h"
#include "core/report.h"
#include "core/similarity.h"
#include "importers/geo_frame.h"
#include "importers/scan_reader.h"

namespace roomtex {

// One scan file, as it was read.
struct ScanRecord {
  std::string path;                          // as it was given, without the part
  std::string part;                          // of an E57: the one scan that was read, "" = all
  std::string absolute_path, relative_path;  // relative to the folder of the model
  int64_t num_bytes = 0;
  std::string content_hash;    // HashOfFile()
  std::string azimuth;         // "" = no RTPI
  std::string units;           // as given, "" = by the file
  double meters_per_unit = 1;  // in effect
  double max_range = 0;        // metres, as given
  std::string up_axis;         // in effect; "" = as the file says it
  struct Pose {
    Rigid scan_from_station;
    bool given = false;  // by --scan_poses, else the file's own
    std::optional<SurveyedStation> station;
  };
  std::vector<Pose> poses;  // one per scan of the file
  // With surveyed stations: `scan` is east-north-up about this place.
  std::optional<GeoPosition> enu_origin;
};

// Of scans as ReadPlacedScans() or ReadScansOfModel() gave them. Hashes the files. model_folder:
// where the model is written. Throws InputError.
std::vector<ScanRecord> RecordScans(const PlacedScans& placed, const std::string& model_folder);
Json ToJson(const std::vector<ScanRecord>& records);

struct AlignmentRecord {
  std::string folder, path;  // of the model, of its alignment.json
  bool found = false;        // false: the model was not made by roomtex-align
  bool trusted = true;
  std::string reason;
  // Metres, at the far corner of the room, or at the photos where each was placed by itself; 0 =
  // not known.
  double expected_error = 0;
  // Metres: how far the sparse model and the scan were apart in shape (ShapeDisagreement::rms)
  // before the model was moved onto the scan.
  double disagreement = 0;
  std::vector<ScanRecord> scans;  // empty: not remembered
  // Photos that agree with nobody (align/trust/photo_verdict.h), by name: why they are left out, in
  // sentences.
  std::map<std::string, std::string> doubtful_photos;
};
// Throws InputError for a file that is there and cannot be understood.
AlignmentRecord ReadAlignmentRecord(const std::string& model_folder);

// Throws InputError where roomtex-align refused, and left its report without a model: that, and
// why. Before the model is read, which would only be found missing.
void RequireAlignedModel(const AlignmentRecord& record);

// What a command was given about scans; paths may be empty where a model remembers them.
struct ScanRequest {
  const std::vector<std::string>& paths;
  const std::string& poses_path;
  const ScanReaderOptions& options;
  double max_samples = std::numeric_limits<double>::infinity();  // held of all scans, see ScanBound
};
// Throws UsageError if there are no paths and nothing at model_folder could remember any: said
// before anything is read.
void RequireScans(const std::vector<std::string>& paths, const std::string& model_folder);

// The scans of an aligned model as it remembers them: those of request.paths (each must have the
// content of one that is remembered, whatever its name), or all of them, looked for where they
// were, at the same place relative to the model's folder, and under another name in either folder.
// A model that remembers none: ReadPlacedScans() of the request. Throws UsageError for options that
// contradict what is remembered (azimuth, units, max_range where they are given, poses), InputError
// for another scan and for one that is not found.
PlacedScans ReadScansOfModel(const AlignmentRecord& record, const ScanRequest& request);
// The same for a command that needs samples of all: notes on the scans are said, InputError for one
// without a measured sample.
PlacedScans ReadScansOfModel(const AlignmentRecord& record, const ScanRequest& request,
                             const Command::Context& context);

// The model's doubts are those of what is built on it: exit 4, or a warning if accept.
void TakeOverTrust(const AlignmentRecord& record, bool accept, const Command::Context& context);
// The option that sets `accept`.
inline constexpr char kAcceptUntrustedHelp[] =
    "Build on an alignment that is not trusted, with a warning; 0 = such results end with exit 4, "
    "too.";

}  // namespace roomtex
