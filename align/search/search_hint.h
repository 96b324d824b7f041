#pragma once
// What a user says about where the photos belong: a few picks, too few to place the model by
// themselves, or a place on the scan that a photo shows. It restricts the search.

#include <string>
#include <vector>

#include <Eigen/Core>

#include "align/clicks/picks.h"
#include "align/search/search_cloud.h"
#include "colmap_ext/sparse_model.h"
#include "core/near_hint.h"
#include "core/similarity.h"

namespace roomtex {

// A ray that must come near a place of the scan.
struct HintRay {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();     // `sparse`
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  // `sparse`, unit length
  Eigen::Vector3d x_in_scan = Eigen::Vector3d::Zero();
  double max_angle = 0;  // radians, between the ray and the place
};

// Rays of the picks that count, and of the place; names must be in the model.
std::vector<HintRay> FindHintRays(const SparseModel& model, const std::vector<Pick>& picks,
                                  const std::vector<NearHint>& near);

// Whether a ray placed in the scan comes near enough to its place: within max_angle, or slack
// metres beside that.
bool Agrees(const HintRay& ray, const Eigen::Vector3d& centre_in_scan,
            const Eigen::Vector3d& direction_in_scan, double slack);
// Whether a start puts every place where its ray says. slack: metres that the start may be off.
bool Agrees(const std::vector<HintRay>& rays, const Similarity& scan_from_sparse, double slack);

}  // namespace roomtex
