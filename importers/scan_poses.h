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
  // Placement of scan `number` (Scan::number_in_file), one of `count` in the file at scan_path;
  // none if not named. up_in_station: the scanner's vertical axis. Throws InputError for a bare
  // name where the file holds several scans, and for a file name that two of the scans have.
  std::optional<Placement> Take(const std::string& scan_path, int number, int count,
                                const Eigen::Vector3d& up_in_station);
  // Throws InputError if a pose was for none of the scans: the name is mistyped.
  void RequireAllTaken() const;
  // What is wrong when Take() gave nothing for one of several scans.
  [[noreturn]] void ThrowMissing(const std::string& scan_path, int number, int count,
                                 size_t num_scans) const;

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
  Entry* Find(const std::string& scan_path, int number, int count);

  std::string path_;
  std::vector<Entry> entries_;
  std::map<std::string, size_t> entry_of_name_;
  std::vector<std::string> asked_for_;  // scans that Take() was called for
  std::optional<GeoFrame> enu_;
};

// Moves the scan from the pose it has to scan_from_station.
void PlaceScan(const Rigid& scan_from_station, Scan* scan);

}  // namespace roomtex
