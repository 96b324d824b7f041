#pragma once
// Where a model of several cameras lies in the scan, from rays of its cameras and the scan points
// that they meet: the generalised pose with scale. The cost is that of gDLS (Sweeney, Fragoso,
// Hollerer and Turk 2014, "gDLS: A Scalable Solution to the Generalized Pose and Scale Problem"):
// for a given rotation depths, translation and scale follow linearly, and what remains is a
// quadratic form in the nine entries of the rotation. Departure: its minima are found by descending
// from rotations all over SO(3) instead of solving a polynomial system; six to forty rays make a
// form of 9 x 9 numbers, so that a hundred descents take a millisecond.

#include <vector>

#include <Eigen/Core>

#include "core/similarity.h"

namespace roomtex {

// Ray i of the model meets scan point i; columns are rays.
struct RaysToScan {
  Eigen::Matrix3Xd origins;     // `sparse`: the camera's centre
  Eigen::Matrix3Xd directions;  // `sparse`, unit length
  Eigen::Matrix3Xd x_in_scan;   // metres
};

// scan_from_sparse of every local minimum of the sum of squared distances of the points from their
// rays that has the points in front of the cameras, best first. At least four rays, of two places
// at least: else the scale is open, and there is none. As good as noise in metres allows: a start.
std::vector<Similarity> SolveRaySimilarities(const RaysToScan& rays);

}  // namespace roomtex
