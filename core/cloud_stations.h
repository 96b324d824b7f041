#pragma once
// Where the scanners of a cloud stood, which its file does not say.

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

struct CloudStation {
  Eigen::Vector3d place;       // `scan` frame
  size_t begin = 0, end = 0;   // the points that were taken from there, in the order of the file
  double angular_spacing = 0;  // radians between neighbouring ones
};

// Points were measured along lines of sight: those of one station do not hide each other from where
// it stood, and from everywhere else edges do. Merged clouds hold station after station, so that
// parts of the file are asked: all, halves, quarters ... until a place is found from which they can
// be seen. Parts that no place explains (a moving scanner, mixed points), or many places (one wall,
// a bare room), are left out. What is found is right to centimetres where there is much to hide
// behind, else to some decimetres. The same for every number of threads.
std::vector<CloudStation> FindStations(const Scan& cloud, int num_threads);

}  // namespace roomtex
