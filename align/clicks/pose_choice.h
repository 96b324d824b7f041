#pragma once
// Which of several poses that fit the picks is the photo's: the one that also makes sense of the
// sparse points, one scale for all of them.

#include <functional>
#include <vector>

#include "align/clicks/scale.h"
#include "align/clicks/view_pose.h"

namespace roomtex {

struct PoseChoice {
  int index = 0;  // into the poses
  ScaleEstimate scale;
  // Another pose makes about as good sense of the sparse points, or there are too few of them.
  bool ambiguous = false;
};

using ScaleOfPose = std::function<ScaleEstimate(const Rigid&, const ScaleOptions&)>;

// poses: best first, at least one. Those that miss the picks by more than 1.5 times the rms of the
// first (or a pixel; of four or five picks, three pixels) are not asked. A pose other than the
// first must have a clearly smaller spread of the scale; with fewer than min_features features a
// scale says nothing.
PoseChoice ChoosePose(const std::vector<ViewPose>& poses, const ScaleOptions& options,
                      int min_features, const ScaleOfPose& scale_of_pose);

}  // namespace roomtex
