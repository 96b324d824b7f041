#pragma once
// Bundle adjustment of a sparse model by its photos alone, with lenses that are held or freed.

#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include <Eigen/Core>

#include "colmap_ext/sparse_model.h"

namespace roomtex {

// One set of intrinsics for some of a model's photos.
struct Lens {
  Camera camera;             // as it is now
  Camera told;               // where it started, and what LensPrior holds it near
  bool free = false;         // adjusted
  bool hold_centre = false;  // LensPrior's
};

struct LensSet {
  std::vector<Lens> lenses;
  std::map<uint32_t, int> of_image;  // image_id, index into lenses
};

struct PhotoBundle {
  bool usable = false;  // false: everything below is as it came
  SparseModel model;    // poses and points; its cameras are those of the input
  LensSet lenses;
  // Sum of Huber's cost over all observations in units of sigma_px, and residuals less unknowns.
  double cost = 0, redundancy = 0;
  // Of the parameters of each lens: what the photos leave open, with LensPrior. 0 x 0 for a lens
  // that is held, and where something stays open.
  std::vector<Eigen::MatrixXd> covariances;
  // How many times as much as that (variances, all parameters of the free lenses together) they
  // scatter if the errors of a photo go together: each photo's share in the lenses, found from what
  // its residuals are, against what independent keypoints of sigma_px would have (a sandwich
  // estimate with photos as clusters: Liang and Zeger 1986, "Longitudinal Data Analysis Using
  // Generalized Linear Models", by the median photo). 0 = not known.
  double scatter_by_photo = 0;
};

// Standard deviation of a keypoint's coordinate, pixels: from the median of the residuals, because
// outliers do not move it, and enlarged, because the fitted points and poses have made residuals
// smaller than the noise (degrees of freedom).
double KeypointNoise(const SparseModel& model);

// Minimises Huber's cost of the reprojection errors over poses, points and the free lenses. Frame
// and scale stay near those of the input, which fix nothing: fit a similarity afterwards. With
// known_poses, images whose poses stay as they are, those hold both (two of them apart). Ends where
// a step lowers the cost by less than the share min_gain. Does not depend on the number of threads:
// Ceres runs on one.
PhotoBundle AdjustPhotos(const SparseModel& model, const LensSet& lenses, double sigma_px,
                         const std::set<uint32_t>& known_poses = {}, double min_gain = 1e-7);

// The adjusted model by the best similarity to the input, cameras and points: a bundle adjustment
// by photos is free to move and grow.
SparseModel PutBack(SparseModel adjusted, const SparseModel& input);

// One lens per camera, held.
LensSet LensesOf(const SparseModel& model);
// AdjustPhotos() with these, put back; the model as it came where that fails.
SparseModel AdjustedByPhotos(const SparseModel& model, double sigma_px);

// The model with the cameras of the lenses. Photos of one camera that have several lenses are
// divided: those of the first photo's lens keep the camera, the others get new ones.
SparseModel WithLenses(const SparseModel& model, const LensSet& lenses);

}  // namespace roomtex
