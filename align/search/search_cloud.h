#pragma once
// What the search for a start needs of a sparse model: its points, where its photos were taken, and
// which photo sees which point. Frame: `sparse`.

#include <vector>

#include <Eigen/Core>

#include "align/fit/similarity_fit.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

struct SearchCloud {
  std::vector<SurfacePoint> points;          // well fixed by their photos
  std::vector<Eigen::Vector3d> centres;      // of the photos, in the order of their ids
  std::vector<Eigen::Vector3d> right, down;  // x and y axes of the cameras
  struct Sight {
    int photo = 0, point = 0;  // indices
  };
  std::vector<Sight> sights;  // some of the rays from photos to points, over all of both
  bool is_mirrored = false;
};

// At most max_points points: of those with three observations, if there are enough of them.
// sigma_px: of a keypoint, per coordinate.
SearchCloud MakeSearchCloud(const SparseModel& model, double sigma_px, size_t max_points);

// The mirror image: what the room would be if it were the other way round. No photo shows it, so
// that whatever fits it fits by chance, or because the scan is mirrored.
SearchCloud Mirrored(SearchCloud cloud);

// Every k-th point, so that about max_points are left.
SearchCloud Thinned(const SearchCloud& cloud, size_t max_points);

}  // namespace roomtex
