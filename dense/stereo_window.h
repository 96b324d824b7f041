#pragma once
// What stereo compares: the window of one photo around a pixel with what another photo shows of the
// same piece of plane. This is where roomtex-dense spends its time.

#include <array>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

// A photo as stereo sees it.
struct StereoPicture {
  cv::Mat1b grey;
  Camera camera;  // PINHOLE
  Rigid cam_from_scan;
};

// Inverse depth, 1/metres, at a pixel, and its change per pixel to the right and down; w = 0: none.
struct InverseDepthPlane {
  float w = 0, a = 0, b = 0;
  float At(float dx, float dy) const { return w + a * dx + b * dy; }
};
// Of the plane with that normal (unit, towards the camera) at the position x, y. A normal that is
// missing or grazing: one that faces the camera.
InverseDepthPlane PlaneFromNormal(float depth, const Eigen::Vector3f& normal, const Camera& camera,
                                  float x, float y);
// The way back.
Eigen::Vector3f NormalFromPlane(const InverseDepthPlane& plane, const Camera& camera, float x,
                                float y);

// A photo that windows are looked for in.
class StereoSource {
 public:
  // Cameras and pictures of one resolution each; `grey` is that of the source.
  StereoSource(const Camera& reference_camera, const Rigid& reference_cam_from_scan,
               const Camera& source_camera, const Rigid& source_cam_from_scan,
               const cv::Mat1b& grey);

  // Pixels that a place moves here if its inverse depth grows by 1/metre, about.
  float PixelsPerInverseDepth() const { return moved_.head<2>().norm(); }

 private:
  friend class StereoWindow;
  cv::Mat1i quads_;         // a pixel, those right of it, below, and right below: one byte each
  Eigen::Matrix3f turned_;  // pixel of the reference, at infinity, to that of the source
  Eigen::Vector3f moved_;   // times the inverse depth
};

// The window of the reference around one pixel, with bilateral weights.
class StereoWindow {
 public:
  static constexpr int kReachPx = 4;    // to each side
  static constexpr float kNoMatch = 2;  // cost of what a source does not see

  // False if it is too flat.
  bool Set(const cv::Mat1b& grey, int x, int y);
  // 1 - normalised cross-correlation, 0..2, of the plane through the pixel. The same on every
  // processor.
  float Cost(const StereoSource& source, const InverseDepthPlane& plane) const;

 private:
  static constexpr int kSamples = 24;  // every second pixel each way, without the one in the middle

  template <int>
  float CostInLanes(const StereoSource& source, const InverseDepthPlane& plane) const;
  float CostOnAnyProcessor(const StereoSource& source, const InverseDepthPlane& plane) const;
  float CostWithAvx2(const StereoSource& source, const InverseDepthPlane& plane) const;

  float x_ = 0, y_ = 0;  // of the pixel, `img`
  // Shares of the weights, and those times the grey levels without their mean.
  alignas(32) std::array<float, kSamples> weight_{}, weighted_{};
  float variance_ = 0;
};

}  // namespace roomtex
