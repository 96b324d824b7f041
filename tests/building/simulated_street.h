#pragma once
// A street of four houses as 60 photos would leave it in a sparse model, with known truth: features
// on walls, roofs and ground that photos see, errors that grow with the distance, trees, cars,
// gross outliers. And the thesis' mock-up: a box and books on a table.

#include <string>
#include <vector>

#include "building/outline.h"
#include "colmap_ext/sparse_model.h"
#include "core/similarity.h"

namespace roomtex {

struct StreetOptions {
  int seed = 1;
  double features_per_m2 = 8;  // on houses; a quarter of it on the ground
  double depth_error = 0.002;  // along the ray, per metre of distance: 4 cm at 20 m
  double outliers = 0.03;      // share of points that lie anywhere
  bool clutter = true;         // trees and cars
  // House `bare_house` has no features on its wall `bare_wall` (rear), as a plain white one has.
  int bare_house = -1, bare_wall = 2;
  double ground_slope = 0;        // rise per metre along the street
  bool photos_from_above = true;  // a third of them, from 14 m; else no roof is seen
  bool mock_up = false;           // the thesis' boxes on a table instead, in metres
};

struct SimulatedStreet {
  Outline truth;      // frame: z up, metres; names "1" to "4" from west to east
  SparseModel model;  // in the same frame
};

SimulatedStreet MakeStreet(const StreetOptions& options);

// The photos of the model at an eighth of their size, walls and roofs in coloured squares, as JPEG
// into `folder` under the names of the model.
void WriteStreetPhotos(const StreetOptions& options, const SparseModel& model,
                       const std::string& folder, int num_threads);

// Points on everything, as a dense reconstruction has them: `count`, without tracks.
std::vector<Eigen::Vector3d> MakeDenseStreet(const StreetOptions& options, size_t count);
// Binary PLY, x y z float.
void WriteCloud(const std::vector<Eigen::Vector3d>& points, const std::string& path);

// The largest distance from a corner of the truth to the nearest one of the building that it is,
// and of the heights. Counts how many true houses have no building with as many corners near them.
struct StreetErrors {
  double corner = 0, ground = 0, eaves = 0, ridge = 0, volume_share = 0;
  int missed = 0;
};
// found_from_truth: where the found buildings lie, e.g. for a model that was moved.
StreetErrors CompareStreet(const Outline& truth, const Outline& found,
                           const Similarity& found_from_truth = {});

}  // namespace roomtex
