#include "align/fit/similarity_normal.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/balanced_inverse.h"
#include "core/frames.h"
#include "core/robust_kernel.h"
#include "core/twist.h"

namespace roomtex {

PickTerms::PickTerms(const SparseModel& model, const std::vector<Pick>& picks) {
  for (const Pick& pick : picks) {
    const SparseImage* image = model.FindImage(pick.image_name);
    const auto [at, is_new] =
        projections_.try_emplace(image->camera_id, model.cameras.at(image->camera_id));
    terms_.push_back({&at->second, image->cam_from_model, &pick});
  }
}

Eigen::Vector2d PickTerms::Error(int i, const Similarity& scan_from_sparse) const {
  const Term& term = terms_[i];
  const Rigid cam_from_scan = CamFromScan(term.cam_from_sparse, scan_from_sparse);
  const auto error =
      term.projection->ImgError(cam_from_scan * term.pick->x_in_scan, term.pick->x_in_img);
  if (error) return *error;
  return Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
}

double PickTerms::PixelsPerMetre(int i, const Similarity& scan_from_sparse) const {
  const Term& term = terms_[i];
  const Rigid cam_from_scan = CamFromScan(term.cam_from_sparse, scan_from_sparse);
  const double depth = (cam_from_scan * term.pick->x_in_scan).norm();
  return depth > 0 ? term.projection->camera().MeanFocalLength() / depth : 0;
}

Eigen::Matrix<double, 2, 7> PickTerms::Jacobian(int i, const Similarity& s,
                                                const Eigen::Vector3d& pivot) const {
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 2, 7> jacobian;
  for (int k = 0; k < 7; ++k) {
    const Vector7d step = kStep * Vector7d::Unit(k);
    jacobian.col(k) =
        (Error(i, Moved(s, pivot, step)) - Error(i, Moved(s, pivot, -step))) / (2 * kStep);
  }
  return jacobian;
}

std::vector<SurfaceMatch> FindMatches(const std::vector<SurfacePoint>& points,
                                      const ScanPatches& surface, const Similarity& s, double gate,
                                      double max_gate) {
  const Eigen::Matrix3d linear = s.scale * s.rotation.toRotationMatrix();
  std::vector<SurfaceMatch> matches;
  for (size_t i = 0; i < points.size(); ++i) {
    const double reach = std::hypot(gate, surface.cell_size());
    const auto nearest = surface.FindNearest(s * points[i].x_in_sparse, reach);
    if (!nearest) continue;
    const ScanPatch& patch = surface.patches()[nearest->patch];
    const Eigen::Vector3d normal_in_sparse = linear.transpose() * patch.normal;
    if (!(normal_in_sparse.dot(points[i].to_cameras) > 0)) continue;
    const double point_variance = normal_in_sparse.dot(points[i].covariance * normal_in_sparse);
    const double patch_variance = patch.thickness * patch.thickness / patch.num_samples;
    SurfaceMatch match{static_cast<int>(i), nearest->patch, nearest->distance,
                       std::sqrt(point_variance + patch_variance + kSurfaceNoise * kSurfaceNoise)};
    if (std::abs(match.distance) < std::min(max_gate, std::max(gate, 3 * match.sigma))) {
      matches.push_back(match);
    }
  }
  return matches;
}

void SimilarityNormal::AddPicks(const PickTerms& terms, const std::vector<bool>& used,
                                double sigma_px, double surface_sigma, const Similarity& s,
                                const Eigen::Vector3d& pivot) {
  for (int i = 0; i < terms.size(); ++i) {
    if (!used[i]) continue;
    const Eigen::Vector2d error = terms.Error(i, s);
    const Eigen::Matrix<double, 2, 7> jacobian = terms.Jacobian(i, s, pivot);
    if (!error.allFinite() || !jacobian.allFinite()) continue;
    const double own_sigma_px =
        std::hypot(sigma_px / terms.Weight(i), surface_sigma * terms.PixelsPerMetre(i, s));
    const double deviations = error.norm() / own_sigma_px;
    const double weight = HuberWeight(deviations, kClickHuber);
    Add<2>(jacobian, error, weight / (own_sigma_px * own_sigma_px));
  }
}

void SimilarityNormal::AddScalePrior(const Similarity& s, const Similarity& start,
                                     double scale_prior) {
  const double off = std::log(s.scale / start.scale);
  matrix(6, 6) += 1 / (scale_prior * scale_prior);
  gradient[6] += off / (scale_prior * scale_prior);
}

void SimilarityNormal::AddDistance(double distance, const Eigen::Vector3d& x_in_scan,
                                   const Eigen::Vector3d& surface_normal,
                                   const Eigen::Vector3d& pivot, double weight) {
  const Eigen::Vector3d arm = x_in_scan - pivot;
  Eigen::Matrix<double, 1, 7> jacobian;
  jacobian << surface_normal.transpose(), arm.cross(surface_normal).transpose(),
      surface_normal.dot(arm);
  Add<1>(jacobian, Eigen::Matrix<double, 1, 1>(distance), weight);
}

bool SimilarityNormal::SolveStep(Vector7d* step, Matrix7d* inverse) const {
  const auto found = BalancedInverse(matrix, 1e-12);
  if (!found) return false;
  *inverse = *found;
  *step = -*inverse * gradient;
  return step->allFinite();
}

}  // namespace roomtex
