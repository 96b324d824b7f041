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

#include <opencv2/core/mat.hpp>

#include "core/camera_model.h"
#include "core/similarity.h"
#include "dense/open_space.h"
#include "dense/stereo_window.h"

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
