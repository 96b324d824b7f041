#include "texture/sampling/smoothed_scan.h"

#include <algorithm>
#include <cmath>

#include "core/option_fields.h"
#include "core/similarity.h"
#include "core/statistics.h"
#include "texture/sampling/range_smoothing.h"

namespace roomtex {
namespace {

double MedianAngularSpacing(const Scan& scan, const GridLinks& links) {
  std::vector<float> angles;
  const size_t stride = std::max<size_t>(1, links.bits.size() / 100000);
  for (size_t i = 0; i < links.bits.size(); i += stride) {
    if (!(links.bits[i] & GridLinks::kDown)) continue;
    const Eigen::Vector3d a = scan.points[i] - scan.Station();
    const Eigen::Vector3d b = scan.points[i + scan.num_columns] - scan.Station();
    angles.push_back(static_cast<float>(AngleBetween(a, b)));
  }
  return Median(&angles);
}

}  // namespace

void SmoothedScanOptions::Declare(OptionFields* fields) {
  fields->Bool("Surface.reduce_range_noise", &reduce_range_noise,
               "Look colours up at the sample's place on the smoothed surface.");
  fields
      ->Int("Surface.smoothing_radius", &smoothing_radius,
            "Samples on either side used for smoothing.")
      .Within(1, 50, "samples");
}

std::vector<std::string> SmoothedScanOptions::Problems() const { return ProblemsOf(*this); }

SmoothedScan MakeSmoothedScan(const Scan& scan, const ScanMeshOptions& mesh_options,
                              const SmoothedScanOptions& options, int num_threads) {
  SmoothedScan surface;
  surface.triangles = BuildScanMesh(scan, mesh_options);
  surface.links = FindGridLinks(scan, surface.triangles);
  surface.points = scan.points;
  if (!scan.organised) {
    surface.normals = VertexNormals(scan, surface.triangles);
    return surface;
  }
  surface.station_is_known = true;
  surface.angular_spacing = MedianAngularSpacing(scan, surface.links);
  RangeSmoother smoother(scan, surface.links, options.smoothing_radius, num_threads);
  surface.range_noise = smoother.noise();
  if (options.reduce_range_noise) smoother.Smooth(&surface.points);
  Scan smooth;
  smooth.num_columns = scan.num_columns;
  smooth.num_rows = scan.num_rows;
  smooth.points.swap(surface.points);
  surface.normals = VertexNormals(smooth, surface.triangles);
  surface.points.swap(smooth.points);
  if (options.reduce_range_noise) smoother.Straighten(surface.normals, &surface.points);
  return surface;
}

}  // namespace roomtex
