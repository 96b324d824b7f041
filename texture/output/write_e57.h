#pragma once
// Coloured scans as E57: what CloudCompare and programs for splatting read.

#include <string>
#include <vector>

#include "core/scan.h"
#include "texture/sampling/photo_view.h"
#include "texture/texels/colored_scan.h"

namespace roomtex {

// One E57 (importers/e57_writer.h) with all stations: samples in the order of model.ply,
// intensity, colour, pose. photos: written along as JPEGs of pinhole cameras, undistorted,
// panoramas as they are; null = none. Throws InputError if the file cannot be written or a photo
// not be read.
void WriteColoredE57(const std::vector<Scan>& scans, const std::vector<ColoredScan>& colored,
                     const std::vector<PhotoView>* photos, const std::string& path);

// The pinhole camera for a photo without its distortion: as many pixels, focal lengths and
// principal point as they are (of a fisheye: those of the middle of the picture).
Camera UndistortedCamera(const Camera& camera);

}  // namespace roomtex
