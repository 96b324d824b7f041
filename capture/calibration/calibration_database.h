#pragma once
// The calibrated camera in a copy of COLMAP's database.

#include <string>
#include <vector>

#include "core/camera_model.h"

namespace roomtex {

struct AppliedCameras {
  std::vector<uint32_t> same_size;  // ids of the cameras that got the calibration as it is
  std::vector<uint32_t> scaled;     // of those whose photos are larger or smaller in proportion
  std::vector<uint32_t> left;       // of those with another shape, which keep theirs
  std::vector<std::string> notes;   // sentences about scaled and left ones
  bool has_pairs = false;           // pairs of photos were verified with the old cameras
};

// Copies the database with all its tables to output_path (aside, then renamed) and gives its
// cameras the calibration, with prior_focal_length set. The database itself is opened read-only.
// Throws InputError when no camera has photos of the calibration's shape, or for the database's own
// faults.
AppliedCameras ApplyToDatabase(const Camera& calibrated, const std::string& database_path,
                               const std::string& output_path);

// Before the work, and before the rename: throws InputError where a log of SQLite (-wal, -journal)
// lies beside output_path, which would be played into the new file. Empty ones are removed.
void RequireNoLog(const std::string& output_path);
// Throws InputError where output_path, which nobody named, is a copy of the database in which
// something has been made since: photos, features or pairs.
void RequireNothingNew(const std::string& output_path, const std::string& database_path);

// The camera of photos enlarged to width x height, which must have exactly the same shape.
Camera ScaledCamera(const Camera& camera, int width, int height);

}  // namespace roomtex
