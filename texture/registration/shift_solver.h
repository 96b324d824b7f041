#pragma once
// Poses and warps of all photos at once from what was measured between them: each photo against the
// mean of the others, all of which move as well.

#include <array>
#include <vector>

#include <Eigen/Core>

#include "texture/sampling/photo_warp.h"

namespace roomtex {

// Turn and shift of a photo as Moved() takes them, and how far it turned from its first row to its
// last one while they were read: rotation vectors in `cam`, metres.
using PhotoMotion = Eigen::Matrix<double, 9, 1>;

// How a point of the surface moves in a photo, pixels: by_pose * motion, and by the nodes of its
// warp.
struct PlaceInPhoto {
  int photo = 0;
  Eigen::Matrix<float, 2, 9> by_pose = Eigen::Matrix<float, 2, 9>::Zero();
  std::array<int, 4> nodes{};
  std::array<float, 4> node_weights{};
};

// A photo shows a place by `shift` pixels away from where the mean of the others has it.
struct MeasuredShift {
  struct Term {
    PlaceInPhoto place;
    Eigen::Matrix2f share;  // pixels of the photo that was measured per pixel of this one
  };
  std::vector<Term>
      terms;  // of the photo that was measured: the identity; of the others below zero
  Eigen::Vector2f shift = Eigen::Vector2f::Zero();
  Eigen::Matrix2f information = Eigen::Matrix2f::Zero();  // inverse covariance, 1/pixels^2
};

// What is known of a photo beforehand.
struct PhotoPrior {
  bool is_free = true;  // false: it does not move
  // Where it stands already, and how far it may be off: standard deviations.
  PhotoMotion pose = PhotoMotion::Zero();
  PhotoMotion pose_sigma = PhotoMotion::Ones();
  // Null: no warp is asked for. Sigmas in pixels: of a node, and of the step to the next one.
  const PhotoWarp* warp = nullptr;
  double warp_sigma = 1, step_sigma = 1;
};

struct PhotoStep {
  PhotoMotion pose = PhotoMotion::Zero();
  std::vector<Eigen::Vector2f> warp;  // per node; empty without
};

// The most likely steps: least squares, robust (Geman and McClure) beyond outlier_px, by conjugate
// gradients.
std::vector<PhotoStep> SolveShifts(const std::vector<MeasuredShift>& shifts,
                                   const std::vector<PhotoPrior>& priors, double outlier_px);

}  // namespace roomtex
