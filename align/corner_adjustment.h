#pragma once
// Where sparse model and scan differ in shape (a scan put together of drifting parts, photos of a
// rolling shutter), points on surfaces hold the model as a whole, but single photos are centimetres
// and degrees off. Corners of the scan's intensity hold each photo that shows them.

#include <limits>

#include "align/alignment_fit.h"
#include "align/alignment_input.h"
#include "align/start.h"
#include "colmap_ext/lens_check.h"

namespace roomtex {

struct CornerAdjustment {
  int num_corners = 0, num_photos = 0;  // found
  // Median distance of corners from where the photos show them, pixels: of every other one, before
  // and after an adjustment by the rest.
  double held_out_before_px = std::numeric_limits<double>::quiet_NaN();
  double held_out_after_px = std::numeric_limits<double>::quiet_NaN();
  // How alike photos show the scan, see PhotoComparison; before and after that by all corners.
  double correlation_before = std::numeric_limits<double>::quiet_NaN();
  double correlation_after = std::numeric_limits<double>::quiet_NaN();
  // The corners agree with each other, with the sparse model, and with what the photos show of each
  // other, so that all of them hold the photos.
  bool used = false;
};

// adjustment: by points on surfaces and picks; replaced if the corners are used. Nothing is found
// without input.image_path.
CornerAdjustment AdjustByCorners(const AlignmentInput& input, const AlignmentStart& start,
                                 const AlignmentFit& fit, const LensCheck& lenses,
                                 const AlignmentOptions& options, ModelAdjustment* adjustment);

}  // namespace roomtex
