#pragma once
// The sparse model into the scan: a start (start.h), fitted to the surface (alignment_fit.h), and
// judged (judgement.h).

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "align/alignment_fit.h"
#include "align/alignment_input.h"
#include "align/corner_adjustment.h"
#include "align/judgement.h"
#include "align/pick_findings.h"
#include "align/rolling_shutter.h"
#include "align/start.h"
#include "colmap_ext/lens_check.h"
#include "core/progress.h"

namespace roomtex {

struct Alignment {
  // The answer: from the input model to the aligned one, and of an adjusted model the best
  // similarity there is. Of a bent scan: to where the room really is.
  Similarity scan_from_sparse;
  // What the photos say of the lenses. lenses.mended, if there is one, is the model that was
  // aligned in the input's place.
  LensCheck lenses;
  std::map<uint32_t, Camera> told_cameras;  // of the model that was aligned
  AlignmentStart start;                     // before the refinement on the surface
  AlignmentFit fit;
  // The adjustment to the surface, tried where the similarity is refined and trusted.
  // adjustment.bundle.model is the answer if adjusted().
  ModelAdjustment adjustment;
  // Photos whose rows were read one after the other: what was aligned is the model as it would be
  // had they been read at once, and so are the keypoints of adjustment.bundle.model.
  std::optional<RollingShutter> rolling_shutter;
  CornerAdjustment corners;  // where model and scan differ in shape
  // Of the picks, where the sparse points lie on the surface (in the adjusted model, if there is
  // one), pixels; see AlignmentFit.
  std::vector<double> refined_pick_px;
  double refined_pick_rms_px = std::numeric_limits<double>::quiet_NaN();
  ExpectedError expected_error;                 // at_cameras and rotation: medians of photo_sigmas
  std::map<uint32_t, PhotoSigma> photo_sigmas;  // by image_id
  ShapeDisagreement disagreement;               // what no similarity and no bend takes away
  OpenDirections open;
  Placement placement;
  double reprojection_rms_px = 0;  // of the input model
  std::vector<std::string> warnings;
  // Why the answer is not to be trusted, in sentences; empty = trusted.
  std::vector<std::string> reasons;

  bool adjusted() const { return adjustment.bundle.usable; }
};

// By the picks. Throws InputError for picks that cannot fix a pose, Contradiction for picks that
// are exchanged, not on the scan, of another photo, or show that the scan is mirrored.
Alignment AlignToScan(const AlignmentInput& input, const AlignmentOptions& options,
                      Progress* progress);

// From a start that was found otherwise, with any number of picks, also none. `start` must be of
// this model and of these picks.
Alignment AlignToScan(const AlignmentInput& input, const AlignmentStart& start,
                      const AlignmentOptions& options, Progress* progress);

}  // namespace roomtex
