#pragma once
// Depth of a photo where the scan has none, by PatchMatch multi-view stereo with slanted windows:
// Bleyer, Rhemann and Rother 2011, "PatchMatch Stereo"; propagation on a chequerboard as in
// Galliani, Lasinger and Schindler 2015, "Massively Parallel Multiview Stereopsis by Surface Normal
// Diffusion". The scan bounds it: only space that no scanner saw is searched, and the surfaces
// beside a hole are what is tried first.

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/camera_model.h"
#include "core/similarity.h"
#include "dense/scan_space.h"

namespace roomtex {

class OptionFields;

struct PatchMatchOptions {
  // Photos that each photo is compared with: at half the resolution with all of them, then, place
  // by place, with the four that correlate best. More = more complete, slower.
  int num_sources = 8;
  // Rounds of propagation and refinement per level of resolution. More = slower.
  int num_iterations = 3;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// A photo as stereo sees it.
struct StereoPicture {
  cv::Mat1f grey;  // 0..255
  Camera camera;   // PINHOLE
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

// Where along the rays of a photo something may be that the scan does not have.
class OpenSpace {
 public:
  // margin: metres that it must be away from the scan's surface, and from what was seen empty;
  // gaps that are less than four times as wide are not searched.
  OpenSpace(const ScanSpace& space, const StereoPicture& picture, double margin, int num_threads);

  // Metres along the optical axis, 0 = none; and its normals (colmap_ext/dense_workspace.h).
  const cv::Mat1f& scan_depth() const { return scan_depth_; }
  const std::vector<cv::Mat1f>& scan_normals() const { return scan_normals_; }

  static constexpr int kBins = 64;  // of the inverse depth
  // One bit per bin that is open, for a position as share of the picture's width and height.
  uint64_t BinsAt(double x_share, double y_share) const;
  // The same without those behind the scan's surface.
  uint64_t BinsInFront(double x_share, double y_share) const;
  // Something that the scan does not have may be seen at this pixel.
  bool IsOpen(int x, int y) const {
    return BinsInFront((x + 0.5) / scan_depth_.cols, (y + 0.5) / scan_depth_.rows) != 0;
  }
  // Inverse depths, 1/metres, of the first and the last bin.
  float first() const { return first_; }
  float last() const { return last_; }
  int Bin(float inverse_depth) const {
    return static_cast<int>((inverse_depth - first_) / (last_ - first_) * kBins);
  }

 private:
  cv::Mat1f scan_depth_;
  std::vector<cv::Mat1f> scan_normals_;
  int columns_ = 0, rows_ = 0;
  std::vector<uint64_t> bins_;  // of blocks of pixels
  float first_ = 0, last_ = 1;
};

struct DepthEstimate {
  cv::Mat1f depth;                 // metres, 0 = none: where open space was searched
  std::vector<cv::Mat1f> normals;  // as of a normal map
  cv::Mat1f score;                 // normalised cross-correlation with the best two sources, 0..1
  cv::Mat1i compared;              // the sources that show most, pixel by pixel: one bit each
  double share_open = 0;           // of the pixels
};

// Does not depend on num_threads.
DepthEstimate EstimateDepth(const StereoPicture& reference,
                            const std::vector<StereoPicture>& sources, const OpenSpace& open,
                            const PatchMatchOptions& options, uint64_t seed, int num_threads);

// Whether two depths, metres, are those of the same surface to PatchMatch.
bool IsSameDepth(float a, float b);

// What was found for another photo.
struct DepthOfSource {
  Camera camera;  // PINHOLE
  Rigid cam_from_scan;
  cv::Mat1f depth;                 // metres; 0 = nothing new
  std::vector<cv::Mat1f> normals;  // as of a normal map
};

// A second look, at what other photos have found: what is right in one photo is soon right in all.
// before: what EstimateDepth gave. found(0) to found(num_found - 1): asked for one after the other,
// none is kept. Does not depend on num_threads.
DepthEstimate RefineDepth(const StereoPicture& reference, const std::vector<StereoPicture>& sources,
                          const OpenSpace& open, const DepthEstimate& before, int num_found,
                          const std::function<DepthOfSource(int)>& found,
                          const PatchMatchOptions& options, uint64_t seed, int num_threads);

}  // namespace roomtex
