#pragma once
// A point of the model that a view outside it sees, and how well a pose of that view goes with the
// others that see it (thesis 6.2.1).

#include <utility>
#include <vector>

#include "colmap_ext/sparse_model.h"
#include "colmap_ext/view_rays.h"
#include "core/frames.h"

namespace roomtex {

// A point of the model that a left-out view sees.
struct CommonPoint {
  Ray ray;  // in the left-out view
  Eigen::Vector2d x_in_img = Eigen::Vector2d::Zero();
  const SparsePoint* point = nullptr;
  std::vector<std::pair<Rigid, Ray>> sights;  // cam_from_model and ray of the views that know it
};

// How much the least sum of squared errors of a point, px^2, grows when the view sees it as well:
// by chi-square of two, times the keypoint noise, if the pose is right. A point of a short baseline
// may lie far off in depth, so its place in the model says little about where another view sees it.
double GrowthByView(const CommonPoint& common, const Rigid& view_from_model);

}  // namespace roomtex
