#pragma once
// Metres per sparse unit, from the features of the clicked view (thesis 7.1.2).

#include <string>
#include <vector>

#include "colmap_ext/sparse_model.h"
#include "core/ray_caster.h"
#include "core/scan.h"

namespace roomtex {

class OptionFields;

struct ScaleOptions {
  // Pixels; a feature counts only if the scan continues smoothly this far around it: nearer to a
  // depth edge a slightly wrong pose takes the foreground for the background. Larger = stricter.
  double edge_px = 4.0;
  // A depth differs from the mean of those on both its sides by less than this share of it on a
  // smooth surface. Larger = more tolerant.
  double max_depth_step = 0.03;
  // Features whose ratio is farther from the median than this many robust standard deviations are
  // left out.
  double max_deviations = 3.0;
  // Of more features with a sparse point every k-th is looked at: 2000 fix the scale to 2e-5 where
  // they spread by 1e-3, far better than clicks fix the pose, and roomtex-pick asks at every click.
  int max_features = 2000;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

struct ScaleEstimate {
  double scale = 0;        // metres per sparse unit: depth in the scan / depth in the sparse model
  int num_features = 0;    // that the average rests on
  int num_candidates = 0;  // features with a sparse point in front of the scan, with those left out
  double relative_mad = 0;  // median |ratio - median| / median, before outliers are left out
};

// For each feature of `image` that has a sparse point: the scan point is where its viewing ray
// meets the nearest scan triangle. num_features = 0 if no feature has one. Departures: the exact
// intersection instead of the average of the triangle's corners (Appendix B's side test is what the
// intersection does); at most max_features features; the reciprocal of the thesis' s = beta / alpha
// (7.3), so that it is the scale of scan_from_sparse; the "consistent average" is the mean of what
// lies near the median.
ScaleEstimate EstimateScale(const SparseModel& model, const SparseImage& image,
                            const Rigid& cam_from_scan, const std::vector<Scan>& scans,
                            const std::vector<std::vector<Triangle>>& meshes,
                            const ScaleOptions& options);
// The same for who asks again and again: `surface` holds the meshes of all scans. The number of
// threads changes nothing.
ScaleEstimate EstimateScale(const SparseModel& model, const SparseImage& image,
                            const Rigid& cam_from_scan, const RayCaster& surface,
                            const ScaleOptions& options, int num_threads);

}  // namespace roomtex
