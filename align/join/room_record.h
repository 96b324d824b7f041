#pragma once
// An aligned room as roomtex-join takes it: where its photos stand in its scans, and how exactly.
//
// Frames: `scan` is the room's own, that of its scans. `room` has the same axes and its origin amid
// the room's photos, so that UTM coordinates cost no digits. `site` is the scan frame of the first
// room.

#include <optional>
#include <string>
#include <vector>

#include "core/command_line.h"
#include "core/similarity.h"
#include "importers/scan_record.h"

namespace roomtex {

struct RoomPhoto {
  std::string name, path;  // relative to the folder of the photos; the file
  Rigid cam_from_room;
  // Standard deviations along and about an axis, metres and radians, as roomtex-align expects them.
  double position_sigma = 0, rotation_sigma = 0;
};

struct RoomRecord {
  std::string name;                                  // of its folder
  AlignmentRecord alignment;                         // in `scan`
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // of `room`, in `scan`
  std::optional<Eigen::Vector3d> up;                 // unit; none = no scan says it
  std::vector<RoomPhoto> photos;  // those with an expected error that nobody doubts, by name

  Rigid RoomFromScan() const { return {Eigen::Quaterniond::Identity(), -origin}; }
};

// result/hall/aligned and result/hall are both "hall".
std::string RoomName(const std::string& model_folder);

// image_path: "" = as alignment.json has it. Warns where photos cannot be looked at. Throws
// InputError for a folder that is no aligned model.
RoomRecord ReadRoom(const std::string& model_folder, const std::string& image_path,
                    const Command::Context& context);

}  // namespace roomtex
