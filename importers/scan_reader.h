#pragma once
// Reads any scan file: the content decides the format, not the extension.

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/scan.h"
#include "importers/geo_frame.h"
#include "importers/scan_bound.h"

namespace roomtex {

class OptionFields;

struct ScanReaderOptions {
  // RTPI: sense of the azimuth seen from above. "clockwise" is the thesis' formula (5.1.1), files
  // of real scanners are "counterclockwise"; the wrong one mirrors the room. "auto": by the header
  // where it is one of the scanner's own or of ours (AzimuthOfScanner, AzimuthOfFile), else
  // clockwise.
  std::string azimuth = "auto";
  // Unit of the coordinates in the file; "" = what the file says, metres if it does not. "" or one
  // of LengthUnitNames() (length_unit.h).
  std::string units;
  // Metres; samples farther away count as missing. 0 = the limit that the file gives, if any.
  double max_range = 0;
  // The axis of the file's coordinates that points up (UpAxisNames(), up_axis.h). "auto": what the
  // file says, otherwise as the grid or the surface show it (FindUpAxis), with a note where that is
  // not z.
  std::string up_axis = "auto";
  // E57: compare the checksums of the whole file before anything is read from it.
  bool e57_check = true;
  // Keep the colours of the file (Scan::colors), no option of the command line.
  bool colors = false;
  // Where the file has colours of most samples, their luma becomes the intensity, no option of the
  // command line either: it is what photos show.
  bool colors_as_intensity = false;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// All scans of one file (a PTX or an E57 may hold several), and what the file is.
struct ScanFile {
  std::vector<Scan> scans;         // at least one
  std::string format;              // "RTPI", "PTX", "PCD", "PLY", "OBJ", "E57", "LAS" or "XYZ"
  std::string byte_order;          // "little", "big" or "text"
  std::vector<std::string> notes;  // assumptions about the file that a user should know
  // RTPI: as it was read, "clockwise" or "counterclockwise"; and what there is to say about it, a
  // sentence or "". Other formats: "".
  std::string azimuth, azimuth_note;
  double meters_per_unit = 1;
  bool unit_is_said = false;  // LAS: by its coordinate system; XYZ: by the names of its columns
  // LAS: OGC WKT of the system that the coordinates are in as they were read; "" = not known, or
  // they became metres.
  std::string coordinate_system;
  // Of the first scan, as it was read, "" where that is none of UpAxisNames().
  std::string up_axis;

  // The file says where each of its scans stands.
  bool CarriesPoses() const { return format == "PTX" || format == "E57"; }
};
// path: a file, or one scan of an E57 (scan_path.h). Throws InputError (missing, not a scan, broken
// ...).
ScanFile ReadScanFile(const std::string& path, const ScanReaderOptions& options,
                      const ScanVisitor& visit = nullptr);

// The only scan of the file, of any kind. Throws InputError as above, and for a file with
// several.
Scan ReadScan(const std::string& path, const ScanReaderOptions& options);

// Several scans in one scan frame, all scans of all files. poses_path ("" = none)
// gives scan_from_station per scan, one line each:
//   NAME m00 ... m33                          4x4, row by row, metres
//   NAME qw qx qy qz tx ty tz                 metres
//   NAME geo LATITUDE LONGITUDE HEIGHT HEADING    a surveyed station, see SurveyedStation; degrees
// `#` starts a comment. NAME is the path or the file name (in double quotes if it has spaces); scan
// k (from 1) of a file with several is NAME#k. A pose here replaces that of a PTX, E57 or PCD.
// Surveyed stations stand alone: then every scan needs one, and the scan frame is east-north-up
// about the FIRST STATION OF THE FILE (z up, whatever the format of the scans); the scanner was
// levelled, or the file's own pose says how it leant. Several scans without a pose (PTX and E57
// carry their own) are an InputError.
struct PlacedScans {
  std::vector<Scan> scans;
  // The files that they came from, in the order of the paths.
  struct File {
    std::string path, azimuth, up_axis;  // as in ScanFile
    double meters_per_unit = 1;
    std::vector<bool> placed;   // one per scan of the file: its pose is one of poses_path
    ScanReaderOptions options;  // as it was read
  };
  std::vector<File> files;
  std::vector<std::string> notes;  // on azimuths and on scans of an E57; sentences
  // With surveyed stations: the scan frame, and one station per scan.
  std::optional<GeoFrame> enu;
  std::vector<SurveyedStation> stations;
  // Every stride-th column and row is held of each scan (ScanThinner); 1 = all.
  int stride = 1;

  // Puts the files, and their scans, into the order of their paths, so that what is computed from
  // them does not depend on how they were named. Returns the order as it was, for Reorder().
  std::vector<size_t> SortByPath();
  // File i becomes the one that was files[order[i]]. Scans behind those of the files stay there.
  void Reorder(const std::vector<size_t>& order);
  // Scan i is then the one that is scans[ScanOrder(order)[i]] now.
  std::vector<size_t> ScanOrder(const std::vector<size_t>& order) const;
};
// max_samples: held of all scans together, see ScanBound.
PlacedScans ReadPlacedScans(const std::vector<std::string>& paths, const std::string& poses_path,
                            const ScanReaderOptions& options,
                            double max_samples = std::numeric_limits<double>::infinity());
// The scans of `placed` once more, one after the other and each in full, read as they were read and
// standing where they stand there. index: in placed.scans.
void ForEachFullScan(const PlacedScans& placed,
                     const std::function<void(size_t index, Scan scan)>& take);
// The scans alone.
std::vector<Scan> ReadScans(const std::vector<std::string>& paths, const std::string& poses_path,
                            const ScanReaderOptions& options);
// What --scan_poses takes, for the help of the commands that have it.
const char* ScanPosesHelp();

}  // namespace roomtex
