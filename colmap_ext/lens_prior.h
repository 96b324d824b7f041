#pragma once
// What is known of a lens before the photos are asked.

#include <Eigen/Core>

#include "core/camera_model.h"

namespace roomtex {

// Residuals of a lens in standard deviations: LensPrior(told) * (params - told.params). Weak, so
// that the photos decide what they see, but it keeps what they say nothing about: the focal length
// within 20 %, square pixels (fx / fy as told) within 0.2 %, the principal point within 1 % of the
// photo's longer side, as lenses stand over their sensors, radial distortion within 0.1 and
// tangential within 0.003. With hold_centre, principal point and tangential distortion stay as
// told: few photos do not tell them from turns of the camera.
Eigen::MatrixXd LensPrior(const Camera& told, bool hold_centre = false);

}  // namespace roomtex
