#pragma once
// The file of --scan_poses: where each scan's station stands in the scan frame (format:
// scan_reader.h).

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "core/similarity.h"
#include "importers/geo_frame.h"

namespace roomtex {

class ScanPoses {
 public:
  // path "" = no poses. Throws InputError with the line: not a pose, not a rigid motion, no place
  // on Earth, a name twice, surveyed stations beside poses.
  explicit ScanPoses(const std::string& path);

  // The stations are surveyed, and the scan frame is enu() about the first of them.
  bool surveyed() const { return enu_.has_value(); }
  const std::optional<GeoFrame>& enu() const { return enu_; }
  bool empty() const { return entries_.empty(); }

  struct Placement {
    Rigid scan_from_station;
    std::optional<SurveyedStation> station;  // set when surveyed()
  };
  // A scan whose place is asked for.
  struct Asked {
    std::string path;           // of its file, as it was given
    int number = 1, count = 1;  // Scan::number_in_file; how many scans the file holds
    Eigen::Vector3d up_in_station = Eigen::Vector3d::UnitY();  // the scanner's vertical axis
    bool file_has_pose = false;                                // ScanFile::CarriesPoses()
  };
  // Its placement; none if it is not named here. Throws InputError for a bare name where the file
  // holds several scans, and for a file name that two of the scans have.
  std::optional<Placement> Take(const Asked& scan);
  // It is known where the scan stands: by `placement`, which Take() gave, or by its own file.
  bool IsPlaced(const Asked& scan, const std::optional<Placement>& placement) const {
    return placement || (scan.file_has_pose && !surveyed());
  }
  // Throws InputError if a pose was for none of the scans: the name is mistyped.
  void RequireAllTaken() const;
  // And if one of several scans asked for has no place, or any is not surveyed while others are.
  void RequireAllPlaced() const;

 private:
  struct Entry {
    std::string name;
    long line = 0;
    Rigid scan_from_station;
    std::optional<SurveyedStation> station = {};
    std::string taken_by = {};  // path of the scan
  };
  Entry ParseEntry(const std::string& line_text, long line) const;
  void AddEntry(Entry entry);
  Entry* Find(const Asked& scan);

  std::string path_;
  std::vector<Entry> entries_;
  std::map<std::string, size_t> entry_of_name_;
  std::vector<std::string> asked_for_;  // scans that Take() was called for
  std::optional<Asked> unplaced_;       // the first of them
  std::optional<GeoFrame> enu_;
};

// The vertical axis in the scanner's own frame.
inline Eigen::Vector3d UpInStation(const Scan& scan) {
  return scan.scan_from_station.rotation.conjugate() * scan.up;
}

// Moves the scan from the pose it has to scan_from_station.
void PlaceScan(const Rigid& scan_from_station, Scan* scan);

}  // namespace roomtex
