#include "align/fit/spread_picks.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "align/fit/ray_similarity.h"

namespace roomtex {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// Starts that are refined on the clicks: more minima than these have not been seen.
constexpr size_t kMaxStarts = 4;
constexpr int kUnknowns = 7;
// Pixels; in the least squares no click counts less for being far off: who is bad is found by
// leaving it out.
constexpr double kNoHuber = 1e6;
constexpr size_t kMaxLeftOut = 40;  // with very many picks only the farthest are tried

std::vector<int> Indices(const std::vector<bool>& used) {
  std::vector<int> indices;
  for (size_t i = 0; i < used.size(); ++i) {
    if (used[i]) indices.push_back(static_cast<int>(i));
  }
  return indices;
}

// Picks over photos of a model, solved again and again with some of them left out.
class SpreadProblem {
 public:
  SpreadProblem(const SparseModel& model, const std::vector<Pick>& picks,
                const SimilarityFitOptions& options)
      : model_(model), picks_(picks), options_(options) {
    std::map<uint32_t, CameraProjection> projections;
    const auto n = static_cast<Eigen::Index>(picks.size());
    rays_ = {Eigen::Matrix3Xd(3, n), Eigen::Matrix3Xd(3, n), Eigen::Matrix3Xd(3, n)};
    for (Eigen::Index i = 0; i < n; ++i) {
      const SparseImage& image = *model.FindImage(picks[i].image_name);
      const auto at =
          projections.try_emplace(image.camera_id, model.cameras.at(image.camera_id)).first;
      const auto ray_in_cam = at->second.RayFromImg(picks[i].x_in_img);
      has_ray_.push_back(ray_in_cam.has_value());
      const Eigen::Vector3d ray = ray_in_cam.value_or(Eigen::Vector3d::UnitZ());
      rays_.origins.col(i) = image.cam_from_model.TargetOriginInSource();
      rays_.directions.col(i) = image.cam_from_model.rotation.conjugate() * ray.normalized();
      rays_.x_in_scan.col(i) = picks[i].x_in_scan;
    }
  }

  struct Solution {
    SimilarityFit fit;
    double sum_px2 = 0;  // weighted
  };

  // Best first.
  std::vector<Solution> Solve(const std::vector<bool>& used) const {
    std::vector<Similarity> starts = SolveRaySimilarities(Chosen(used));
    if (starts.size() > kMaxStarts) starts.resize(kMaxStarts);
    std::vector<Solution> solutions;
    for (const Similarity& start : starts) {
      Solution solution;
      solution.fit = FitToPicks(model_, picks_, used, kNoHuber, start, options_, kNoScalePrior);
      solution.sum_px2 = SumOfSquares(solution.fit.scan_from_sparse, used);
      if (!solution.fit.converged || !std::isfinite(solution.sum_px2)) continue;
      const bool known =
          std::any_of(solutions.begin(), solutions.end(), [&](const Solution& other) {
            return RotationAngle(other.fit.scan_from_sparse.rotation,
                                 solution.fit.scan_from_sparse.rotation) < 1e-4;
          });
      if (!known) solutions.push_back(solution);
    }
    std::stable_sort(solutions.begin(), solutions.end(),
                     [](const Solution& a, const Solution& b) { return a.sum_px2 < b.sum_px2; });
    return solutions;
  }

  double DistanceOf(int pick, const Similarity& scan_from_sparse) const {
    return PickErrors(model_, {picks_[pick]}, scan_from_sparse).norm();
  }

 private:
  RaysToScan Chosen(const std::vector<bool>& used) const {
    std::vector<int> indices;
    for (const int i : Indices(used)) {
      if (has_ray_[i]) indices.push_back(i);
    }
    const auto n = static_cast<Eigen::Index>(indices.size());
    RaysToScan chosen{Eigen::Matrix3Xd(3, n), Eigen::Matrix3Xd(3, n), Eigen::Matrix3Xd(3, n)};
    for (Eigen::Index i = 0; i < n; ++i) {
      chosen.origins.col(i) = rays_.origins.col(indices[i]);
      chosen.directions.col(i) = rays_.directions.col(indices[i]);
      chosen.x_in_scan.col(i) = rays_.x_in_scan.col(indices[i]);
    }
    return chosen;
  }

  double SumOfSquares(const Similarity& scan_from_sparse, const std::vector<bool>& used) const {
    const Eigen::Matrix2Xd errors = PickErrors(model_, picks_, scan_from_sparse);
    double sum = 0;
    for (const int i : Indices(used)) {
      sum += std::pow(picks_[i].weight, 2) * errors.col(i).squaredNorm();
    }
    return sum;
  }

  const SparseModel& model_;
  const std::vector<Pick>& picks_;
  const SimilarityFitOptions options_;
  RaysToScan rays_;
  std::vector<bool> has_ray_;
};

double SumOfWeights(const std::vector<Pick>& picks, const std::vector<bool>& used) {
  double sum = 0;
  for (const int i : Indices(used)) sum += std::pow(picks[i].weight, 2);
  return sum;
}

using Solutions = std::vector<SpreadProblem::Solution>;

// The pick without which the others fit best, and how well; fills leave_one_out_px. At least one
// equation must be left over.
struct BestWithout {
  int pick = -1;
  double sum_px2 = std::numeric_limits<double>::infinity();
  Solutions solutions;
};
BestWithout TryWithoutEach(const SpreadProblem& problem, const Similarity& all,
                           SpreadPickFit* result) {
  BestWithout best;
  std::vector<int> indices = Indices(result->used);
  const int n = static_cast<int>(indices.size());
  if (2 * (n - 1) <= kUnknowns) return best;
  if (indices.size() > kMaxLeftOut) {
    std::stable_sort(indices.begin(), indices.end(), [&](int a, int b) {
      return problem.DistanceOf(a, all) > problem.DistanceOf(b, all);
    });
    indices.resize(kMaxLeftOut);
  }
  for (const int i : indices) {
    std::vector<bool> rest = result->used;
    rest[i] = false;
    Solutions solutions = problem.Solve(rest);
    if (solutions.empty()) continue;
    result->leave_one_out_px[i] = problem.DistanceOf(i, solutions[0].fit.scan_from_sparse);
    result->without_px2[i] = solutions[0].sum_px2;
    if (!(solutions[0].sum_px2 < best.sum_px2)) continue;
    best = {i, solutions[0].sum_px2, std::move(solutions)};
  }
  return best;
}

// Leaves out bad picks one after the other.
Solutions LeaveOutBadPicks(const SpreadProblem& problem, const PickReviewOptions& options,
                           SpreadPickFit* result) {
  Solutions solutions = problem.Solve(result->used);
  const int num_on = static_cast<int>(Indices(result->used).size());
  for (int left_out = 0; left_out <= num_on / 6; ++left_out) {
    const int n = static_cast<int>(Indices(result->used).size());
    const Similarity all = solutions.empty() ? Similarity() : solutions[0].fit.scan_from_sparse;
    BestWithout best = TryWithoutEach(problem, all, result);
    if (left_out == num_on / 6 || n < kMinPicksPerPhoto || best.pick < 0) break;
    if (!(result->leave_one_out_px[best.pick] > options.min_bad_pick_px)) break;
    const double chance =
        solutions.empty() ? 0 : ChanceOfGain(solutions[0].sum_px2, best.sum_px2, n, kUnknowns);
    if (chance > options.max_chance) break;
    result->used[best.pick] = false;
    solutions = std::move(best.solutions);
  }
  return solutions;
}

void FindMirrored(const SparseModel& model, std::vector<Pick> picks,
                  const PickReviewOptions& options, const SimilarityFitOptions& fit,
                  SpreadPickFit* result) {
  const double rms_px =
      result->HasFit() ? result->rms_px[0] : std::numeric_limits<double>::infinity();
  if (!(rms_px > 0.5 * options.min_bad_pick_px)) return;  // nothing to be explained
  for (Pick& pick : picks) pick.x_in_scan.x() *= -1;
  const Solutions mirrored = SpreadProblem(model, picks, fit).Solve(result->used);
  if (mirrored.empty()) return;
  result->mirrored_rms_px = std::sqrt(mirrored[0].sum_px2 / SumOfWeights(picks, result->used));
  double diagonal = 0;
  for (const Pick& pick : picks) {
    const Camera& camera = model.cameras.at(model.FindImage(pick.image_name)->camera_id);
    diagonal = std::max(diagonal, std::hypot(camera.width, camera.height));
  }
  result->mirrored = IsExplained(rms_px, result->mirrored_rms_px, diagonal, options);
}

std::string LayoutProblemOf(const std::vector<Pick>& picks, const std::vector<bool>& used,
                            const PickReviewOptions& options) {
  const std::vector<int> indices = Indices(used);
  Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(indices.size()));
  for (size_t i = 0; i < indices.size(); ++i) {
    points.col(static_cast<Eigen::Index>(i)) = picks[indices[i]].x_in_scan;
  }
  const Eigen::Vector3d extents = PrincipalExtents(points);
  if (extents[1] > options.min_line_share * extents[0]) return "";
  return "the picks of all photos lie on one straight line, around which the model could turn "
         "freely";
}

}  // namespace

bool AreSpreadPicks(const std::vector<Pick>& picks) {
  std::set<std::string> names;
  int num_on = 0;
  for (const Pick& pick : picks) {
    if (!(pick.weight > 0)) continue;
    ++num_on;
    names.insert(pick.image_name);
  }
  return num_on >= kMinPicksPerPhoto && names.size() > 1;
}

SpreadPickFit FitSpreadPicks(const SparseModel& model, const std::vector<Pick>& picks,
                             const PickReviewOptions& options, const SimilarityFitOptions& fit) {
  SpreadPickFit result;
  for (const Pick& pick : picks) result.used.push_back(pick.weight > 0);
  result.leave_one_out_px.assign(picks.size(), kNan);
  result.without_px2.assign(picks.size(), kNan);
  result.layout_problem = LayoutProblemOf(picks, result.used, options);
  if (!result.layout_problem.empty()) return result;
  const SpreadProblem problem(model, picks, fit);
  const Solutions solutions = LeaveOutBadPicks(problem, options, &result);
  const double sum_of_weights = SumOfWeights(picks, result.used);
  for (const SpreadProblem::Solution& solution : solutions) {
    result.fits.push_back(solution.fit);
    result.rms_px.push_back(std::sqrt(solution.sum_px2 / sum_of_weights));
  }
  if (result.HasFit()) {
    const int redundancy = 2 * static_cast<int>(Indices(result.used).size()) - kUnknowns;
    result.sigma_px = ClickSigma(solutions[0].sum_px2, redundancy);
    const double variance = std::pow(result.sigma_px / kNoHuber, 2);
    for (SimilarityFit& one : result.fits) one.covariance *= variance;
  }
  FindMirrored(model, picks, options, fit, &result);
  return result;
}

}  // namespace roomtex
