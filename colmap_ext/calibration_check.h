#pragma once
// Whether the cameras' intrinsics fit their photos. With a wrong lens a room looks bent, and before
// a wall nothing contradicts it: poses and points take up what the lens leaves over, and the errors
// only grow a little. They shrink again when the lens may change, and that is measured.

#include <algorithm>
#include <functional>
#include <string>

#include "colmap_ext/sparse_model.h"

namespace roomtex {

struct CalibrationCheck {
  // Root mean square reprojection error, pixels, of the same observations after bundle adjustment
  // with the intrinsics as they are, and with focal length and distortion free.
  double rms_fixed_px = 0, rms_free_px = 0;
  // Redundancy of the adjustment with fixed intrinsics: residuals less unknowns.
  double redundancy = 0;

  // Of the error, the share that the lens explains.
  double Gain() const { return rms_fixed_px > 0 ? 1 - rms_free_px / rms_fixed_px : 0; }
  // From which gain on the intrinsics do not fit. On a real kitchen, calibrated to about a pixel,
  // it is below 0.03; for a lens with k1 = -0.12 that nobody told, 0.2 to 0.3. Few observations can
  // be bent to anything: noise alone gives half the number of free parameters over the redundancy.
  double MaxGain() const { return 0.1 + 3 * 6 / std::max(redundancy, 1.0); }
  bool Fits() const { return Gain() <= MaxGain(); }
};

// The camera as OPENCV, if it is a pinhole or has one or two radial parameters; others stay.
Camera RicherCamera(const Camera& camera);
// Every camera in a model that can describe what its own cannot: OPENCV for pinholes and for one or
// two radial parameters; others stay.
SparseModel WithRicherCameras(const SparseModel& model);

// At least `per_image` points of every image (all of those that see fewer), those of most images
// first, of a point no more than a dozen observations, in the images that have fewest: enough for a
// few parameters, and the time grows as the number of images.
SparseModel ThinnedModel(const SparseModel& model, int per_image);

// adjust: bundle adjustment of poses and points, and of the intrinsics if asked.
using AdjustModel = std::function<SparseModel(const SparseModel& model, bool refine_intrinsics)>;
CalibrationCheck CheckCalibration(const SparseModel& model, const AdjustModel& adjust);

}  // namespace roomtex
