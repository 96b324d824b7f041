#pragma once
// Where a photo is transparent (a mask, a thing cut out, the border of an undistorted picture) it
// shows nothing, whatever colours its file has there.

#include <string>

#include <opencv2/core/mat.hpp>

#include "align/trust/scan_view.h"
#include "colmap_ext/sparse_model.h"
#include "core/camera_model.h"

namespace roomtex {

// 255 where the photo of an image is not opaque, else 0, in its camera's pixels; empty if it is
// opaque everywhere or cannot be read (which who reads its colours says).
cv::Mat1b ReadTransparencyOf(const SparseImage& image, const Camera& camera,
                             const std::string& image_path);

// Makes cells of the view invalid that the photo does not show or that lie within eight pixels of
// such, as texture has it, and marks them as unseen. transparent: in the pixels of the view's
// camera; an empty one changes nothing.
void LeaveOutTransparent(const cv::Mat1b& transparent, ScanView* view);

}  // namespace roomtex
