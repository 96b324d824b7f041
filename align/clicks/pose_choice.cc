#include "align/clicks/pose_choice.h"

#include <algorithm>
#include <limits>

namespace roomtex {
namespace {

constexpr double kClearlySmaller = 0.7;

// Pixels, rms, up to which a pose may be the right one whatever the best one has. Four or five
// picks leave two to four equations over: a wrong pose may fit them by chance, and the right one
// then misses by the noise of the clicks.
double LeastLimit(size_t num_picks) { return num_picks == 4 || num_picks == 5 ? 3.0 : 1.0; }

}  // namespace

PoseChoice ChoosePose(const std::vector<ViewPose>& poses, const ScaleOptions& options,
                      int min_features, const ScaleOfPose& scale_of_pose) {
  PoseChoice choice;
  double best_mad = std::numeric_limits<double>::infinity(), second_mad = best_mad;
  int num_asked = 0;
  const double rms_limit =
      std::max(1.5 * poses[0].rms_px, LeastLimit(static_cast<size_t>(poses[0].residual_px.size())));
  for (size_t i = 0; i < poses.size(); ++i) {
    const ViewPose& pose = poses[i];
    if (pose.rms_px > rms_limit) break;
    ++num_asked;
    ScaleOptions own = options;
    own.edge_px = std::max(own.edge_px, 2 * pose.rms_px);
    const ScaleEstimate scale = scale_of_pose(pose.cam_from_scan, own);
    const double mad =
        scale.num_features >= min_features ? scale.relative_mad : 1e6 + static_cast<double>(i);
    if (i > 0 && !(mad < kClearlySmaller * best_mad)) {
      second_mad = std::min(second_mad, mad);
      continue;
    }
    second_mad = std::min(second_mad, best_mad);
    best_mad = mad;
    choice.scale = scale;
    choice.index = static_cast<int>(i);
  }
  choice.ambiguous = num_asked > 1 && !(best_mad < kClearlySmaller * second_mad);
  return choice;
}

}  // namespace roomtex
