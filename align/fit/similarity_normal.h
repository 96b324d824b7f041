#pragma once
// The normal equations of the similarity fit: what picks, distances from the surface and the
// start's scale say about its seven numbers. Only similarity_fit.cc and similarity_accuracy.cc use
// them.

#include <map>
#include <vector>

#include <Eigen/Core>

#include "align/clicks/picks.h"
#include "align/fit/similarity_fit.h"
#include "align/surface/scan_patches.h"
#include "colmap_ext/sparse_model.h"
#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

using Vector7d = Eigen::Matrix<double, 7, 1>;

// Picks with what their projection needs. Model and picks must outlive it.
class PickTerms {
 public:
  PickTerms(const SparseModel& model, const std::vector<Pick>& picks);

  int size() const { return static_cast<int>(terms_.size()); }
  // Pixels; infinite behind the camera.
  Eigen::Vector2d Error(int i, const Similarity& scan_from_sparse) const;
  double Weight(int i) const { return terms_[i].pick->weight; }
  // How many pixels a metre beside the picked point makes; 0 behind the camera.
  double PixelsPerMetre(int i, const Similarity& scan_from_sparse) const;
  // By central differences: six to a hundred picks, so exactness of the step is all that matters.
  Eigen::Matrix<double, 2, 7> Jacobian(int i, const Similarity& scan_from_sparse,
                                       const Eigen::Vector3d& pivot) const;

 private:
  struct Term {
    const CameraProjection* projection;
    Rigid cam_from_sparse;
    const Pick* pick;
  };
  std::map<uint32_t, CameraProjection> projections_;
  std::vector<Term> terms_;
};

// A sparse point and the patch of the surface it belongs to at one step.
struct SurfaceMatch {
  int point = 0, patch = 0;
  double distance = 0;  // metres, along the normal
  double sigma = 0;     // metres, of that distance
};

// Points no farther from the surface than `gate` (metres), or than three times their own standard
// deviation up to max_gate; scanner and photos look at the same side of it.
std::vector<SurfaceMatch> FindMatches(const std::vector<SurfacePoint>& points,
                                      const ScanPatches& surface, const Similarity& s, double gate,
                                      double max_gate);

struct SimilarityNormal {
  Matrix7d matrix = Matrix7d::Zero();
  Vector7d gradient = Vector7d::Zero();

  template <int N>
  void Add(const Eigen::Matrix<double, N, 7>& jacobian, const Eigen::Matrix<double, N, 1>& residual,
           double weight) {
    matrix += weight * jacobian.transpose() * jacobian;
    gradient += weight * jacobian.transpose() * residual;
  }
  // surface_sigma: metres; how far model and scan disagree at a place, which no click is better
  // than.
  void AddPicks(const PickTerms& terms, const std::vector<bool>& used, double sigma_px,
                double surface_sigma, const Similarity& s, const Eigen::Vector3d& pivot);
  void AddScalePrior(const Similarity& s, const Similarity& start, double scale_prior);
  // Distance of a point at x_in_scan along a normal of the surface.
  void AddDistance(double distance, const Eigen::Vector3d& x_in_scan,
                   const Eigen::Vector3d& surface_normal, const Eigen::Vector3d& pivot,
                   double weight);
  // The step to the minimum; false if the matrix has no inverse.
  bool SolveStep(Vector7d* step, Matrix7d* inverse) const;
};

}  // namespace roomtex
