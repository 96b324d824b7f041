#pragma once
// A simulated capture as a folder of files: what a photographer and a scanner would hand over, and
// beside it the truth.

#include <string>

#include "capture/simulation/simulated_room.h"
#include "core/output_set.h"
#include "core/progress.h"

namespace roomtex {

struct CaptureSummary {
  std::string picked_photo;  // "" without picks
  int num_picks = 0;
  size_t num_samples = 0, num_missing = 0;  // of all stations
};

// Writes into `folder` (made if needed), whole or not at all:
//   photos/           JPEG, with EXIF if the options say so
//   scan.rtpi         station 0; further ones are scan_1.rtpi ... with scan_poses.txt
//                     (scan_from_station)
//   picks.csv         clicks in one photo, in the format of docs/commands.md
//   cameras.txt       the true camera, as COLMAP writes it
//   camera_options.txt   the same as options of `colmap feature_extractor`
//   truth/            cameras.txt, images.txt, points3D.txt (true poses in the scan frame, without
//                     points), scan_from_room.txt, exposures.csv, true_colors.ply and, if asked
//                     for, reachable.ply (true_colors.h)
//   README.txt        what is what, and the commands to type
// Throws InputError if the folder cannot be written or its photos/ holds JPEGs of another capture.
CaptureSummary WriteCapture(const SimulatedRoom& room, const std::string& folder,
                            Progress* progress, bool reachable = false);
// The same, to be committed by the caller.
CaptureSummary MakeCapture(const SimulatedRoom& room, Progress* progress, bool reachable,
                           OutputSet* outputs);

}  // namespace roomtex
