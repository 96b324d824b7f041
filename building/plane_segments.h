#pragma once
// Flat pieces of surface in a noisy, incomplete cloud: walls, roofs, ground.

#include <vector>

#include "building/neighbours.h"
#include "building/outline_cloud.h"

namespace roomtex {

struct PlaneSegment {
  FittedPlane plane;  // the normal towards those who saw it, where that is known
  bool oriented = false;
  std::vector<int> points;  // indices into the cloud
  double cell = 0;          // side of the cells of the plane that say what hangs together
  double area = 0;          // of the cells of the plane that hold points
};

// RANSAC (Fischler and Bolles 1981) by the planes of small neighbourhoods, as Schnabel et al. 2007
// draw their samples nearby; a plane is grown and fitted until it stays, its largest connected
// piece is taken, what remains is searched again. The largest come first.
std::vector<PlaneSegment> FindPlaneSegments(const OutlineCloud& cloud, uint64_t seed,
                                            int num_threads);

// Distance from a plane up to which points are taken to lie on it.
double PlaneTolerance(const OutlineCloud& cloud);

}  // namespace roomtex
