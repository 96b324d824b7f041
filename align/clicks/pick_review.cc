#include "align/clicks/pick_review.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/core.h>

#include "core/decompositions.h"
#include "core/option_fields.h"

namespace roomtex {
namespace {

// With very many picks only the ones with the largest residuals are tried: keeps the search short.
constexpr int kMaxLeftOut = 40;
constexpr int kMaxExchanged = 12;
// An explanation (mirrored, exchanged) explains only if the picks then miss by less than this share
// of the photo's diagonal.
constexpr double kMaxExplainedShare = 0.015;

double DiagonalOf(const Camera& camera) { return std::hypot(camera.width, camera.height); }

// The largest distance of any point from the line through the two points that are farthest apart
// along the first principal axis, and the length of that line, metres.
struct LineFit {
  double width = 0, length = 0;
};
LineFit FitLine(const Eigen::Matrix3Xd& points) {
  const Eigen::Vector3d centre = points.rowwise().mean();
  const Eigen::Matrix3Xd centred = points.colwise() - centre;
  const Eigen::Vector3d axis = RightSingularVectors(centred.transpose()).col(0);
  const Eigen::RowVectorXd along = axis.transpose() * centred;
  LineFit fit;
  fit.length = along.maxCoeff() - along.minCoeff();
  fit.width = (centred - axis * along).colwise().norm().maxCoeff();
  return fit;
}

bool IsCollinear(const Eigen::Matrix3Xd& points, double min_line_share) {
  const Eigen::Vector3d extents = PrincipalExtents(points);
  return !(extents[1] > min_line_share * extents[0]) || !(extents[0] > 0);
}

std::vector<int> ByResidual(const Eigen::VectorXd& residual_px, int limit) {
  std::vector<int> order(residual_px.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return residual_px[a] > residual_px[b]; });
  if (static_cast<int>(order.size()) > limit) order.resize(limit);
  std::sort(order.begin(), order.end());
  return order;
}

PointPairs Selected(const PointPairs& pairs, const std::vector<int>& indices) {
  const int n = static_cast<int>(indices.size());
  PointPairs selected{Eigen::Matrix2Xd(2, n), Eigen::Matrix3Xd(3, n)};
  for (int i = 0; i < n; ++i) {
    selected.x_in_img.col(i) = pairs.x_in_img.col(indices[i]);
    selected.x_in_scan.col(i) = pairs.x_in_scan.col(indices[i]);
  }
  if (pairs.weight.size() > 0) {
    selected.weight.resize(n);
    for (int i = 0; i < n; ++i) selected.weight[i] = pairs.weight[indices[i]];
  }
  return selected;
}

struct LeaveOneOut {
  // One per pick; infinite where the rest has no pose, NaN where not tried.
  Eigen::VectorXd distance_px;
  Eigen::VectorXd sum_px2;  // of the rest; NaN where it has no pose
  int best = -1;            // pick without which the others fit best
  double best_sum_px2 = std::numeric_limits<double>::infinity();
};

LeaveOneOut TryWithoutEach(const PoseSolver& solver, const PointPairs& pairs, const ViewPose& all,
                           const PickReviewOptions& options) {
  LeaveOneOut result;
  result.distance_px = result.sum_px2 = Eigen::VectorXd::Constant(pairs.size(), std::nan(""));
  for (const int i : ByResidual(all.residual_px, kMaxLeftOut)) {
    const PointPairs rest = pairs.Without(i);
    if (IsCollinear(rest.x_in_scan, options.min_line_share)) continue;
    const auto poses = solver.Solve(rest, all);
    if (poses.empty()) continue;
    result.distance_px[i] = solver.Residuals(pairs, poses[0])[i];
    result.sum_px2[i] = poses[0].sum_px2;
    if (poses[0].sum_px2 < result.best_sum_px2) {
      result.best_sum_px2 = poses[0].sum_px2;
      result.best = i;
    }
  }
  return result;
}

void FindExchanged(const PoseSolver& solver, const PointPairs& pairs,
                   const PickReviewOptions& options, PickReview* review) {
  const double rms_px = review->RmsPx();
  if (rms_px < 0.5 * options.min_bad_pick_px) return;  // nothing to be explained
  const std::vector<int> candidates = ByResidual(review->residual_px, kMaxExchanged);
  for (const int i : candidates) {
    for (const int j : candidates) {
      if (j <= i) continue;
      PointPairs exchanged = pairs;
      exchanged.x_in_img.col(i).swap(exchanged.x_in_img.col(j));
      const auto poses = solver.Solve(exchanged, std::nullopt);
      if (poses.empty() || !(poses[0].rms_px < review->exchanged_rms_px)) continue;
      review->exchanged_rms_px = poses[0].rms_px;
      review->exchanged = {i, j};
    }
  }
  if (!IsExplained(rms_px, review->exchanged_rms_px, DiagonalOf(solver.camera()), options)) {
    review->exchanged.reset();
  }
}

// Leaves out bad picks one after the other; gives the indices of those that stay.
std::vector<int> LeaveOutBadPicks(const PoseSolver& solver, const PointPairs& pairs,
                                  const PickReviewOptions& options, PickReview* review) {
  std::vector<int> kept(pairs.size());
  std::iota(kept.begin(), kept.end(), 0);
  for (int left_out = 0; review->HasPose(); ++left_out) {
    const PointPairs current = Selected(pairs, kept);
    const LeaveOneOut trial = TryWithoutEach(solver, current, review->pose(), options);
    for (size_t k = 0; k < kept.size(); ++k) {
      review->leave_one_out_px[kept[k]] = trial.distance_px[k];
      review->without_px2[kept[k]] = trial.sum_px2[k];
    }
    const int n = current.size();
    if (review->exchanged || left_out >= pairs.size() / 6 || n < 6 || trial.best < 0) break;
    if (!(trial.distance_px[trial.best] > options.min_bad_pick_px)) break;
    const double chance =
        ChanceOfGain(review->pose().sum_px2, trial.best_sum_px2, n, solver.num_unknowns());
    if (chance > options.max_chance) break;
    review->used[kept[trial.best]] = false;
    kept.erase(kept.begin() + trial.best);
    review->poses = solver.Solve(Selected(pairs, kept), review->pose());
  }
  return kept;
}

}  // namespace

double ChanceOfGain(double all, double rest, int n, int num_unknowns) {
  if (!(all > 0)) return 1;
  return n * std::pow(rest / all, 0.5 * (2 * n - num_unknowns - 2));
}

void PickReviewOptions::Declare(OptionFields* fields) {
  fields
      ->Number("Picks.max_chance", &max_chance,
               "A pick is left out when chance makes one as bad less often than this; larger = "
               "leaves out more easily.")
      .Between(0, 1);
  fields
      ->Number("Picks.min_bad_pick_px", &min_bad_pick_px,
               "Pixels; a pick nearer than this to where the others put it is never left out.")
      .NotNegative();
  fields
      ->Number(
          "Picks.min_gain", &min_gain,
          "A mirrored scan or two exchanged picks must fit this many times better to be named.")
      .Above(1);
  fields
      ->Number("Picks.min_line_share", &min_line_share,
               "Picks whose second extent in the scan is below this share of the first lie on a "
               "line; larger = stricter.")
      .AtLeast(0)
      .Below(1);
  fields
      ->Number("Picks.min_photo_share", &min_photo_share,
               "Picks whose second extent in the photo is below this share of its diagonal lie on "
               "one spot or line; larger = stricter.")
      .AtLeast(0)
      .Below(1);
}

std::vector<std::string> PickReviewOptions::Problems() const { return ProblemsOf(*this); }

bool IsExplained(double rms_px, double explained_rms_px, double diagonal_px,
                 const PickReviewOptions& options) {
  return rms_px > 0.5 * options.min_bad_pick_px && explained_rms_px * options.min_gain < rms_px &&
         explained_rms_px < kMaxExplainedShare * diagonal_px;
}

std::string FindLayoutProblem(const PointPairs& pairs, const Camera& camera,
                              const PickReviewOptions& options) {
  const double diagonal = std::hypot(camera.width, camera.height);
  const Eigen::Vector2d centre = pairs.x_in_img.rowwise().mean();
  const double spread = std::sqrt((pairs.x_in_img.colwise() - centre).squaredNorm() / pairs.size());
  if (!(spread > options.min_photo_share * diagonal)) {
    return fmt::format(
        "the picks lie within {:.2f} pixels of one spot of the photo ({:.2f} pixels across), which "
        "does not fix the camera's pose",
        spread, diagonal);
  }
  if (IsCollinear(pairs.x_in_scan, options.min_line_share)) {
    const LineFit line = FitLine(pairs.x_in_scan);
    return fmt::format(
        "the picks lie on one straight line: {:.3f} m long, none farther than {:.3f} m beside it, "
        "around which the camera could turn freely",
        line.length, line.width);
  }
  for (int i = 0; i < pairs.size(); ++i) {
    const Eigen::Matrix3Xd others = pairs.Without(i).x_in_scan;
    if (!IsCollinear(others, options.min_line_share)) continue;
    const LineFit line = FitLine(others);
    return fmt::format(
        "all picks but one lie on one straight line: {:.3f} m long, none farther than {:.3f} m "
        "beside it, so that several camera poses fit equally well",
        line.length, line.width);
  }
  return "";
}

PickReview ReviewPicks(const CameraProjection& projection, const PointPairs& pairs,
                       const PickReviewOptions& options) {
  return ReviewPicks(ViewPoseSolver(projection), pairs, options);
}

PickReview ReviewPicks(const PoseSolver& solver, const PointPairs& pairs,
                       const PickReviewOptions& options) {
  PickReview review;
  review.used.assign(pairs.size(), true);
  review.poses = solver.Solve(pairs, std::nullopt);
  review.residual_px =
      review.HasPose()
          ? review.pose().residual_px
          : Eigen::VectorXd::Constant(pairs.size(), std::numeric_limits<double>::infinity());
  review.leave_one_out_px = review.without_px2 =
      Eigen::VectorXd::Constant(pairs.size(), std::nan(""));
  FindExchanged(solver, pairs, options, &review);
  const std::vector<int> kept = LeaveOutBadPicks(solver, pairs, options, &review);
  if (review.HasPose()) review.residual_px = solver.Residuals(pairs, review.pose());
  const auto mirrored = solver.Solve(Selected(pairs, kept).Mirrored(), std::nullopt);
  if (!mirrored.empty()) review.mirrored_rms_px = mirrored[0].rms_px;
  review.mirrored =
      IsExplained(review.RmsPx(), review.mirrored_rms_px, DiagonalOf(solver.camera()), options);
  return review;
}

}  // namespace roomtex
