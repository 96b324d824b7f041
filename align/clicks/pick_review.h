#pragma once
// What is wrong with the picks of one photo: lying on a line, one of them far off, two exchanged,
// all of them mirrored. Says what it finds; the command decides (trust.h). Geodesy calls the search
// for bad picks data snooping (Baarda 1968, "A Testing Procedure for Use in Geodetic Networks").

#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "align/clicks/view_pose.h"

namespace roomtex {

class OptionFields;

struct PickReviewOptions {
  // A pick is left out as bad when residuals as large as its own would come by chance less often
  // than this, given the other picks (F test, corrected for the number of picks). Larger = leaves
  // out more easily.
  double max_chance = 0.01;
  // Pixels; a pick whose distance from the pose of the other picks is smaller than this is never
  // left out.
  double min_bad_pick_px = 4.0;
  // Scan points (photo points) whose second extent is below this share of the first (of the photo's
  // diagonal) are collinear (clustered). Larger = stricter.
  double min_line_share = 0.02;
  double min_photo_share = 0.015;
  // The mirrored scan, or two exchanged picks, must fit this many times better (rms) to be named.
  double min_gain = 2.0;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// One sentence about picks that cannot fix a pose: on one straight line (also all but one of them),
// or on one spot of the photo; empty if they can.
std::string FindLayoutProblem(const PointPairs& pairs, const Camera& camera,
                              const PickReviewOptions& options);

// Whether an explanation (mirrored, exchanged) that lets the picks miss by explained_rms_px instead
// of rms_px is worth naming: clearly better, and good for a photo of this diagonal.
bool IsExplained(double rms_px, double explained_rms_px, double diagonal_px,
                 const PickReviewOptions& options);

struct PickReview {
  // Locally best poses from the picks that are used, best first; empty if no pose has all of them
  // in front.
  std::vector<ViewPose> poses;
  std::vector<bool> used;       // one per pick
  Eigen::VectorXd residual_px;  // of every pick, under poses[0]
  // Distance of every pick from the pose that the other used picks give.
  Eigen::VectorXd leave_one_out_px;
  // How well the other used picks fit without it, sum of squares: the smaller, the more it is this
  // one that is wrong. NaN where not tried.
  Eigen::VectorXd without_px2;
  // Two picks that fit min_gain times better when they exchange their places in the photo.
  std::optional<std::pair<int, int>> exchanged;
  double exchanged_rms_px = std::numeric_limits<double>::infinity();
  // Root mean square residual of the used picks when x of the scan is mirrored, and whether that is
  // so much better that the scan must be mirrored. Coplanar picks cannot tell: they fit either way.
  double mirrored_rms_px = std::numeric_limits<double>::infinity();
  bool mirrored = false;

  bool HasPose() const { return !poses.empty(); }
  const ViewPose& pose() const { return poses.front(); }  // only if HasPose()
  double RmsPx() const {
    return HasPose() ? pose().rms_px : std::numeric_limits<double>::infinity();
  }
};

// Chance that leaving out the best of n picks lowers the sum of squares from `all` to `rest`
// although all picks are equally good: F test with 2 and nu = 2 n - unknowns - 2 degrees of
// freedom, whose tail is (rest / all)^(nu / 2), times n for the choice of the best (Bonferroni).
double ChanceOfGain(double all, double rest, int n, int num_unknowns);

// pairs: at least 6 that have no layout problem. One in six may be bad and is found by leaving out
// each in turn.
PickReview ReviewPicks(const CameraProjection& projection, const PointPairs& pairs,
                       const PickReviewOptions& options);
PickReview ReviewPicks(const PoseSolver& solver, const PointPairs& pairs,
                       const PickReviewOptions& options);

}  // namespace roomtex
