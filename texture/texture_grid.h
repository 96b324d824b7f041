#pragma once
// The surface between the samples, for texture images finer than the scan's grid.

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "texture/scan_surface.h"

namespace roomtex {

// scale x scale texels per sample; texel (c, r) lies at the sample coordinates
// ((c + 0.5) / scale - 0.5, (r + 0.5) / scale - 0.5).
struct TextureGrid {
  int num_columns = 0, num_rows = 0;
  std::vector<Eigen::Vector3d> points;   // `scan` frame; NaN = no surface
  std::vector<Eigen::Vector3f> normals;  // unit or zero
};

// Bilinear between four connected samples; where they are not connected, the surface ends half way
// with the nearest sample's place.
TextureGrid MakeTextureGrid(const Scan& scan, const ScanSurface& surface, int scale);

// Links of that grid: texels of connected samples are connected.
GridLinks TextureLinks(const Scan& scan, const ScanSurface& surface, int scale);

// Nearest sample's grey for every texel.
std::vector<uint8_t> EnlargeGrey(const Scan& scan, const std::vector<uint8_t>& grey, int scale);

}  // namespace roomtex
