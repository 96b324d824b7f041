#include "align/fit/similarity_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "align/surface/surface_cells.h"
#include "core/frames.h"
#include "core/option_fields.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"
#include "core/twist.h"

namespace roomtex {
namespace {

using Vector7d = Eigen::Matrix<double, 7, 1>;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
// The gate shrinks by this factor per step.
constexpr double kGateShrink = 0.8;
// Cells of the surface with fewer points say nothing about the accuracy of the fit.
constexpr int kMinPointsOfCell = 5;
constexpr double kMinFacingShare = 0.03;  // nor do the ways that fewer points of all face

// Picks with what their projection needs.
class PickTerms {
 public:
  PickTerms(const SparseModel& model, const std::vector<Pick>& picks) {
    for (const Pick& pick : picks) {
      const SparseImage* image = model.FindImage(pick.image_name);
      const auto [at, is_new] =
          projections_.try_emplace(image->camera_id, model.cameras.at(image->camera_id));
      terms_.push_back({&at->second, image->cam_from_model, &pick});
    }
  }

  Eigen::Vector2d Error(int i, const Similarity& scan_from_sparse) const {
    const Term& term = terms_[i];
    const Rigid cam_from_scan = CamFromScan(term.cam_from_sparse, scan_from_sparse);
    const auto error =
        term.projection->ImgError(cam_from_scan * term.pick->x_in_scan, term.pick->x_in_img);
    return error ? *error : Eigen::Vector2d::Constant(kInfinity);
  }
  double Weight(int i) const { return terms_[i].pick->weight; }

  // By central differences: six to a hundred picks, so exactness of the step is all that matters.
  Eigen::Matrix<double, 2, 7> Jacobian(int i, const Similarity& s,
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

  int size() const { return static_cast<int>(terms_.size()); }

 private:
  struct Term {
    const CameraProjection* projection;
    Rigid cam_from_sparse;
    const Pick* pick;
  };
  std::map<uint32_t, CameraProjection> projections_;
  std::vector<Term> terms_;
};

struct Normal {
  Matrix7d matrix = Matrix7d::Zero();
  Vector7d gradient = Vector7d::Zero();

  template <int N>
  void Add(const Eigen::Matrix<double, N, 7>& jacobian, const Eigen::Matrix<double, N, 1>& residual,
           double weight) {
    matrix += weight * jacobian.transpose() * jacobian;
    gradient += weight * jacobian.transpose() * residual;
  }
};

void AddPicks(const PickTerms& terms, const std::vector<bool>& used, double sigma_px,
              const Similarity& s, const Eigen::Vector3d& pivot, Normal* normal) {
  for (int i = 0; i < terms.size(); ++i) {
    if (!used[i]) continue;
    const Eigen::Vector2d error = terms.Error(i, s);
    const Eigen::Matrix<double, 2, 7> jacobian = terms.Jacobian(i, s, pivot);
    if (!error.allFinite() || !jacobian.allFinite()) continue;
    const double own_sigma_px = sigma_px / terms.Weight(i);
    const double deviations = error.norm() / own_sigma_px;
    const double weight = HuberWeight(deviations, kClickHuber);
    normal->Add<2>(jacobian, error, weight / (own_sigma_px * own_sigma_px));
  }
}

void AddScalePrior(const Similarity& s, const Similarity& start, Normal* normal) {
  const double off = std::log(s.scale / start.scale);
  normal->matrix(6, 6) += 1 / (kScalePrior * kScalePrior);
  normal->gradient[6] += off / (kScalePrior * kScalePrior);
}

// The step to the minimum; none if the normal matrix has no inverse.
bool SolveStep(const Normal& normal, Vector7d* step, Matrix7d* inverse) {
  const Vector7d size = normal.matrix.diagonal().cwiseSqrt();
  if (!normal.matrix.allFinite() || !(size.minCoeff() > 0)) return false;
  const Matrix7d balanced =
      size.cwiseInverse().asDiagonal() * normal.matrix * size.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix7d> solver(balanced);
  if (!(solver.eigenvalues()[0] > 1e-12)) return false;
  const Matrix7d balanced_inverse = solver.eigenvectors() *
                                    solver.eigenvalues().cwiseInverse().asDiagonal() *
                                    solver.eigenvectors().transpose();
  *inverse = size.cwiseInverse().asDiagonal() * balanced_inverse * size.cwiseInverse().asDiagonal();
  *step = -*inverse * normal.gradient;
  return step->allFinite();
}

bool IsTiny(const Vector7d& step) {
  return step.head<3>().norm() < 1e-7 && step.segment<3>(3).norm() < 1e-8 &&
         std::abs(step[6]) < 1e-8;
}

Eigen::Vector3d Pivot(const std::vector<Pick>& picks) {
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
  for (const Pick& pick : picks) pivot += pick.x_in_scan / static_cast<double>(picks.size());
  return pivot;
}

// The pivot where there are no picks.
Eigen::Vector3d Middle(const std::vector<SurfacePoint>& points, const Similarity& s) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const SurfacePoint& point : points) {
    middle += s * point.x_in_sparse / static_cast<double>(points.size());
  }
  return middle;
}

// A sparse point and the patch of the surface it belongs to at one step.
struct Match {
  int point = 0, patch = 0;
  double distance = 0;  // metres, along the normal
  double sigma = 0;     // metres, of that distance
};

std::vector<Match> FindMatches(const std::vector<SurfacePoint>& points, const ScanPatches& surface,
                               const Similarity& s, double gate, double max_gate) {
  const Eigen::Matrix3d linear = s.scale * s.rotation.toRotationMatrix();
  std::vector<Match> matches;
  for (size_t i = 0; i < points.size(); ++i) {
    const double reach = std::hypot(gate, surface.cell_size());
    const auto nearest = surface.FindNearest(s * points[i].x_in_sparse, reach);
    if (!nearest) continue;
    const ScanPatch& patch = surface.patches()[nearest->patch];
    const Eigen::Vector3d normal_in_sparse = linear.transpose() * patch.normal;
    // The scanner and the photos look at the same side of the surface.
    if (!(normal_in_sparse.dot(points[i].to_cameras) > 0)) continue;
    const double point_variance = normal_in_sparse.dot(points[i].covariance * normal_in_sparse);
    const double patch_variance = patch.thickness * patch.thickness / patch.num_samples;
    Match match{static_cast<int>(i), nearest->patch, nearest->distance,
                std::sqrt(point_variance + patch_variance + kSurfaceNoise * kSurfaceNoise)};
    if (std::abs(match.distance) < std::min(max_gate, std::max(gate, 3 * match.sigma))) {
      matches.push_back(match);
    }
  }
  return matches;
}

void AddDistance(const Match& match, const Eigen::Vector3d& x_in_scan,
                 const Eigen::Vector3d& surface_normal, const Eigen::Vector3d& pivot, double weight,
                 Normal* normal) {
  const Eigen::Vector3d arm = x_in_scan - pivot;
  Eigen::Matrix<double, 1, 7> jacobian;
  jacobian << surface_normal.transpose(), arm.cross(surface_normal).transpose(),
      surface_normal.dot(arm);
  normal->Add<1>(jacobian, Eigen::Matrix<double, 1, 1>(match.distance), weight);
}

// Tukey's biweight: what lies beyond the gate does not pull.
double TukeyWeight(double distance, double gate) {
  const double root = TukeyRootWeight(distance, gate);
  return root * root;
}

// How far the surface is off as a whole within a cell, metres^2: the spread of the cells' median
// distances beyond what their points' own noise explains. Bends of model and scan show there.
double CommonVariance(const std::vector<Match>& matches, const SurfaceCells& cells) {
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
    // The variance of a median is pi / 2 times that of a mean.
    excess.push_back(std::pow(Median(values), 2) - kPi / 2 * Median(variances[cell]) / n);
  }
  return std::max(std::pow(kSurfaceNoise, 2), Median(excess) / kMedianSquarePerVariance);
}

// Fills what the fit knows about its own accuracy, at its solution.
void JudgeAccuracy(const std::vector<Match>& matches, const std::vector<SurfacePoint>& points,
                   const ScanPatches& surface, const PickTerms& terms,
                   const std::vector<bool>& used, double sigma_px, const Similarity& start,
                   SimilarityFit* fit) {
  std::vector<Eigen::Vector3d> places, normals;
  for (const Match& match : matches) {
    places.push_back(surface.patches()[match.patch].point);
    normals.push_back(surface.patches()[match.patch].normal);
  }
  const SurfaceCells cells(places, normals);
  const double common = CommonVariance(matches, cells);
  Normal normal;
  int num_counted = 0;
  for (size_t i = 0; i < matches.size(); ++i) {
    const int count = cells.NumPoints(cells.Cell(i));
    // A few points, where patches may straddle an edge, fix nothing on their own.
    const double share = cells.NumPointsAlike(i) / static_cast<double>(matches.size());
    if (count < kMinPointsOfCell || share < kMinFacingShare) continue;
    ++num_counted;
    const double own = std::pow(matches[i].sigma, 2) - std::pow(kSurfaceNoise, 2);
    const Eigen::Vector3d n = cells.SharedNormal(i);
    AddDistance(matches[i], fit->scan_from_sparse * points[matches[i].point].x_in_sparse, n,
                fit->pivot, 1 / (own + count * common), &normal);
    fit->facing += n * n.transpose();
  }
  fit->facing /= std::max(1, num_counted);
  fit->surface_information = normal.matrix;
  AddPicks(terms, used, sigma_px, fit->scan_from_sparse, fit->pivot, &normal);
  AddScalePrior(fit->scan_from_sparse, start, &normal);
  Vector7d step;
  if (!SolveStep(normal, &step, &fit->covariance)) fit->covariance.setConstant(kInfinity);
}

}  // namespace

void SimilarityFitOptions::Declare(OptionFields* fields) {
  const std::string gates = "--Fit.min_gate must be positive and not above --Fit.max_gate";
  fields
      ->Int("Fit.min_track", &min_track,
            "Observations that a sparse point needs to take part in the fit to the surface; larger "
            "= fewer, better points.")
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
                         const SimilarityFitOptions& options) {
  SimilarityFit fit;
  fit.scan_from_sparse = start;
  fit.pivot = Pivot(picks);
  fit.covariance.setConstant(kInfinity);
  const PickTerms terms(model, picks);
  for (int i = 0; i < options.num_steps && !fit.converged; ++i) {
    Normal normal;
    AddPicks(terms, used, sigma_px, fit.scan_from_sparse, fit.pivot, &normal);
    AddScalePrior(fit.scan_from_sparse, start, &normal);
    Vector7d step;
    if (!SolveStep(normal, &step, &fit.covariance)) return fit;
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
  std::vector<Match> matches;
  for (int i = 0; i < options.num_steps && !fit.converged; ++i) {
    const Similarity s = fit.scan_from_sparse;
    matches = FindMatches(points, surface, s, gate, options.max_gate);
    if (matches.size() < 30) return fit;
    std::vector<double> deviations, distances;
    for (const Match& match : matches) {
      deviations.push_back(std::abs(match.distance) / match.sigma);
      distances.push_back(std::abs(match.distance));
    }
    // What the distances say about themselves: a model that is bent, or a scan with more noise than
    // assumed, must not outvote the picks.
    const double inflation = std::max(1.0, kSigmaPerMad * Median(deviations));
    Normal normal;
    for (const Match& match : matches) {
      const double own_gate = std::min(options.max_gate, std::max(gate, 3 * match.sigma));
      const double sigma = match.sigma * inflation;
      AddDistance(match, s * points[match.point].x_in_sparse, surface.patches()[match.patch].normal,
                  fit.pivot, TukeyWeight(match.distance, own_gate) / (sigma * sigma), &normal);
    }
    AddPicks(terms, used, sigma_px, s, fit.pivot, &normal);
    AddScalePrior(s, start, &normal);
    Vector7d step;
    if (!SolveStep(normal, &step, &fit.covariance)) return fit;
    fit.scan_from_sparse = Moved(s, fit.pivot, step);
    if (!(std::abs(fit.scan_from_sparse.scale / start.scale - 1) < options.max_scale_change)) {
      return fit;
    }
    const double last_gate = std::max(options.min_gate, 4 * kSigmaPerMad * Median(distances));
    fit.converged = IsTiny(step) && gate <= last_gate;
    gate = std::max(kGateShrink * gate, std::min(gate, last_gate));
  }
  matches = FindMatches(points, surface, fit.scan_from_sparse, gate, options.max_gate);
  double sum_before = 0, sum_after = 0;
  for (const Match& match : matches) {
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
