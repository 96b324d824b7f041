#pragma once
// The scanner's grid, found again in a cloud of points that lost it.

#include <optional>

#include "core/scan.h"

namespace roomtex {

// A scanner turns by even steps: seen from its station, the points of one scan stand on lines of
// equal azimuth and equal elevation about its axis. The steps are found as the strongest periods of
// the angles; each point goes to the cell next to it, row 0 on top, columns by growing azimuth; of
// two points in a cell the first stays. None if the angles show no such grid: points far from its
// lines, too many in one cell, or too few beside each other (merged stations, moving scanners,
// thinned to even distances or at random, a scanner that stood elsewhere or leant).
std::optional<Scan> GridFromCloud(
    const Scan& cloud, const Eigen::Vector3d& axis_in_station = Eigen::Vector3d::UnitZ());

}  // namespace roomtex
