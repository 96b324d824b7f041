#pragma once
// What the similarity fit knows of its own accuracy, and the weights that follow from it: a surface
// is off as a whole, not sample by sample, and model and scan disagree over the room.

#include <vector>

#include <Eigen/Core>

#include "align/fit/similarity_fit.h"
#include "align/fit/similarity_normal.h"
#include "align/surface/surface_cells.h"

namespace roomtex {

// The matches of one step by cells, of half a metre unless told. What stays unknown of a surface,
// and how the model bends against it, is the same for all points of a cell; a cell's points
// together weigh as much as that allows. A few points, where patches may straddle an edge, fix
// nothing on their own.
class SurfaceWeights {
 public:
  // cell_size: metres.
  SurfaceWeights(const std::vector<SurfaceMatch>& matches, const ScanPatches& surface,
                 double cell_size = SurfaceCells::kSize);

  // Matches in cells with enough points to say something.
  size_t num_in_cells() const { return num_in_cells_; }
  // Whether a match counts, the variance of its distance (metres^2), and the way its surface faces.
  bool Counts(size_t i) const { return counts_[i]; }
  double Variance(size_t i) const { return variances_[i]; }
  const Eigen::Vector3d& Normal(size_t i) const { return normals_[i]; }
  // Metres: how far a surface is off as a whole.
  double CommonSigma() const { return common_sigma_; }
  // Part of the room, for the jackknife.
  int Part(size_t i) const { return parts_[i]; }
  int num_parts() const { return num_parts_; }

 private:
  std::vector<bool> counts_;
  std::vector<double> variances_;
  std::vector<Eigen::Vector3d> normals_;
  std::vector<int> parts_;
  int num_parts_ = 0;
  size_t num_in_cells_ = 0;
  double common_sigma_ = 0;
};

// Covariance by leaving out the parts one by one (delete-a-group jackknife, Quenouille 1956; Kunsch
// 1989 for dependent data), at the solution of all of them; zero with too few of them.
Matrix7d JackknifeCovariance(const SimilarityNormal& all,
                             const std::vector<SimilarityNormal>& parts);

// The smallest covariance that is not below either, direction by direction of a.
Matrix7d Larger(const Matrix7d& a, const Matrix7d& b);

// Fills covariance, surface_information and facing of a fit at its solution. The covariance is the
// larger, direction by direction, of what the noise leaves open and what parts of the room say when
// they are left out one by one (delete-a-group jackknife, Quenouille 1956; Kunsch 1989 for
// dependent data), which sees a model that is bent against the scan; of few points it is by larger
// cells than the other two and the fit.
void JudgeAccuracy(const std::vector<SurfaceMatch>& matches,
                   const std::vector<SurfacePoint>& points, const ScanPatches& surface,
                   const PickTerms& terms, const std::vector<bool>& used, double sigma_px,
                   const Similarity& start, SimilarityFit* fit);

}  // namespace roomtex
