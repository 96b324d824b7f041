#pragma once
// A pick while it is being made: either side may still be missing.

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "align/clicks/picks.h"

namespace roomtex {

// A place in the picture of a scan (scan_places.h).
struct ScanSpot {
  int scan = 0;
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
};

struct SessionPick {
  std::string image_name;
  std::optional<Eigen::Vector2d> x_in_img;
  std::optional<Eigen::Vector3d> x_in_scan;
  std::optional<ScanSpot> spot;  // where x_in_scan is drawn
  double weight = 1;             // 0 = a check point
  std::string label{};

  bool complete() const { return x_in_img && x_in_scan; }
};

}  // namespace roomtex
