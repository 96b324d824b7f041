#pragma once
// Photos whose rows were read one after the other (core/row_motion.h), as they would be had all
// been read with the middle one: what looks at them beside the scan expects that.

#include <opencv2/core/mat.hpp>

#include "align/trust/scan_view.h"
#include "core/row_motion.h"

namespace roomtex {

// photo: any picture of the camera, of any size. camera: that of the view, whose depths say how far
// rows see what is near aside; where the scan shows nothing, its median depth is taken.
cv::Mat WithStillRows(const cv::Mat& photo, const ScanView& view, const LookSetup& camera,
                      const RowMotion& motion);

}  // namespace roomtex
