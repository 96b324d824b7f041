#pragma once
// Writes scans in the format that the extension of the path names.

#include <string>
#include <vector>

#include "core/scan.h"
#include "core/scan_mesh.h"

namespace roomtex {

// ".ply", ".pcd", ".png", ".rtpi", ".ptx", ".e57".
const std::vector<std::string>& ScanWriterExtensions();
// The extension in small letters, if it is one of these, otherwise "".
std::string ScanWriterExtension(const std::string& path);

struct ScanWriterOptions {
  // RTPI: sense of the azimuth to write; reading it with the same sense gives the same room.
  bool counterclockwise = false;
};

//   .ply   triangle mesh (ply.h); `triangles` index scan.points, see BuildScanMesh
//   .pcd   organised cloud (pcd.h)
//   .png   intensity in the grid, 8 bits: percentiles 1 and 99 become black and white
//          (IntensityAsGrey)
//   .rtpi  RTPI 3.0 (RtpiFromScan says how intensities are scaled)
//   .ptx   PTX (ptx.h), intensity 0..1
//   .e57   structured E57 (e57_writer.h)
//   .las   points (las.h)
// What has no grid can become a .ply or .las only; for the others it is an InputError. Throws
// UsageError for another extension.
void WriteScan(const Scan& scan, const std::vector<Triangle>& triangles, const std::string& path,
               const ScanWriterOptions& options = {});

}  // namespace roomtex
