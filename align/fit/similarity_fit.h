#pragma once
// The similarity that takes the sparse model into the scan, refined on all its seven numbers: on
// the picks of any number of photos, and on the distances of the sparse points from the scan's
// surface. The latter is robust point-to-plane ICP with scale: ICP by Besl and McKay 1992 ("A
// Method for Registration of 3-D Shapes"), point to plane by Chen and Medioni 1992 ("Object
// Modelling by Registration of Multiple Range Images"), scale by Zinsser et al. 2005 ("Point Set
// Registration with Integrated Scale Estimation") and Du et al. 2010 ("Scaling Iterative Closest
// Point Algorithm for Registration of m-D Point Sets"), robust by Tukey's biweight (Beaton and
// Tukey 1974). Beyond these: every distance is weighed by what is known of its point and its patch.

#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "align/clicks/picks.h"
#include "align/surface/scan_patches.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

class OptionFields;
// What every fit of a model to the scan assumes, with and without a bend (scan_bend.h).
// A click farther off than this many standard deviations counts linearly (Huber 1964: 1.345 to 2).
inline constexpr double kClickHuber = 2.0;
// How well the start's scale is believed, as a share: only speaks where nothing else fixes the
// scale.
inline constexpr double kScalePrior = 0.05;
// In place of kScalePrior: nothing is believed of the start's scale.
inline constexpr double kNoScalePrior = std::numeric_limits<double>::infinity();
// Metres; what remains of every distance beyond the known noise (waviness of patches, slight
// bends).
inline constexpr double kSurfaceNoise = 0.001;

// A sparse point that takes part, with what its observations say about its own accuracy. (Of a
// model that is in the scan frame already, read `scan` for `sparse`.)
struct SurfacePoint {
  Eigen::Vector3d x_in_sparse = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // sparse units^2
  Eigen::Vector3d to_cameras = Eigen::Vector3d::Zero();  // mean direction to its cameras, `sparse`
  uint64_t point3d_id = kInvalidPoint3dId;
  int num_observations = 0;
};

// min_track; 2 in a model that has fewer than kFewPoints points of so many observations, as one of
// two photos has.
inline constexpr int kFewPoints = 100;
int TrackThatCounts(const SparseModel& model, int min_track);

// Points with at least min_track observations; covariance = inverse normal matrix of the
// triangulation with the poses held, times the residual variance sigma_px^2 of a coordinate. Points
// that their rays do not fix are left out; of more than max_points every k-th is taken.
inline constexpr size_t kMaxSurfacePoints = 30000;
std::vector<SurfacePoint> FindSurfacePoints(const SparseModel& model, int min_track,
                                            double sigma_px, size_t max_points = kMaxSurfacePoints);

struct SimilarityFitOptions {
  int min_track = 3;       // observations that a sparse point needs to take part
  double max_gate = 0.5;   // metres; a point farther from the surface never takes part
  double min_gate = 0.02;  // metres; gate of the last steps is at least this
  // The scale may move away from the start by this share, and no farther.
  double max_scale_change = 0.10;
  int num_steps = 40;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// 7 numbers: x_in_scan' = x_in_scan + dt + w x (x_in_scan - c) + ds (x_in_scan - c), c = `pivot`.
using Matrix7d = Eigen::Matrix<double, 7, 7>;

struct SimilarityFit {
  Similarity scan_from_sparse;
  bool converged = false;
  int num_points = 0;  // sparse points on the surface at the end
  // RMS distance of these points from the surface, metres: under the start, and under the result.
  double rms_before = 0, rms_after = 0;
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  // Of (dt, w, ds); infinite without a solution. What stays unknown of a surface, and how the model
  // bends against it, is taken to be the same for all points of half a metre of it (of more where
  // points are few).
  Matrix7d covariance = Matrix7d::Zero();
  // Inverse of the covariance that the surface alone would give: without picks, without a solution
  // zero.
  Matrix7d surface_information = Matrix7d::Zero();
  // Mean of n n^T over the points on the surface: which ways it faces.
  Eigen::Matrix3d facing = Eigen::Matrix3d::Zero();
};

// Residuals of the picks under a similarity, pixels; columns as `picks`. Infinite behind the
// camera.
Eigen::Matrix2Xd PickErrors(const SparseModel& model, const std::vector<Pick>& picks,
                            const Similarity& scan_from_sparse);

// Least squares over all picks with used[i] (Huber, click noise sigma_px): no surface. Thesis 7.1.3
// knows picks of one photo only; this makes picks of several photos one answer. scale_prior: how
// well the start's scale is believed, as a share.
SimilarityFit FitToPicks(const SparseModel& model, const std::vector<Pick>& picks,
                         const std::vector<bool>& used, double sigma_px, const Similarity& start,
                         const SimilarityFitOptions& options, double scale_prior = kScalePrior);

// The same with point-to-plane distances from the surface; the gate shrinks from `gate` metres. The
// picks keep what the surface leaves open (one wall, two parallel walls); there may be none.
SimilarityFit FitToSurface(const SparseModel& model, const std::vector<SurfacePoint>& points,
                           const ScanPatches& surface, const std::vector<Pick>& picks,
                           const std::vector<bool>& used, double sigma_px, double gate,
                           const Similarity& start, const SimilarityFitOptions& options);

}  // namespace roomtex
