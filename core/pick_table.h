#pragma once
// The picks file: points that a user saw both in a photo and in the scan. Photogrammetry calls them
// control points (known in the scan) or tie points.
//
// CSV with the header image_name,x,y,scan_x,scan_y,scan_z and, if wanted, the columns weight and
// label; `#` starts a comment line; a name with a comma stands in double quotes. x, y in `img` of
// the photo as taken, scan_* in `scan` (metres).

#include <string>
#include <vector>

#include <Eigen/Core>

namespace roomtex {

struct Pick {
  std::string image_name;
  Eigen::Vector2d x_in_img = Eigen::Vector2d::Zero();
  Eigen::Vector3d x_in_scan = Eigen::Vector3d::Zero();
  long line = 0;  // in the picks file; 0 = not from a file
  // How many times less its click noise is than that of a pick with weight 1; 0 = a check point: it
  // is reported, but nothing rests on it.
  double weight = 1;
  std::string label{};  // what the user calls the point, "" = nothing
};

// Where it stands, for a message: "line 4", or "a pick of a.jpg".
std::string LineOf(const Pick& pick);

// The largest weight that a file or the window may give: a typing error is larger.
inline constexpr double kMaxPickWeight = 1000;

// Throws InputError with the line: no header, a quote that is not closed, wrong number of fields,
// no name of a photo, not a finite number, a weight that is negative or above kMaxPickWeight, the
// same pixel or the same scan point picked twice in one photo.
std::vector<Pick> ReadPicks(const std::string& path);
// Written aside and renamed; reading it back gives the same numbers to the last bit.
void WritePicks(const std::string& path, const std::vector<Pick>& picks);

}  // namespace roomtex
