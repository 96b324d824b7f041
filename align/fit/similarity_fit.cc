#include "align/fit/similarity_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "align/fit/similarity_accuracy.h"
#include "align/fit/similarity_normal.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"
#include "core/twist.h"

namespace roomtex {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// The gate shrinks by this factor per step.
constexpr double kGateShrink = 0.8;
constexpr int kNumCellSteps = 20;

bool IsTiny(const Vector7d& step) {
  return step.head<3>().norm() < 1e-7 && step.segment<3>(3).norm() < 1e-8 &&
         std::abs(step[6]) < 1e-8;
}

// Of what the fit rests on: check points may lie anywhere.
Eigen::Vector3d Pivot(const std::vector<Pick>& picks) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const Pick& pick : picks) {
    if (!(pick.weight > 0)) continue;
    sum += pick.x_in_scan;
    ++count;
  }
  return count > 0 ? Eigen::Vector3d(sum / count) : picks[0].x_in_scan;
}

// The pivot where there are no picks.
Eigen::Vector3d Middle(const std::vector<SurfacePoint>& points, const Similarity& s) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const SurfacePoint& point : points) {
    middle += s * point.x_in_sparse / static_cast<double>(points.size());
  }
  return middle;
}

// Tukey's biweight: what lies beyond the gate does not pull.
double TukeyWeight(double distance, double gate) {
  const double root = TukeyRootWeight(distance, gate);
  return root * root;
}

// The last steps, with the weights that are true to how surfaces are off (SurfaceWeights): where
// the surface leaves a direction open, the scatter of its normals does not hold the model there,
// and picks do. Keeps the fit as it is where that has no solution.
void WeighByCells(const std::vector<SurfacePoint>& points, const ScanPatches& surface,
                  const PickTerms& terms, const std::vector<bool>& used, double sigma_px,
                  double gate, const Similarity& start, const SimilarityFitOptions& options,
                  SimilarityFit* fit) {
  Similarity s = fit->scan_from_sparse;
  for (int i = 0; i < kNumCellSteps; ++i) {
    const auto matches = FindMatches(points, surface, s, gate, options.max_gate);
    const SurfaceWeights weights(matches, surface);
    SimilarityNormal normal;
    for (size_t k = 0; k < matches.size(); ++k) {
      if (!weights.Counts(k)) continue;
      const SurfaceMatch& match = matches[k];
      const double own_gate = std::min(options.max_gate, std::max(gate, 3 * match.sigma));
      normal.AddDistance(match.distance, s * points[match.point].x_in_sparse, weights.Normal(k),
                         fit->pivot, TukeyWeight(match.distance, own_gate) / weights.Variance(k));
    }
    normal.AddPicks(terms, used, sigma_px, weights.CommonSigma(), s, fit->pivot);
    normal.AddScalePrior(s, start, kScalePrior);
    Vector7d step;
    Matrix7d inverse;
    if (!normal.SolveStep(&step, &inverse)) return;
    s = Moved(s, fit->pivot, step);
    if (!(std::abs(s.scale / start.scale - 1) < options.max_scale_change)) return;
    if (IsTiny(step)) break;
  }
  fit->scan_from_sparse = s;
}

}  // namespace

void SimilarityFitOptions::Declare(OptionFields* fields) {
  const std::string gates = "--Fit.min_gate must be positive and not above --Fit.max_gate";
  fields
      ->Int("Fit.min_track", &min_track,
            "Observations that a sparse point needs to take part in the fit to the surface; larger "
            "= fewer, better points. A model with fewer than " +
                std::to_string(kFewPoints) + " such points uses those of two observations, too.")
      .AtLeast(2);
  fields
      ->Number("Fit.max_gate", &max_gate,
               "Metres; a sparse point farther from the surface never takes part; larger = more "
               "tolerant of picks that are off.")
      .Positive()
      .SaysSentence(gates);
  fields
      ->Number("Fit.min_gate", &min_gate,
               "Metres; the fit's last steps still take points this near to the surface; larger = "
               "more tolerant.")
      .Positive()
      .SaysSentence(gates);
  fields->Require(max_gate >= min_gate, gates);
  fields
      ->Number(
          "Fit.max_scale_change", &max_scale_change,
          "Share by which the scale may move away from that of the picks; larger = more tolerant.")
      .Between(0, 1);
  fields->Int("Fit.num_steps", &num_steps, "Steps of the fit at most.").Positive();
}

std::vector<std::string> SimilarityFitOptions::Problems() const { return ProblemsOf(*this); }

int TrackThatCounts(const SparseModel& model, int min_track) {
  const auto num_points = std::count_if(
      model.points.begin(), model.points.end(),
      [&](const auto& of_id) { return static_cast<int>(of_id.second.track.size()) >= min_track; });
  return num_points < kFewPoints ? std::min(min_track, 2) : min_track;
}

std::vector<SurfacePoint> FindSurfacePoints(const SparseModel& model, int min_track,
                                            double sigma_px, size_t max_points) {
  struct View {
    Eigen::Matrix3d rotation;
    Rigid pose;
    Eigen::Vector3d centre;
    double focal_length;
    bool is_perspective;
  };
  std::map<uint32_t, View> views;
  for (const auto& [id, image] : model.images) {
    const Rigid& pose = image.cam_from_model;
    views[id] = {pose.rotation.toRotationMatrix(), pose, pose.TargetOriginInSource(),
                 model.cameras.at(image.camera_id).MeanFocalLength(),
                 model.cameras.at(image.camera_id).IsPerspective()};
  }
  std::vector<SurfacePoint> points;
  for (const auto& [id, sparse] : model.points) {
    if (static_cast<int>(sparse.track.size()) < min_track) continue;
    SurfacePoint point;
    point.x_in_sparse = sparse.x_in_model;
    point.point3d_id = id;
    point.num_observations = static_cast<int>(sparse.track.size());
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    double mean_distance = 0;
    for (const TrackElement& element : sparse.track) {
      const View& view = views.at(element.image_id);
      const Eigen::Vector3d p = view.pose * sparse.x_in_model;
      if (view.is_perspective && !(p.z() > 0)) continue;
      // Of an undistorted projection: enough for a weight.
      Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();
      if (view.is_perspective) {
        jacobian.topRows<2>() << 1 / p.z(), 0, -p.x() / (p.z() * p.z()), 0, 1 / p.z(),
            -p.y() / (p.z() * p.z());
      } else {
        const Eigen::Vector3d ray = p.normalized();
        jacobian = (Eigen::Matrix3d::Identity() - ray * ray.transpose()) / p.norm();
      }
      jacobian *= view.focal_length * view.rotation;
      information += jacobian.transpose() * jacobian;
      const Eigen::Vector3d offset = view.centre - sparse.x_in_model;
      point.to_cameras += offset.normalized() / static_cast<double>(sparse.track.size());
      mean_distance += offset.norm() / static_cast<double>(sparse.track.size());
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(information);
    const double least = solver.eigenvalues()[0];
    if (!(sigma_px * sigma_px < least * 0.01 * mean_distance * mean_distance)) continue;
    point.covariance = sigma_px * sigma_px * information.inverse();
    points.push_back(point);
  }
  if (points.size() <= max_points) return points;
  const size_t stride = (points.size() + max_points - 1) / max_points;
  std::vector<SurfacePoint> thinned;
  for (size_t i = 0; i < points.size(); i += stride) thinned.push_back(points[i]);
  return thinned;
}

Eigen::Matrix2Xd PickErrors(const SparseModel& model, const std::vector<Pick>& picks,
                            const Similarity& scan_from_sparse) {
  const PickTerms terms(model, picks);
  Eigen::Matrix2Xd errors(2, terms.size());
  for (int i = 0; i < terms.size(); ++i) errors.col(i) = terms.Error(i, scan_from_sparse);
  return errors;
}

SimilarityFit FitToPicks(const SparseModel& model, const std::vector<Pick>& picks,
                         const std::vector<bool>& used, double sigma_px, const Similarity& start,
                         const SimilarityFitOptions& options, double scale_prior) {
  SimilarityFit fit;
  fit.scan_from_sparse = start;
  fit.pivot = Pivot(picks);
  fit.covariance.setConstant(kInfinity);
  const PickTerms terms(model, picks);
  for (int i = 0; i < options.num_steps && !fit.converged; ++i) {
    SimilarityNormal normal;
    normal.AddPicks(terms, used, sigma_px, 0, fit.scan_from_sparse, fit.pivot);
    normal.AddScalePrior(fit.scan_from_sparse, start, scale_prior);
    Vector7d step;
    if (!normal.SolveStep(&step, &fit.covariance)) return fit;
    fit.scan_from_sparse = Moved(fit.scan_from_sparse, fit.pivot, step);
    fit.converged = IsTiny(step);
  }
  return fit;
}

SimilarityFit FitToSurface(const SparseModel& model, const std::vector<SurfacePoint>& points,
                           const ScanPatches& surface, const std::vector<Pick>& picks,
                           const std::vector<bool>& used, double sigma_px, double gate,
                           const Similarity& start, const SimilarityFitOptions& options) {
  SimilarityFit fit;
  fit.scan_from_sparse = start;
  fit.pivot = picks.empty() ? Middle(points, start) : Pivot(picks);
  fit.covariance.setConstant(kInfinity);
  const PickTerms terms(model, picks);
  gate = std::min(gate, options.max_gate);
  std::vector<SurfaceMatch> matches;
  for (int i = 0; i < options.num_steps && !fit.converged; ++i) {
    const Similarity s = fit.scan_from_sparse;
    matches = FindMatches(points, surface, s, gate, options.max_gate);
    if (matches.size() < 30) return fit;
    std::vector<double> deviations, distances;
    for (const SurfaceMatch& match : matches) {
      deviations.push_back(std::abs(match.distance) / match.sigma);
      distances.push_back(std::abs(match.distance));
    }
    // What the distances say about themselves: a model that is bent, or a scan with more noise than
    // assumed, must not outvote the picks.
    const double inflation = std::max(1.0, kSigmaPerMad * Median(deviations));
    SimilarityNormal normal;
    for (const SurfaceMatch& match : matches) {
      const double own_gate = std::min(options.max_gate, std::max(gate, 3 * match.sigma));
      const double sigma = match.sigma * inflation;
      normal.AddDistance(match.distance, s * points[match.point].x_in_sparse,
                         surface.patches()[match.patch].normal, fit.pivot,
                         TukeyWeight(match.distance, own_gate) / (sigma * sigma));
    }
    normal.AddPicks(terms, used, sigma_px, 0, s, fit.pivot);
    normal.AddScalePrior(s, start, kScalePrior);
    Vector7d step;
    if (!normal.SolveStep(&step, &fit.covariance)) return fit;
    fit.scan_from_sparse = Moved(s, fit.pivot, step);
    if (!(std::abs(fit.scan_from_sparse.scale / start.scale - 1) < options.max_scale_change)) {
      return fit;
    }
    const double last_gate = std::max(options.min_gate, 4 * kSigmaPerMad * Median(distances));
    fit.converged = IsTiny(step) && gate <= last_gate;
    gate = std::max(kGateShrink * gate, std::min(gate, last_gate));
  }
  WeighByCells(points, surface, terms, used, sigma_px, gate, start, options, &fit);
  matches = FindMatches(points, surface, fit.scan_from_sparse, gate, options.max_gate);
  double sum_before = 0, sum_after = 0;
  for (const SurfaceMatch& match : matches) {
    const ScanPatch& patch = surface.patches()[match.patch];
    const Eigen::Vector3d before = start * points[match.point].x_in_sparse - patch.point;
    sum_before += std::pow(patch.normal.dot(before), 2);
    sum_after += match.distance * match.distance;
    ++fit.num_points;
  }
  JudgeAccuracy(matches, points, surface, terms, used, sigma_px, start, &fit);
  fit.converged = fit.num_points > 0;
  fit.rms_before = fit.num_points > 0 ? std::sqrt(sum_before / fit.num_points) : 0;
  fit.rms_after = fit.num_points > 0 ? std::sqrt(sum_after / fit.num_points) : 0;
  return fit;
}

}  // namespace roomtex
