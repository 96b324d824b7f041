#pragma once
// What the surface of the scan leaves open in an alignment: in front of one wall, or between two
// parallel ones, the model could slide, turn or grow without leaving the surface. The picks alone
// hold it there. The field speaks of degeneracy, or of weakly constrained directions: they are the
// eigenvectors with small eigenvalues of the information matrix (Gelfand et al. 2003,
// "Geometrically Stable Sampling for the ICP Algorithm"; Zhang, Kaess and Singh 2016, "On
// Degeneracy of Optimization-based State Estimation Problems").

#include <string>
#include <vector>

#include <Eigen/Core>

#include "align/fit/similarity_fit.h"

namespace roomtex {

struct OpenDirections {
  // In how many ways the surface faces: 1 (one wall, or walls opposite each other), 2 (as in a
  // corner without floor or ceiling), 3.
  int num_facings = 3;
  std::vector<Eigen::Vector3d> slides;  // `scan`, unit length: directions the model could move in
  std::vector<Eigen::Vector3d> turns;   // unit length: axes it could turn about
  bool scale = false;                   // it could grow or shrink
  // By surface and picks together: standard deviation along the worst of the open directions,
  // metres; 0 without any.
  double slide_sigma = 0;

  bool None() const { return slides.empty() && turns.empty() && !scale; }
  // What the surface leaves open, and what holds it there and how well, in a sentence; empty if
  // None().
  enum class HeldBy { kNothing, kPicks, kPhotos };
  std::string Sentence(HeldBy held_by) const;
};

// Something is open when the surface alone leaves more than 2 cm, 0.5 degrees or 1 % of it, at
// `x_in_scan` (the middle of the photos). A fit that did not converge has no open directions.
OpenDirections FindOpenDirections(const SimilarityFit& fit, const Eigen::Vector3d& x_in_scan);

}  // namespace roomtex
