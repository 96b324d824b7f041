#pragma once
// Photos whose rows are read one after the other while a hand moves the camera (rolling shutter).

#include <cstdint>
#include <map>
#include <optional>

#include "align/alignment_fit.h"
#include "align/alignment_input.h"
#include "colmap_ext/sparse_model.h"
#include "core/row_motion.h"

namespace roomtex {

struct RollingShutter {
  // The input's model, in its frame, had all rows of a photo been read with the middle one: poses,
  // points and keypoints of points.
  SparseModel model;
  std::vector<Pick> picks;  // the input's, in the same way
  RowMotions motions;       // by image_id, metres; how each photo's camera moved
  // Of the photos' observations after an adjustment to the surface (SharedImageCost()), with
  // cameras that stand still and that move.
  double cost_still = 0, cost_moving = 0;
  // The model's cameras are not the input's, but what explains the photos better.
  bool freed = false;

  double MedianTurn() const;  // radians, from the first row to the last
  double MedianMove() const;  // metres
};

// Nothing where motion does not clearly explain the photos better: then it is no rolling shutter,
// and would only take up what is wrong elsewhere. Less is enough where the model then has the shape
// of the scan. A lens that photos with moving rows found is not that of the still ones: it is found
// anew where that explains the photos better, unless lenses are never to be refined. still: the fit
// adjusted without motion, by AdjustModel(); where the scan is taken for bent, motion must explain
// much more than that.
std::optional<RollingShutter> FindRollingShutter(const AlignmentInput& input,
                                                 const AlignmentStart& start,
                                                 const AlignmentFit& fit, const LensCheck& lenses,
                                                 const ModelAdjustment& still,
                                                 const AlignmentOptions& options);

}  // namespace roomtex
