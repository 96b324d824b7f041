#pragma once
// The surface that a cloud of points without a grid shows, as small flat pieces (surfels: Pfister
// et al. 2000, "Surfels: Surface Elements as Rendering Primitives"), so that a cloud hides what is
// behind it, has planes, and can be picked on.

#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

struct CloudSurface {
  // Per point of the cloud: its place with the noise across the surface taken out (`scan` frame;
  // NaN = missing), and the unit normal there; zero where the cloud shows no surface (stray
  // points). Normals point to the station if the cloud was taken from there, else to where those of
  // its file do, if they have a side (front_is_known), else to either side.
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3f> normals;
  std::vector<float> spacings;  // metres to the next points around; 0 = no surface
  // The surfels as a mesh without a grid: two triangles each, corners of their own, at the mean
  // intensity of their points, turned as the normals or, where they have no side, to the middle of
  // the cloud.
  Scan patches;
  double noise = 0;    // metres, standard deviation of a point across the surface, median
  double spacing = 0;  // metres between neighbouring points, median
  // Radians between neighbouring points seen from the cloud's Station(); 0 = it was not taken from
  // there: too many points hide each other, or all lie in one direction.
  double angular_spacing = 0;
  // Station or normals of the file say which side of the surface is the front. Those of a file are
  // believed where three in four point to the middle of the cloud (a room), or away from it (a
  // thing): many programs write normals of arbitrary sign.
  bool front_is_known = false;
};

// Cells of an octree are cut until a few points are left in each. Where the points of a cell and of
// those around it lie on one plane as well as on several, they share that plane (an F test against
// what the finer cells leave over, so that no length has to be given): near edges the pieces stay
// small, elsewhere a plane rests on up to some hundred points. Each cell becomes a rectangle on its
// plane that covers its points and half of the way to the next ones. The same for every number of
// threads. cloud: any scan; its triangles are not looked at.
CloudSurface FindCloudSurface(const Scan& cloud, int num_threads);

// Points [begin, end) of the cloud as a grid around a station: the nearest one in each cell of
// azimuth and elevation about `up`, `num_rows` from straight up to straight down. For those that
// were taken from there.
Scan GridAroundStation(const Scan& cloud, const Eigen::Vector3d& station, size_t begin, size_t end,
                       int num_rows);

// FindCloudSurface(cloud).patches in place of every cloud among the scans: what takes meshes takes
// clouds then.
void ReplaceClouds(std::vector<Scan>* scans, int num_threads);

}  // namespace roomtex
