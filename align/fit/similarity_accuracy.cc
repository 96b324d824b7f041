#include "align/fit/similarity_accuracy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include <Eigen/Eigenvalues>

#include "core/decompositions.h"
#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Cells of the surface with fewer points say nothing about the accuracy of the fit.
constexpr int kMinPointsOfCell = 5;
constexpr double kMinFacingShare = 0.03;  // nor do the ways that fewer points of all face
// A model of few points leaves most small cells with fewer: to judge, cells grow until half the
// points count, up to this edge in metres. Of 349 points in a room 75 counted by half metres, and
// the jackknife had 0.4 m where the fit was right to 4 mm.
constexpr double kMaxCellSize = 2;
constexpr double kPartSize = 1.5;  // metres; edge of the parts of the jackknife
constexpr int kMinParts = 5;       // fewer leave the jackknife nothing to compare

// How far the surface is off as a whole within a cell, metres^2: the spread of the cells' median
// distances beyond what their points' own noise explains. Bends of model and scan show there.
double CommonVariance(const std::vector<SurfaceMatch>& matches, const SurfaceCells& cells) {
  std::map<int, std::vector<double>> distances, variances;
  for (size_t i = 0; i < matches.size(); ++i) {
    const int cell = cells.Cell(i);
    if (cells.NumPoints(cell) < kMinPointsOfCell) continue;
    distances[cell].push_back(matches[i].distance);
    variances[cell].push_back(std::pow(matches[i].sigma, 2) - std::pow(kSurfaceNoise, 2));
  }
  std::vector<double> excess;
  for (auto& [cell, values] : distances) {
    const auto n = static_cast<double>(values.size());
    // The variance of a median is pi / 2 times that of a mean; a median of squares has so much less
    // than the variance, and the noise's share of it likewise.
    excess.push_back(std::pow(Median(values), 2) -
                     kMedianSquarePerVariance * kPi / 2 * Median(variances[cell]) / n);
  }
  return std::max(std::pow(kSurfaceNoise, 2), Median(excess) / kMedianSquarePerVariance);
}

// The distances at the solution of a fit, all together and part by part; facing: mean of n n^T.
struct SurfaceSums {
  SurfaceSums(const std::vector<SurfaceMatch>& matches, const std::vector<SurfacePoint>& points,
              const SurfaceWeights& weights, const SimilarityFit& fit)
      : parts(weights.num_parts()) {
    int num_counted = 0;
    for (size_t i = 0; i < matches.size(); ++i) {
      if (!weights.Counts(i)) continue;
      ++num_counted;
      const Eigen::Vector3d& n = weights.Normal(i);
      const Eigen::Vector3d x_in_scan = fit.scan_from_sparse * points[matches[i].point].x_in_sparse;
      for (SimilarityNormal* one : {&all, &parts[weights.Part(i)]}) {
        one->AddDistance(matches[i].distance, x_in_scan, n, fit.pivot, 1 / weights.Variance(i));
      }
      facing += n * n.transpose();
    }
    facing /= std::max(1, num_counted);
  }

  SimilarityNormal all;
  std::vector<SimilarityNormal> parts;
  Eigen::Matrix3d facing = Eigen::Matrix3d::Zero();
};

}  // namespace

// One step from the solution, where all parts together have their minimum.
Matrix7d JackknifeCovariance(const SimilarityNormal& all,
                             const std::vector<SimilarityNormal>& parts) {
  std::vector<Vector7d> steps;
  Vector7d mean = Vector7d::Zero();
  for (const SimilarityNormal& part : parts) {
    if (part.matrix.isZero(0)) continue;
    SimilarityNormal rest = all;
    rest.matrix -= part.matrix;
    rest.gradient -= part.gradient;
    Vector7d step;
    Matrix7d inverse;
    if (!rest.SolveStep(&step, &inverse)) continue;
    steps.push_back(step);
    mean += step;
  }
  Matrix7d covariance = Matrix7d::Zero();
  if (static_cast<int>(steps.size()) < kMinParts) return covariance;
  const auto n = static_cast<double>(steps.size());
  mean /= n;
  for (const Vector7d& step : steps) {
    covariance += (n - 1) / n * (step - mean) * (step - mean).transpose();
  }
  return covariance;
}

Matrix7d Larger(const Matrix7d& a, const Matrix7d& b) {
  const Eigen::SelfAdjointEigenSolver<Matrix7d> of_a(a);
  const Matrix7d root = of_a.operatorSqrt(), inverse_root = of_a.operatorInverseSqrt();
  if (!inverse_root.allFinite()) return a;
  const SymmetricEigen relative(inverse_root * b * inverse_root);
  const Vector7d larger = relative.values.cwiseMax(1);
  return root * relative.vectors * larger.asDiagonal() * relative.vectors.transpose() * root;
}

SurfaceWeights::SurfaceWeights(const std::vector<SurfaceMatch>& matches, const ScanPatches& surface,
                               double cell_size) {
  std::vector<Eigen::Vector3d> places, normals;
  for (const SurfaceMatch& match : matches) {
    places.push_back(surface.patches()[match.patch].point);
    normals.push_back(surface.patches()[match.patch].normal);
  }
  const SurfaceCells cells(places, normals, cell_size);
  const double common = CommonVariance(matches, cells);
  common_sigma_ = std::sqrt(common);
  std::map<std::array<long, 3>, int> parts;
  size_t num_counted = 0;
  for (size_t i = 0; i < matches.size(); ++i) {
    const int count = cells.NumPoints(cells.Cell(i));
    const double share = cells.NumPointsAlike(i) / static_cast<double>(matches.size());
    num_in_cells_ += count >= kMinPointsOfCell;
    counts_.push_back(count >= kMinPointsOfCell && share >= kMinFacingShare);
    num_counted += counts_.back();
    const double own = std::pow(matches[i].sigma, 2) - std::pow(kSurfaceNoise, 2);
    variances_.push_back(own + count * common);
    normals_.push_back(cells.SharedNormal(i));
    std::array<long, 3> key;
    for (int k = 0; k < 3; ++k) key[k] = std::lround(std::floor(places[i][k] / kPartSize));
    parts_.push_back(parts.emplace(key, static_cast<int>(parts.size())).first->second);
  }
  num_parts_ = static_cast<int>(parts.size());
  // What is round faces all ways: no one way has many points, and all of them together hold it.
  if (2 * num_counted >= num_in_cells_) return;
  for (size_t i = 0; i < matches.size(); ++i) {
    counts_[i] = cells.NumPoints(cells.Cell(i)) >= kMinPointsOfCell;
  }
}

void JudgeAccuracy(const std::vector<SurfaceMatch>& matches,
                   const std::vector<SurfacePoint>& points, const ScanPatches& surface,
                   const PickTerms& terms, const std::vector<bool>& used, double sigma_px,
                   const Similarity& start, SimilarityFit* fit) {
  SurfaceWeights weights(matches, surface);
  SurfaceSums sums(matches, points, weights, *fit);
  fit->surface_information = sums.all.matrix;
  fit->facing = sums.facing;
  double cell_size = SurfaceCells::kSize;
  while (2 * weights.num_in_cells() < matches.size() && cell_size < kMaxCellSize) {
    cell_size *= 2;
    weights = SurfaceWeights(matches, surface, cell_size);
    sums = SurfaceSums(matches, points, weights, *fit);
  }
  SimilarityNormal& normal = sums.all;
  normal.AddPicks(terms, used, sigma_px, weights.CommonSigma(), fit->scan_from_sparse, fit->pivot);
  normal.AddScalePrior(fit->scan_from_sparse, start, kScalePrior);
  Vector7d step;
  if (!normal.SolveStep(&step, &fit->covariance)) {
    fit->covariance.setConstant(std::numeric_limits<double>::infinity());
    return;
  }
  fit->covariance = Larger(fit->covariance, JackknifeCovariance(normal, sums.parts));
}

}  // namespace roomtex
