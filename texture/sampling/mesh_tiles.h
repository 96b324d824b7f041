#pragma once
// The scan's mesh in tiles of about a thousand samples, so that a photo touches only what it may
// see.

#include <array>
#include <cstdint>
#include <vector>

#include "core/scan.h"
#include "texture/sampling/photo_view.h"
#include "texture/sampling/smoothed_scan.h"

namespace roomtex {

struct MeshTile {
  PointBlock points;
  std::vector<std::array<uint16_t, 3>> triangles;  // indices into points
};

// What may hide a sample from a photo.
struct OccluderTiles {
  std::vector<MeshTile> surface;  // the mesh
  // Triangles over the depth jumps that the mesh leaves open. Behind them lies space that the
  // scanner could not see, in which anything may stand.
  std::vector<MeshTile> shadows;
  // The open quads at the range of their nearest sample: what ends between two samples may reach up
  // to the next one.
  std::vector<MeshTile> fringes;
  double range_noise = 0;  // of the scan, metres, standard deviation; 0 = not known
  // Metres by which `surface` hides less than it would: that a coarse mesh departs from the
  // surface.
  double set_back = 0;
};

OccluderTiles MakeOccluderTiles(const Scan& scan, const SmoothedScan& surface);

// Samples that get a colour, in the same kind of tiles. `index` is the grid index of each.
struct SampleTile {
  PointBlock points;
  std::vector<Eigen::Vector3f> normals;  // unit or zero
  std::vector<int> index;
  // The normals point to either side of the surface, which is seen from both (of a cloud).
  bool is_two_sided = false;
  Eigen::Vector3f scanner;  // where the scanner stood, relative to points.origin; NaN = not known
  int first_slot = 0;       // samples are numbered tile by tile

  // The normal of sample i as a camera in this direction from it has it before it.
  Eigen::Vector3f NormalTowards(const Eigen::Vector3f& camera_from_sample, int i) const {
    return is_two_sided && camera_from_sample.dot(normals[i]) < 0 ? -normals[i] : normals[i];
  }
};
// columns x rows points (row by row; NaN = none) with their normals. Without a grid: rows = 1.
// station: where the scanner stood, `scan` frame; NaN = not known.
std::vector<SampleTile> MakeSampleTiles(int columns, int rows,
                                        const std::vector<Eigen::Vector3d>& points,
                                        const std::vector<Eigen::Vector3f>& normals,
                                        const Eigen::Vector3d& station);

}  // namespace roomtex
