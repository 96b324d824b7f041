#pragma once
// Which way is up in a scan whose format does not say it.

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

// A scanner takes a column from the bottom up: seen from the station, the elevation above the
// horizontal plane grows from row to row, evenly in all columns. Gives the axis of the scan frame
// (y or z) for which that holds: z unless the samples clearly say y. For organised scans; others
// give z.
Eigen::Vector3d FindUpAxis(const Scan& scan);

}  // namespace roomtex
