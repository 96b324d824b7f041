#pragma once
// From depth maps to the surface that scans do not have.

#include <array>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/scan.h"
#include "dense/patch_match.h"
#include "dense/scan_space.h"
#include "dense/stereo_views.h"

namespace roomtex {

class OptionFields;

struct SupplementOptions {
  // Normalised cross-correlation with the best two sources below which a depth counts for nothing.
  // Larger = stricter.
  double min_correlation = 0.7;
  // Photos that a place must be found from, from places 2 degrees apart as it sees them, the one
  // itself included. Larger = stricter.
  int min_support = 3;
  static constexpr int kMaxConfirming = 12;  // others that are asked
  // With this correlation two photos are enough; 1 = never. 0.85 finds more, and in some rooms
  // an island that is wrong (docs/dense.md). Larger = stricter.
  double min_pair_correlation = 1;
  // Depths of two photos agree within this share of the depth, and within two pixels. Larger = more
  // tolerant.
  double max_depth_difference = 0.005;
  // Metres; what is nearer to the scan's surface, or to what the scanner saw empty, is not added.
  double distance_to_scan = 0.025;
  // Metres between vertices, about. Smaller = finer, at most one per pixel.
  double spacing = 0.004;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

struct SupplementVertex {
  Eigen::Vector3d x_in_scan;
  Eigen::Vector3f normal;      // unit, towards the photo
  std::array<uint8_t, 3> rgb;  // of the photo
  int support;                 // photos that it was found from, from different places
  float confidence;            // correlation, 0..1
  float uncertainty;           // metres, standard deviation of the matching along the line of sight
};

struct Supplement {
  std::vector<SupplementVertex> vertices;
  std::vector<Triangle> triangles;
};

// Depths of one photo that others confirm. `depth` also holds the scan's where only it can be.
struct ConfirmedDepth {
  cv::Mat1f depth;                 // metres; 0 = unknown
  std::vector<cv::Mat1f> normals;  // as of a normal map
  cv::Mat1b support;               // photos; 0 = none, or the scan's
  cv::Mat1f uncertainty;           // metres
  cv::Mat1b is_new;                // 255 = not in the scan
};

// What another photo says.
struct DepthOfView {
  const StereoView* view;
  cv::Mat1f depth;  // of the scan where only it can be, else the estimate if it correlates
};

// What another photo sees through is not confirmed, however many others agree.
// estimate: of `view`. scan_only: the scan's depth where only it can be, else 0.
ConfirmedDepth ConfirmDepth(const StereoView& view, const DepthEstimate& estimate,
                            const cv::Mat1f& scan_only, const std::vector<DepthOfView>& others,
                            const ScanSpace& space, const SupplementOptions& options,
                            int num_threads);

// Collects the surfaces of one photo after the other: what an earlier one gave is not repeated.
class SupplementBuilder {
 public:
  explicit SupplementBuilder(const SupplementOptions& options);
  ~SupplementBuilder();
  // picture: 8-bit BGR, as the camera of the view sees it.
  void Add(const StereoView& view, const ConfirmedDepth& confirmed, const cv::Mat1f& score,
           const cv::Mat& picture);
  const Supplement& supplement() const { return supplement_; }

 private:
  struct Taken;
  SupplementOptions options_;
  std::unique_ptr<Taken> taken_;
  Supplement supplement_;
};

// Binary little-endian PLY: x, y, z (float, or double in a large frame), normal, colour, support,
// confidence, uncertainty; faces. scan: whose up axis and station the file names.
void WriteSupplement(const Supplement& supplement, const Scan& scan, const std::string& path);

}  // namespace roomtex
