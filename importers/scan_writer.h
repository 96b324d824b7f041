#pragma once
// Writes scans in the format that the extension of the path names.

#include <string>
#include <vector>

#include "core/scan.h"
#include "core/scan_mesh.h"
#include "importers/las_writer.h"

namespace roomtex {

// ".ply", ".pcd", ".png", ".rtpi", ".ptx", ".e57", ".las", ".xyz", ".pts", ".csv".
const std::vector<std::string>& ScanWriterExtensions();
// The extension in small letters, if it is one of these, otherwise "".
std::string ScanWriterExtension(const std::string& path);
// Whether a scan of this kind can become a file of this extension: all that has a grid, clouds
// where the file holds points, meshes as meshes or where a plain list of points is wanted.
bool CanHold(const std::string& extension, Scan::Kind kind);

struct ScanWriterOptions {
  // RTPI: sense of the azimuth to write; reading it with the same sense gives the same room.
  bool counterclockwise = false;
  LasWriterOptions las;
  std::string coordinate_system;  // for a LAS, as in ScanFile
};

//   .ply   triangle mesh (ply.h); `triangles` index scan.points, see BuildScanMesh
//   .pcd   organised cloud, or one without a grid (pcd.h)
//   .png   intensity in the grid, 8 bits: percentiles 1 and 99 become black and white
//          (IntensityAsGrey)
//   .rtpi  RTPI 3.0 (RtpiFromScan says how intensities are scaled)
//   .ptx   PTX (ptx.h), intensity 0..1
//   .e57   E57 (e57_writer.h), structured where there is a grid
//   .las   points (las_writer.h)
//   .xyz, .pts, .csv   points as text (xyz.h)
// Colours of the scan go where the format holds them: all but .png and .rtpi. Throws InputError
// where CanHold() says no, UsageError for another extension.
void WriteScan(const Scan& scan, const std::vector<Triangle>& triangles, const std::string& path,
               const ScanWriterOptions& options = {});

}  // namespace roomtex
