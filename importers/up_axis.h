#pragma once
// Which way is up in a scan whose format does not say it.

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

// The axis of the scan frame (y or z) that points up: z unless the scan clearly says y.
//
// Grids: a scanner takes a column from the bottom up, so that seen from the station the elevation
// above the horizontal plane grows from row to row, evenly in all columns. Meshes and clouds: what
// people build is level or upright. About the axis that points up nearly all of the surface is;
// about another one only where walls happen to stand along the axes of the scan frame. Where they
// do, y is up in a room that is low for its length and width and has most of its surface level.
Eigen::Vector3d FindUpAxis(const Scan& scan);

// The values of --up_axis beside "auto": "x", "y", "z", "-x", "-y", "-z".
const std::vector<std::string>& UpAxisNames();
// The unit vector of a name, and back: "" for what is none of the six.
Eigen::Vector3d UpAxisOf(const std::string& name);
std::string NameOfUpAxis(const Eigen::Vector3d& up);

}  // namespace roomtex
