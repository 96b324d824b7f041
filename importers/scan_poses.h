#pragma once
// The file of --scan_poses: where each scan's station stands in the scan frame (format:
// scan_reader.h).

#include <optional>
#include <string>
#include <vector>

#include "core/scan.h"
#include "core/similarity.h"

namespace roomtex {

class ScanPoses {
 public:
  // path "" = no poses. Throws InputError with the line: not a pose, not a rigid motion, a name
  // twice.
  explicit ScanPoses(const std::string& path);

  // scan_from_station for scan `index` (from 0) of the `count` scans in the file at scan_path; none
  // if not named. Throws InputError for a bare name where the file holds several scans.
  std::optional<Rigid> Take(const std::string& scan_path, int index, int count);
  // Throws InputError if a pose was for none of the scans: the name is mistyped.
  void RequireAllTaken() const;

 private:
  struct Entry {
    std::string name;
    long line;
    Rigid scan_from_station;
    bool taken = false;
  };
  std::string path_;
  std::vector<Entry> entries_;
};

// Moves the scan from the pose it has to scan_from_station.
void PlaceScan(const Rigid& scan_from_station, Scan* scan);

}  // namespace roomtex
