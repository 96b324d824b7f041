#pragma once
// Which lens model the photos call for. Used by calibration.cc only.

#include <string>
#include <vector>

#include "capture/calibration/calibration.h"

namespace roomtex {

// Fits every model (or the one asked for) to the same photos, corners and weights, from `start`.
//
// Chosen is the simplest model that foretells photos left out as well as any richer one. Each photo
// is predicted by the camera of the others (only the board's pose is fitted to it). A richer model
// is taken when the likelihood of these predictions grows by a factor of e^min_gain. The residuals
// of the fit itself fall with every parameter; an F test or BIC judges that well where corners err
// independently, but the corners of one photo share its blur and the bend of the board, and then
// parameters are taken that only absorb those. For the same reason the likelihood is tempered by
// the scatter between photos (PhotoScatter). BIC stands in the report.
CameraFit ChooseModel(const std::vector<BoardView>& views, const CameraFit& start,
                      const CalibrationOptions& options, std::vector<ModelComparison>* models,
                      std::string* why);

}  // namespace roomtex
