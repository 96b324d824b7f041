#pragma once
// What colouring needs to know of one scan beyond its samples: which of them lie on one surface,
// where the surface is without the range noise, and how it is turned.

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "core/scan_mesh.h"
#include "texture/sampling/grid_links.h"

namespace roomtex {

class OptionFields;

struct SmoothedScanOptions {
  // Photos are looked up at the sample moved along its scanner ray onto a plane fitted to the
  // samples around it: range noise would shift the lookup wherever a photo was not taken from the
  // scanner's place. Departure from the thesis, which uses the measured points. The written
  // vertices stay measured.
  bool reduce_range_noise = true;
  // Samples on either side that lines are fitted to, along rows and columns; fewer, or those of one
  // side only, where that many do not lie straight within the noise (corners, steps, round things).
  // Larger = smoother.
  int smoothing_radius = 6;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

struct SmoothedScan {
  std::vector<Triangle> triangles;  // BuildScanMesh
  GridLinks links;
  std::vector<Eigen::Vector3d> points;   // `scan` frame, range noise reduced; NaN = missing
  std::vector<Eigen::Vector3f> normals;  // unit, towards the scanner; zero where no triangle is
  double range_noise = 0;         // metres, robust estimate of one sample's standard deviation
  double angular_spacing = 0;     // radians between neighbouring samples, median; 0 = not known
  bool station_is_known = false;  // the scanner stood at Scan::Station()
  bool has_shadows = true;        // clouds: known is from where some of it was measured
  bool front_is_known = false;    // clouds: the normals point to where it can be seen from
};

// The result keeps no reference to `scan`.
SmoothedScan MakeSmoothedScan(const Scan& scan, const ScanMeshOptions& mesh_options,
                              const SmoothedScanOptions& options, int num_threads);

}  // namespace roomtex
