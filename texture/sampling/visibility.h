#pragma once
// What a photo sees of the scan (thesis 8.1): depth map by an own rasteriser, depth test, normal
// test, depth-boundary mask. A depth map seen from elsewhere tested per point: shadow mapping
// (Williams 1978, "Casting Curved Shadows on Curved Surfaces").

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "texture/sampling/mesh_tiles.h"
#include "texture/sampling/photo_view.h"

namespace roomtex {

class OptionFields;

struct OcclusionOptions {
  // A sample is hidden when the surface rendered at its pixel is nearer by more than this share of
  // its depth. Larger = more tolerant. Thesis 8.1.2: 0.008. -1 = three standard deviations of the
  // scan's range noise and 0.1 % of the depth (0.4 % when the noise is not known): 0.8 % would let
  // what stands 2 cm in front of a wall paint it.
  double depth_tolerance = -1;
  // Width of the band on either side of a depth boundary in which a photo is not trusted, pixels of
  // the photo; pixels there mix both sides, and poses are off by a little. Poses that are off by
  // more pixels need more. -1 = 2 pixels.
  double boundary_px = -1;
  // The inverse depth changes over a depth boundary by more than this share of itself, apart from
  // the even change of a plane. Larger = fewer boundaries.
  double boundary_jump = 0.005;
  // Lines of sight through space that the scanner could not see are not trusted either: what stands
  // there is not in the scan (departure from the thesis). Nor are those that pass the last sample
  // of something by less than the spacing of the samples, because it may reach that far.
  bool shadows = true;
  // Smallest length of a depth map's longer side, pixels. Thesis 8.1.1: 1024. A scan finer than
  // that raises it, up to the photo's size.
  int depth_map_size = 1024;

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// Inverse depth (1/metres, see ProjectedBlock; 0 = nothing) on a raster over the photo's area.
// The nearest surface wins, so that the order of drawing does not matter.
class DepthMap {
 public:
  // scale: pixels of the map per pixel of the photo, <= 1. wraps: the left border of the photo
  // continues the right one (a panorama).
  DepthMap(int photo_width, int photo_height, double scale, bool wraps = false);

  // Draws the tiles that the photo may see. Triangles longer than max_edge_px (map pixels) are
  // split, because a lens bends their sides. Gives how many splits that took: at most one per pixel
  // of the map and 8 per triangle, beyond which they are drawn as they are.
  int64_t Draw(const PhotoProjector& projector, const std::vector<MeshTile>& tiles,
               float max_edge_px = 24);

  // Closes gaps of up to 2 * radius_px pixels with the nearest surface around them: single samples
  // that the scanner missed, and the cracks between a depth jump's two sides. Larger holes stay
  // (windows).
  void CloseGaps(int radius_px);

  const cv::Mat1f& inverse_depth() const { return inverse_depth_; }
  cv::Mat1f& inverse_depth() { return inverse_depth_; }
  float scale_x() const { return scale_x_; }
  float scale_y() const { return scale_y_; }

 private:
  cv::Mat1f inverse_depth_;
  float scale_x_, scale_y_;
  bool wraps_;
};

// Depth boundaries of a map (thesis 8.1.3), 255 or 0: where the inverse depth departs from that of
// a plane by more than `jump` times itself, and the borders of holes wider than twice hole_px
// (pixels of the map).
cv::Mat1b DepthBoundaries(const cv::Mat1f& inverse_depth, double jump, int hole_px);

// The mask around them: 255 within radius_px (pixels of the map), 0 elsewhere. A disc where the
// thesis dilates by a square: as wide in every direction.
cv::Mat1b BoundaryMask(const cv::Mat1b& boundaries, double radius_px);

// How a photo sees one sample.
enum class Sight : uint8_t {
  kHidden,    // not at all
  kShadow,    // through space that the scanner could not see: something may stand there
  kFringe,    // so near past the last sample of something that it may reach that far
  kBoundary,  // in the depth-boundary mask (B = 1)
  kClear,     // without any doubt
};

class PhotoVisibility {
 public:
  // angular_spacing: radians between neighbouring samples of the scans; 0 = not known.
  PhotoVisibility(const PhotoProjector& projector, const std::vector<OccluderTiles>& occluders,
                  double angular_spacing, const OcclusionOptions& options);

  // x, y in `img`, inside the photo; depth in metres, see ProjectedBlock.
  // Thesis 8.1.2, made exact at pixel borders: hidden only if all four map pixels around the
  // position show a nearer surface.
  Sight Look(float x, float y, float depth) const;

  const DepthMap& surface() const { return surface_; }
  const cv::Mat1b& boundary_mask() const { return mask_; }

 private:
  // The coarse surfaces, behind where they are.
  void DrawSetBack(const PhotoProjector& projector, const std::vector<OccluderTiles>& occluders,
                   double angular_spacing, const OcclusionOptions& options);

  DepthMap surface_;
  cv::Mat1f shadow_;  // inverse depth of the nearest shadow
  cv::Mat1f fringe_;  // and of the nearest fringe
  cv::Mat1b mask_;
  // Hidden when farther than 1 / w by more than share * depth + distance.
  float share_ = 0, distance_ = 0;
  bool wraps_ = false;
  bool IsBehind(float inverse_depth, float depth, float times) const {
    return depth * (1 - times * share_) - times * distance_ > 1 / inverse_depth;
  }
};

// Thesis 8.1.2: false when the sample's surface is turned away from the camera, (p - v).n >= 0.
// A sample without a normal (zero) faces every camera.
inline bool FacesCamera(const Eigen::Vector3f& camera_from_sample, const Eigen::Vector3f& normal) {
  return normal.isZero() || camera_from_sample.dot(normal) > 0;
}

}  // namespace roomtex
