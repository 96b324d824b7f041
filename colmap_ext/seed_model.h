#pragma once
// A seed as COLMAP models: ids and names of the database, so that `colmap mapper --input_path`
// continues it.

#include <cstdint>
#include <map>
#include <vector>

#include "colmap_ext/matched_images.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

// Two views with their points. All keypoints of both images; points[i] belongs to
// matches[inliers[i]]. Matches that share a keypoint with an earlier one make no point (a keypoint
// belongs to at most one).
SparseModel MakePairModel(MatchedImages* images, const DatabasePair& pair,
                          const std::vector<RayMatch>& matches, const TwoViewHypothesis& solution);

// Poses only: no keypoints, no points.
SparseModel MakePoseModel(const MatchedImages& images,
                          const std::map<uint32_t, Rigid>& cam_from_model);

}  // namespace roomtex
