#pragma once
// Do two photos show the same? By few of their features, those of the largest scale: mutual nearest
// neighbours that pass the ratio test (Lowe 2004), and how many of them one fundamental matrix
// explains.

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "colmap_ext/database.h"

namespace roomtex {

// The features of one photo that are compared.
struct ComparedFeatures {
  std::vector<Eigen::Vector2f> x;    // on the undistorted picture plane, about pixels
  std::vector<uint8_t> descriptors;  // kSiftSize bytes each
};
// Features whose position no ray of the camera reaches are left out.
ComparedFeatures UndistortFeatures(const DatabaseFeatures& features, const Camera& camera);

struct PairCheckOptions {
  double max_ratio = 0.8;   // of the angles to the nearest and the next; larger = more tolerant
  double max_error_px = 4;  // from the epipolar line; larger = more tolerant
  int min_num_matches = 8;  // fewer are not looked at further
};

struct PairCheck {
  int num_matches = 0;  // mutual, ratio test passed
  int num_inliers = 0;  // of one fundamental matrix
  // Compared features inside the inliers' convex hull, of the photo that has fewer there.
  int num_in_hull = 0;
};
// The same for either order of threads and calls.
PairCheck CheckPair(const ComparedFeatures& left, const ComparedFeatures& right,
                    const PairCheckOptions& options);

}  // namespace roomtex
