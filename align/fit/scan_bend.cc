#include "align/fit/scan_bend.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/frames.h"
#include "core/projections.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"
#include "core/twist.h"

namespace roomtex {
namespace {

constexpr int kMaxDegree = 4;
constexpr double kStep = 1e-6;  // of numeric derivatives
constexpr int kNumBend = ScanBend::kNumCoefficients;
constexpr int kNumUnknowns = 7 + kNumBend;
using Vector = Eigen::Matrix<double, kNumUnknowns, 1>;
using Matrix = Eigen::Matrix<double, kNumUnknowns, kNumUnknowns>;

constexpr int kNumSteps = 40;
constexpr size_t kMinMatches = 200;
constexpr double kReach = 0.12;  // metres; matches farther off are none
constexpr double kGate = 4.0;    // standard deviations, Tukey's biweight
// Standard deviations of the coefficients to start from: larger than any that is expected.
constexpr double kStartSigma = 0.005;
constexpr double kLeastSigma = 1e-6;
// A bend of more than this share of the ranges (rms) is no bend but a wrong alignment.
constexpr double kMaxBend = 0.05;

// Real spherical harmonics of degree 1 to 4, of mean square 1 over the sphere.
void Harmonics(const Eigen::Vector3d& u, double* values) {
  // Associated Legendre functions over sin^m, by recursion; cos and sin of m azimuths times sin^m.
  double legendre[kMaxDegree + 1][kMaxDegree + 1] = {};
  double c[kMaxDegree + 1] = {1}, s[kMaxDegree + 1] = {0};
  legendre[0][0] = 1;
  for (int m = 1; m <= kMaxDegree; ++m) {
    legendre[m][m] = (2 * m - 1) * legendre[m - 1][m - 1];
    c[m] = c[m - 1] * u.x() - s[m - 1] * u.y();
    s[m] = s[m - 1] * u.x() + c[m - 1] * u.y();
  }
  for (int m = 0; m < kMaxDegree; ++m) {
    legendre[m + 1][m] = (2 * m + 1) * u.z() * legendre[m][m];
    for (int l = m + 2; l <= kMaxDegree; ++l) {
      legendre[l][m] =
          ((2 * l - 1) * u.z() * legendre[l - 1][m] - (l + m - 1) * legendre[l - 2][m]) / (l - m);
    }
  }
  for (int l = 1; l <= kMaxDegree; ++l) {
    *values++ = std::sqrt(2 * l + 1.0) * legendre[l][0];
    double ratio = 1;  // (l - m)! / (l + m)!
    for (int m = 1; m <= l; ++m) {
      ratio /= (l + m) * (l - m + 1);
      const double size = std::sqrt(2 * (2 * l + 1) * ratio) * legendre[l][m];
      *values++ = size * c[m];
      *values++ = size * s[m];
    }
  }
}

}  // namespace

ScanBend::ScanBend(const Scan& scan) : station_(scan.Station()) {
  const Eigen::Vector3d up = scan.up.normalized();
  // Horizontal direction of the first columns, and of those a few farther on.
  const auto heading = [&](int first, int last) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int column = first; column < last; ++column) {
      for (int row = 0; row < scan.num_rows; ++row) {
        const Eigen::Vector3d offset = scan.points[scan.Index(column, row)] - station_;
        if (!offset.allFinite()) continue;
        const Eigen::Vector3d flat = offset - up.dot(offset) * up;
        if (flat.norm() > 0.1 * offset.norm()) sum += flat.normalized();
      }
    }
    return sum;
  };
  const int few = std::max(1, scan.num_columns / 50);
  Eigen::Vector3d first = heading(0, few), next = heading(few, 2 * few);
  if (!(first.norm() > 0)) first = up.unitOrthogonal();
  axes_.row(0) = first.normalized();
  axes_.row(1) = up.cross(first.normalized());
  axes_.row(2) = up;
  turn_ = next.dot(axes_.row(1).transpose()) < 0 ? -1 : 1;
}

ScanBend::Coefficients ScanBend::Functions(const Eigen::Vector3d& offset) const {
  Coefficients values;
  const Eigen::Vector3d u = (axes_ * offset).normalized();
  Harmonics(u, values.data());
  const double azimuth = std::atan2(u.y(), u.x());
  const double share = turn_ * azimuth / (2 * kPi);  // of the turn, from the first column
  values[kNumRange] = std::sqrt(12.0) * (share - std::floor(share) - 0.5);
  values[kNumRange + 1] = std::sqrt(2.0) * std::cos(azimuth);
  values[kNumRange + 2] = std::sqrt(2.0) * std::sin(azimuth);
  values[kNumRange + 3] = std::sqrt(2.0) * std::cos(2 * azimuth);
  values[kNumRange + 4] = std::sqrt(2.0) * std::sin(2 * azimuth);
  return values;
}

Eigen::Vector2d ScanBend::At(const Eigen::Vector3d& x_in_scan) const {
  const Coefficients terms = coefficients.cwiseProduct(Functions(x_in_scan - station_));
  return {terms.head<kNumRange>().sum(), terms.tail<kNumAzimuth>().sum()};
}

Eigen::Vector3d ScanBend::Bend(const Eigen::Vector3d& x_in_scan) const {
  const Eigen::Vector3d offset = x_in_scan - station_;
  if (IsNone() || !(offset.norm() > 0)) return x_in_scan;
  const Eigen::Vector2d at = At(x_in_scan);
  const Eigen::AngleAxisd turn(at[1], Eigen::Vector3d(axes_.row(2).transpose()));
  return station_ + (1 + at[0]) * (turn * offset);
}

Eigen::Vector3d ScanBend::Straighten(const Eigen::Vector3d& x_in_scan) const {
  Eigen::Vector3d straight = x_in_scan;
  // The bend is small and smooth: every step leaves a few per cent of the error.
  for (int i = 0; i < 8 && !IsNone(); ++i) straight += x_in_scan - Bend(straight);
  return straight;
}

Eigen::Matrix<double, 3, ScanBend::kNumCoefficients> ScanBend::Basis(
    const Eigen::Vector3d& x_in_scan) const {
  const Eigen::Vector3d offset = x_in_scan - station_;
  const Coefficients values = Functions(offset);
  Eigen::Matrix<double, 3, kNumCoefficients> basis;
  basis.leftCols<kNumRange>() = offset * values.head<kNumRange>().transpose();
  basis.rightCols<kNumAzimuth>() = Eigen::Vector3d(axes_.row(2).transpose()).cross(offset) *
                                   values.tail<kNumAzimuth>().transpose();
  return basis;
}

namespace {

struct State {
  Similarity scan_from_sparse;
  ScanBend bend;
};

class BendSolver {
 public:
  BendSolver(const SparseModel& model, const std::vector<SurfacePoint>& points,
             const ScanPatches& surface, const std::vector<Pick>& picks,
             const std::vector<bool>& used, double pick_sigma_px, const Similarity& start)
      : model_(model),
        points_(points),
        surface_(surface),
        picks_(picks),
        used_(used),
        pick_sigma_px_(pick_sigma_px),
        start_(start) {
    projections_ = ProjectionsOf(model.cameras);
    const auto num_used = std::count(used.begin(), used.end(), true);
    for (size_t i = 0; i < picks.size(); ++i) {
      if (used[i]) pivot_ += picks[i].x_in_scan / static_cast<double>(num_used);
    }
    for (size_t i = 0; num_used == 0 && i < points.size(); ++i) {
      pivot_ += start * points[i].x_in_sparse / static_cast<double>(points.size());
    }
  }

  // The most likely state; false if there is none.
  bool Solve(State* state) {
    for (int i = 0; i < kNumSteps; ++i) {
      FindMatches(*state);
      if (matches_.size() < kMinMatches) return false;
      Matrix normal = Matrix::Zero();
      Vector gradient = Vector::Zero();
      AddMatches(*state, &normal, &gradient);
      AddPicks(*state, &normal, &gradient);
      AddPriors(*state, &normal, &gradient);
      const Eigen::LDLT<Matrix> solver(normal);
      const Vector step = -solver.solve(gradient);
      if (solver.info() != Eigen::Success || !step.allFinite()) return false;
      *state = Moved(*state, step);
      UpdateVariances(*state, solver.solve(Matrix::Identity()));
    }
    FindMatches(*state);
    return matches_.size() >= kMinMatches;
  }

  struct Match {
    int point = 0, patch = 0;
    double distance = 0, sigma = 0;  // metres
  };
  const std::vector<Match>& matches() const { return matches_; }

 private:
  State Moved(const State& state, const Vector& step) const {
    State moved = state;
    moved.scan_from_sparse = roomtex::Moved(state.scan_from_sparse, pivot_, step.head<7>());
    moved.bend.coefficients += step.tail<kNumBend>();
    return moved;
  }

  void FindMatches(const State& state) {
    const Eigen::Matrix3d linear =
        state.scan_from_sparse.scale * state.scan_from_sparse.rotation.toRotationMatrix();
    matches_.clear();
    std::vector<double> deviations;
    for (size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d x = state.bend.Bend(state.scan_from_sparse * points_[i].x_in_sparse);
      const auto nearest = surface_.FindNearest(x, std::hypot(kReach, surface_.cell_size()));
      if (!nearest || std::abs(nearest->distance) > kReach) continue;
      const ScanPatch& patch = surface_.patches()[nearest->patch];
      const Eigen::Vector3d normal = linear.transpose() * patch.normal;
      if (!(normal.dot(points_[i].to_cameras) > 0)) continue;
      // The noise of the samples turns the patch, too.
      const double beside2 =
          std::max(0.0, (x - patch.point).squaredNorm() - nearest->distance * nearest->distance);
      const double extent2 = surface_.cell_size() * surface_.cell_size() / 12;
      const double variance =
          normal.dot(points_[i].covariance * normal) +
          patch.thickness * patch.thickness / patch.num_samples * (1 + beside2 / extent2) +
          kSurfaceNoise * kSurfaceNoise;
      matches_.push_back(
          {static_cast<int>(i), nearest->patch, nearest->distance, std::sqrt(variance)});
      deviations.push_back(std::abs(nearest->distance) / matches_.back().sigma);
    }
    inflation_ = std::max(1.0, kSigmaPerMad * Median(deviations));
  }

  void AddMatches(const State& state, Matrix* normal, Vector* gradient) const {
    for (const Match& match : matches_) {
      const ScanPatch& patch = surface_.patches()[match.patch];
      const Eigen::Vector3d q = state.scan_from_sparse * points_[match.point].x_in_sparse;
      const Eigen::Vector3d arm = q - pivot_;
      const double sigma = inflation_ * match.sigma;
      const double root = TukeyRootWeight(match.distance, kGate * sigma);
      if (!(root > 0)) continue;
      const double weight = std::pow(root / sigma, 2);
      Eigen::Matrix<double, 1, kNumUnknowns> jacobian;
      jacobian << patch.normal.transpose(), arm.cross(patch.normal).transpose(),
          patch.normal.dot(arm), patch.normal.transpose() * state.bend.Basis(q);
      normal->selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose(), weight);
      *gradient += weight * match.distance * jacobian.transpose();
    }
    *normal = normal->selfadjointView<Eigen::Lower>();
  }

  // straight: where the pick's place of the scan is in the room.
  std::optional<Eigen::Vector2d> PickError(size_t i, const Similarity& scan_from_sparse,
                                           const Eigen::Vector3d& straight) const {
    const SparseImage* const image = model_.FindImage(picks_[i].image_name);
    const Rigid cam_from_scan = CamFromScan(image->cam_from_model, scan_from_sparse);
    return projections_.at(image->camera_id).ImgError(cam_from_scan * straight, picks_[i].x_in_img);
  }

  // Derivatives of bend.Straighten() by the coefficients, where it gives `straight`. Bend() leaves
  // the pick's place where it is: what the coefficients move it by, `straight` moves it back by.
  static Eigen::Matrix<double, 3, kNumBend> StraightenJacobian(const ScanBend& bend,
                                                               const Eigen::Vector3d& straight) {
    Eigen::Matrix3d by_place;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(k);
      by_place.col(k) = (bend.Bend(straight + step) - bend.Bend(straight - step)) / (2 * kStep);
    }
    Eigen::Matrix<double, 3, kNumBend> by_bend;
    ScanBend moved = bend;
    for (int k = 0; k < kNumBend; ++k) {
      double& coefficient = moved.coefficients[k];
      coefficient = bend.coefficients[k] + kStep;
      by_bend.col(k) = moved.Bend(straight);
      coefficient = bend.coefficients[k] - kStep;
      by_bend.col(k) = (by_bend.col(k) - moved.Bend(straight)) / (2 * kStep);
      coefficient = bend.coefficients[k];
    }
    return -by_place.inverse() * by_bend;
  }

  void AddPicks(const State& state, Matrix* normal, Vector* gradient) const {
    for (size_t i = 0; i < picks_.size(); ++i) {
      if (!used_[i]) continue;
      const Eigen::Vector3d straight = state.bend.Straighten(picks_[i].x_in_scan);
      const auto error = PickError(i, state.scan_from_sparse, straight);
      if (!error) continue;
      bool valid = true;
      const auto difference = [&](const auto& more, const auto& less) -> Eigen::Vector2d {
        valid = valid && more && less;
        return valid ? Eigen::Vector2d((*more - *less) / (2 * kStep)) : Eigen::Vector2d::Zero();
      };
      Eigen::Matrix<double, 2, kNumUnknowns> jacobian;
      for (int k = 0; k < 7; ++k) {
        const Eigen::Matrix<double, 7, 1> step = kStep * Eigen::Matrix<double, 7, 1>::Unit(k);
        const auto moved = [&](double side) {
          return roomtex::Moved(state.scan_from_sparse, pivot_, side * step);
        };
        jacobian.col(k) =
            difference(PickError(i, moved(1), straight), PickError(i, moved(-1), straight));
      }
      Eigen::Matrix<double, 2, 3> by_place;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(k);
        by_place.col(k) = difference(PickError(i, state.scan_from_sparse, straight + step),
                                     PickError(i, state.scan_from_sparse, straight - step));
      }
      jacobian.rightCols<kNumBend>() = by_place * StraightenJacobian(state.bend, straight);
      if (!valid) continue;
      const double sigma_px = pick_sigma_px_ / picks_[i].weight;
      const double deviations = error->norm() / sigma_px;
      const double weight = HuberWeight(deviations, kClickHuber) / (sigma_px * sigma_px);
      *normal += weight * jacobian.transpose() * jacobian;
      *gradient += weight * jacobian.transpose() * *error;
    }
  }

  double SigmaOf(int k) const { return k < ScanBend::kNumRange ? range_sigma_ : azimuth_sigma_; }

  void AddPriors(const State& state, Matrix* normal, Vector* gradient) const {
    const double off = std::log(state.scan_from_sparse.scale / start_.scale);
    (*normal)(6, 6) += 1 / (kScalePrior * kScalePrior);
    (*gradient)[6] += off / (kScalePrior * kScalePrior);
    for (int k = 0; k < kNumBend; ++k) {
      const double weight = 1 / (SigmaOf(k) * SigmaOf(k));
      (*normal)(7 + k, 7 + k) += weight;
      (*gradient)[7 + k] += weight * state.bend.coefficients[k];
    }
  }

  // Expectation maximisation: the variance of the coefficients is the mean of their squares, their
  // own uncertainty included.
  void UpdateVariances(const State& state, const Matrix& covariance) {
    const auto sigma = [&](int first, int count) {
      double sum = 0;
      for (int k = first; k < first + count; ++k) {
        sum += std::pow(state.bend.coefficients[k], 2) + covariance(7 + k, 7 + k);
      }
      return std::clamp(std::sqrt(sum / count), kLeastSigma, kStartSigma);
    };
    range_sigma_ = sigma(0, ScanBend::kNumRange);
    azimuth_sigma_ = sigma(ScanBend::kNumRange, ScanBend::kNumAzimuth);
  }

  const SparseModel& model_;
  const std::vector<SurfacePoint>& points_;
  const ScanPatches& surface_;
  const std::vector<Pick>& picks_;
  const std::vector<bool>& used_;
  const double pick_sigma_px_;
  const Similarity start_;
  std::map<uint32_t, CameraProjection> projections_;
  Eigen::Vector3d pivot_ = Eigen::Vector3d::Zero();
  std::vector<Match> matches_;
  double inflation_ = 1;
  double range_sigma_ = kStartSigma, azimuth_sigma_ = kStartSigma;
};

}  // namespace

std::optional<BendFit> FitScanBend(const SparseModel& model,
                                   const std::vector<SurfacePoint>& points,
                                   const std::vector<Scan>& scans, const ScanPatches& surface,
                                   const std::vector<Pick>& picks, const std::vector<bool>& used,
                                   double pick_sigma_px, const Similarity& start, double min_bend) {
  if (scans.size() != 1 || !scans[0].organised) return std::nullopt;
  State state{start, ScanBend(scans[0])};
  BendSolver solver(model, points, surface, picks, used, pick_sigma_px, start);
  if (!solver.Solve(&state)) return std::nullopt;
  BendFit fit{state.scan_from_sparse, state.bend};
  double sum_bend = 0, sum_straight = 0, sum_bent = 0, sum_range2 = 0;
  for (const auto& match : solver.matches()) {
    const ScanPatch& patch = surface.patches()[match.patch];
    if (std::abs(match.distance) > kGate * match.sigma) continue;
    const Eigen::Vector3d& x_in_sparse = points[match.point].x_in_sparse;
    const Eigen::Vector3d x_in_scan = fit.scan_from_sparse * x_in_sparse;
    sum_bend += (fit.bend.Bend(x_in_scan) - x_in_scan).squaredNorm();
    sum_range2 += (x_in_scan - scans[0].Station()).squaredNorm();
    sum_bent += match.distance * match.distance;
    sum_straight += std::pow(patch.normal.dot(start * x_in_sparse - patch.point), 2);
    ++fit.num_points;
  }
  if (fit.num_points == 0) return std::nullopt;
  fit.bend_rms = std::sqrt(sum_bend / fit.num_points);
  fit.rms_bent = std::sqrt(sum_bent / fit.num_points);
  fit.rms_straight = std::sqrt(sum_straight / fit.num_points);
  if (!(fit.bend_rms > min_bend) || !(sum_bend <= kMaxBend * kMaxBend * sum_range2)) {
    return std::nullopt;
  }
  return fit;
}

}  // namespace roomtex
