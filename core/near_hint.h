#pragma once
// What a user says of a photo and a place of the scan, which the search without picks keeps to.

#include <string>

#include <Eigen/Core>

namespace roomtex {

// A photo shows a place: `--near PHOTO,X,Y,Z`.
struct NearHint {
  std::string image_name;
  Eigen::Vector3d x_in_scan = Eigen::Vector3d::Zero();
};

inline constexpr char kNearHelp[] =
    "PHOTO,X,Y,Z: a photo and a place of the scan that it shows (metres, scan frame), a hint for "
    "the search without picks.";

// Of the text of the option. Throws UsageError.
NearHint ParseNearHint(const std::string& text);

}  // namespace roomtex
